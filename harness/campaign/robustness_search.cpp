#include "harness/campaign/robustness_search.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStepFirst = 0.2, kStepMax = 0.3, kStepMin = kStepFirst / 16;
constexpr std::size_t kAroundBest_count = 150, kEverywhere_count = 150;
// A system of equations of that size takes a few milliseconds.
constexpr std::size_t kFitted_count_max = 300;
// Distance of two names, against 1 for the whole length of an axis.
constexpr double kNameDistance = 0.5;
// Weights of prediction against distance, in turn.
constexpr double kLocalWeights[] = {0.3, 0.6, 0.8, 0.95, 1.0};
constexpr double kGlobalWeights[] = {0.5, 0.8};

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Through given values at given places: cubic radial basis functions and a linear part.
class Fit {
 public:
  Fit(std::vector<const VectorXd*> places, const std::vector<double>& values) : places_(std::move(places)) {
    const auto count = static_cast<Eigen::Index>(places_.size());
    const Eigen::Index dimension = places_.front()->size();
    const Eigen::Index size = count + dimension + 1;
    MatrixXd equations = MatrixXd::Zero(size, size);
    VectorXd right = VectorXd::Zero(size);
    for (Eigen::Index i = 0; i < count; ++i) {
      const VectorXd& place = Place(i);
      for (Eigen::Index j = 0; j < i; ++j)
        equations(i, j) = equations(j, i) = Cube((place - Place(j)).norm());
      right[i] = values[static_cast<std::size_t>(i)];
      equations(i, count) = equations(count, i) = 1;
      equations.block(i, count + 1, 1, dimension) = place.transpose();
      equations.block(count + 1, i, dimension, 1) = place;
    }
    // Keeps the system solvable where places coincide or lie in a plane.
    equations.diagonal().head(count).array() += 1e-9;
    equations.diagonal().tail(dimension + 1).array() -= 1e-9;
    factors_ = equations.partialPivLu().solve(right);
  }

  double At(const VectorXd& place) const {
    const auto count = static_cast<Eigen::Index>(places_.size());
    double value = factors_[count] + factors_.tail(place.size()).dot(place);
    for (Eigen::Index i = 0; i < count; ++i) value += factors_[i] * Cube((place - Place(i)).norm());
    return value;
  }

 private:
  static double Cube(double x) { return x * x * x; }
  const VectorXd& Place(Eigen::Index i) const { return *places_[static_cast<std::size_t>(i)]; }

  std::vector<const VectorXd*> places_;
  VectorXd factors_;
};

}  // namespace

RobustnessSearch::RobustnessSearch(std::vector<SearchAxis> axes, std::uint64_t stream,
                                   std::optional<SearchPoint> first)
    : axes_(std::move(axes)), random_(stream), first_(std::move(first)), step_(kStepFirst) {
  Check(!axes_.empty(), "a search has an axis");
  Check(!first_ || first_->size() == axes_.size(), "a point has a number for each axis");
}

std::vector<SearchPoint> RobustnessSearch::Ask() {
  Check(asked_.empty(), "a search is told what it asked before it is asked again");
  if (told_.empty()) {
    asked_ = Spread(std::max<std::size_t>(10, 2 * axes_.size() + 4));
    if (first_) asked_.front() = *first_;
  } else if (step_ < kStepMin) {
    step_ = kStepFirst;
    successes_ = failures_ = 0;
    started_at_ = told_.size();
    asked_ = Spread(2 * kSearchBatch_count);
  } else {
    asked_ = ChooseNext();
  }
  return asked_;
}

void RobustnessSearch::Tell(const std::vector<double>& robustness) {
  Check(robustness.size() <= asked_.size(), "a search is told what it asked");
  const bool is_start = told_.size() == started_at_;
  const double before = is_start ? 0 : told_[BestSinceStart()].robustness;
  for (std::size_t i = 0; i < robustness.size(); ++i)
    told_.push_back({asked_[i], PlaceOf(asked_[i]),
                     std::isnan(robustness[i]) ? std::numeric_limits<double>::infinity() : robustness[i]});
  asked_.clear();
  if (is_start || told_.empty()) return;
  const double after = told_[BestSinceStart()].robustness;
  const bool better = std::isinf(before) ? after < before : after < before - 1e-3 * std::abs(before);
  successes_ = better ? successes_ + 1 : 0;
  failures_ = better ? 0 : failures_ + 1;
  if (successes_ == 2) {
    step_ = std::min(kStepMax, 2 * step_);
    successes_ = 0;
  }
  const auto patience =
      std::max<std::size_t>(2, (axes_.size() + kSearchBatch_count - 1) / kSearchBatch_count);
  if (static_cast<std::size_t>(failures_) >= patience) {
    step_ /= 2;
    failures_ = 0;
  }
}

const SearchPoint* RobustnessSearch::best() const {
  const auto least = std::min_element(
      told_.begin(), told_.end(), [](const Told& a, const Told& b) { return a.robustness < b.robustness; });
  return least == told_.end() ? nullptr : &least->point;
}

std::size_t RobustnessSearch::BestSinceStart() const {
  std::size_t best = started_at_;
  for (std::size_t i = started_at_; i < told_.size(); ++i)
    if (told_[i].robustness < told_[best].robustness) best = i;
  return best;
}

// A Latin hypercube: on each axis, one point in each of `count` equal parts.
std::vector<SearchPoint> RobustnessSearch::Spread(std::size_t count) {
  std::vector<SearchPoint> points(count, SearchPoint(axes_.size()));
  std::vector<std::size_t> parts(count);
  for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
    std::iota(parts.begin(), parts.end(), std::size_t{0});
    for (std::size_t i = count; i > 1; --i) std::swap(parts[i - 1], parts[random_.Below(i)]);
    for (std::size_t i = 0; i < count; ++i)
      points[i][axis] =
          FromUnit(axis, (static_cast<double>(parts[i]) + random_.Uniform()) / static_cast<double>(count));
  }
  return points;
}

std::vector<SearchPoint> RobustnessSearch::ChooseNext() {
  std::vector<Candidate> candidates = MakeCandidates();
  const auto by_predicted = [](const Candidate& a, const Candidate& b) { return a.predicted < b.predicted; };
  const auto by_distance = [](const Candidate& a, const Candidate& b) { return a.distance < b.distance; };
  const auto [low, high] = std::minmax_element(candidates.begin(), candidates.end(), by_predicted);
  const double predicted_min = low->predicted, predicted_span = high->predicted - low->predicted + 1e-12;
  std::vector<SearchPoint> chosen;
  for (std::size_t i = 0; i < kSearchBatch_count; ++i, ++chosen_count_) {
    const bool is_global = i == 0;
    const double weight = is_global ? kGlobalWeights[chosen_count_ / kSearchBatch_count % 2]
                                    : kLocalWeights[chosen_count_ % std::size(kLocalWeights)];
    const auto [near, far] = std::minmax_element(candidates.begin(), candidates.end(), by_distance);
    const double distance_max = far->distance, distance_span = far->distance - near->distance + 1e-12;
    const Candidate* best = nullptr;
    double best_value = std::numeric_limits<double>::infinity();
    for (std::size_t k = is_global ? kAroundBest_count : 0; k < candidates.size(); ++k) {
      const Candidate& candidate = candidates[k];
      if (candidate.distance < 1e-7) continue;
      const double value = weight * (candidate.predicted - predicted_min) / predicted_span +
                           (1 - weight) * (distance_max - candidate.distance) / distance_span;
      if (value < best_value) best = &candidate, best_value = value;
    }
    if (best == nullptr) {  // whole numbers only, and all candidates were flown
      chosen.push_back(Spread(1).front());
      continue;
    }
    chosen.push_back(best->point);
    const VectorXd place = best->place;
    for (Candidate& candidate : candidates)
      candidate.distance = std::min(candidate.distance, (candidate.place - place).norm());
  }
  return chosen;
}

std::vector<RobustnessSearch::Candidate> RobustnessSearch::MakeCandidates() {
  // Where robustness is large, its values say little about where it is small: all above the median count as that.
  std::vector<double> finite;
  for (const Told& told : told_)
    if (std::isfinite(told.robustness)) finite.push_back(told.robustness);
  const double cap = finite.empty() ? 0 : Median(finite);
  std::vector<const Told*> fitted;
  for (const Told& told : told_) fitted.push_back(&told);
  if (fitted.size() > kFitted_count_max) {
    const VectorXd best = told_[BestSinceStart()].place;
    std::stable_sort(fitted.begin(), fitted.end(), [&](const Told* a, const Told* b) {
      return (a->place - best).squaredNorm() < (b->place - best).squaredNorm();
    });
    fitted.resize(kFitted_count_max);
  }
  std::vector<const VectorXd*> places;
  std::vector<double> values;
  for (const Told* told : fitted) {
    places.push_back(&told->place);
    values.push_back(std::min(told->robustness, cap));
  }
  const Fit fit(places, values);
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < kAroundBest_count + kEverywhere_count; ++i) {
    Candidate candidate;
    candidate.point = i < kAroundBest_count ? NearBest(i) : Spread(1).front();
    candidate.place = PlaceOf(candidate.point);
    candidate.predicted = fit.At(candidate.place);
    candidate.distance = std::numeric_limits<double>::infinity();
    for (const Told& told : told_)
      candidate.distance = std::min(candidate.distance, (told.place - candidate.place).norm());
    candidates.push_back(std::move(candidate));
  }
  return candidates;
}

// The best point with some of its numbers changed; candidate `number` changes at least one.
SearchPoint RobustnessSearch::NearBest(std::size_t number) {
  const double share = std::clamp(3.0 / static_cast<double>(axes_.size()), 0.3, 1.0);
  SearchPoint point = told_[BestSinceStart()].point;
  for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
    if (!random_.Bernoulli(share) && number % axes_.size() != axis) continue;
    const SearchAxis& kind = axes_[axis];
    if (!kind.ordered) {
      if (random_.Bernoulli(0.5)) point[axis] = FromUnit(axis, random_.Uniform());
      continue;
    }
    const double step = kind.values_count == 0 ? step_ : std::max(step_, 0.6 / kind.values_count);
    point[axis] = FromUnit(axis, Fold(ToUnit(axis, point[axis]) + step * random_.StandardNormal()));
  }
  return point;
}

// Back into [0, 1]: half of what lies outside goes to the end itself, because the worst is often there.
double RobustnessSearch::Fold(double unit) {
  if (unit >= 0 && unit <= 1) return unit;
  const double end = unit < 0 ? 0 : 1;
  return random_.Bernoulli(0.5) ? end : std::clamp(2 * end - unit, 0.0, 1.0);
}

double RobustnessSearch::FromUnit(std::size_t axis, double unit) const {
  const int count = axes_[axis].values_count;
  return count == 0 ? unit : std::min(std::floor(unit * count), count - 1.0);
}

double RobustnessSearch::ToUnit(std::size_t axis, double value) const {
  const int count = axes_[axis].values_count;
  return count == 0 ? value : (value + 0.5) / count;
}

VectorXd RobustnessSearch::PlaceOf(const SearchPoint& point) const {
  std::vector<double> place;
  for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
    const SearchAxis& kind = axes_[axis];
    if (kind.ordered) {
      place.push_back(ToUnit(axis, point[axis]));
      continue;
    }
    for (int value = 0; value < kind.values_count; ++value)
      place.push_back(value == static_cast<int>(point[axis]) ? kNameDistance / std::sqrt(2.0) : 0);
  }
  return Eigen::Map<VectorXd>(place.data(), static_cast<Eigen::Index>(place.size()));
}

}  // namespace tiltproof::harness
