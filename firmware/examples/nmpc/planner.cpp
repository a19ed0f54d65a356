#include "firmware/examples/nmpc/planner.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <system_error>
#include <thread>

#include "firmware/examples/nmpc/riccati_qp.h"

namespace tiltproof::nmpc {
namespace {

// Costs per second, of squares. Thrusts count as shares of hover's mean thrust, torques as shares of that at 1 m.
constexpr double kPosition = 40, kVelocity = 4, kLean = 0.5, kYaw = 8, kHinge = 0.5;
constexpr double kRollPitchRate = 0.15, kYawRate = 0.6, kHingeRate = 2e-3;
constexpr double kThrust = 300, kTorque = 3e5;
constexpr double kSoftLinear = 1000, kSoftQuadratic = 10000;
// Distance of the octagon's sides from its centre, as a share of that of its corners.
const double kOctagon = std::cos(M_PI / 8);

// Longest interval. Over a longer one with constant inputs the hinges swing far, its derivatives are large, and the
// iterations diverge within some periods: with one of 0.67 s, and of 0.78 s, the inputs were no numbers after a quarter
// of a second.
constexpr double kIntervalMax_s = 0.6;
constexpr double kGrowthMax = 4;

// Sum of n lengths: first, first r, first r^2, ...
double SumOf(double first, double r, int n) {
  double total = 0, length = first;
  for (int k = 0; k < n; ++k, length *= r) total += length;
  return total;
}

// The factor of lengths first, first r, first r^2, ... (n of them) whose sum is `sum`.
double GrowthOf(double first, int n, double sum) {
  double low = 0.2, high = kGrowthMax;
  for (int i = 0; i < 200; ++i) {
    const double r = 0.5 * (low + high);
    (SumOf(first, r, n) < sum ? low : high) = r;
  }
  return 0.5 * (low + high);
}

// Calls work(i) for 0 <= i < count, in as many threads. Each call must write to a place of its own.
template <class Function>
void InThreads(int threads, std::size_t count, const Function& work) {
  const auto part = [&](std::size_t first) {
    for (std::size_t i = first; i < count; i += static_cast<std::size_t>(threads)) work(i);
  };
  std::vector<std::thread> others;
  std::size_t begun = 1;
  try {
    for (; begun < static_cast<std::size_t>(threads); ++begun) others.emplace_back(part, begun);
  } catch (const std::system_error&) {
    // No more threads: their parts are computed here.
  }
  part(0);
  for (; begun < static_cast<std::size_t>(threads); ++begun) part(begun);
  for (std::thread& other : others) other.join();
}

template <int kHinges, int kRotors>
class PlannerOf final : public Planner {
  using Size = Sizes<kHinges, kRotors>;
  using State = typename Size::State;
  using Input = typename Size::Input;
  static constexpr int kV = 6 + kHinges, kW = 9 + kHinges, kRows = 4 + kHinges;
  using Qp = RiccatiQp<Size::kStates, Size::kInputs, kRows>;

 public:
  PlannerOf(const Rotorcraft& vehicle, const Options& options)
      : vehicle_(vehicle),
        options_(options),
        dynamics_(vehicle),
        qp_(static_cast<std::size_t>(options.intervals)) {
    const double growth = GrowthOf(vehicle.period_s, options.intervals, options.horizon_s);
    double length_s = vehicle.period_s;
    for (int k = 0; k < options.intervals; ++k, length_s *= growth) lengths_s_.push_back(length_s);

    hover_x_.setZero();
    hover_x_[3] = vehicle.roll_hover_rad;
    hover_x_[4] = vehicle.pitch_hover_rad;
    for (int i = 0; i < kHinges; ++i) hover_x_[6 + i] = vehicle.hinge_hover_rad[static_cast<std::size_t>(i)];
    double thrust_n = 0;
    for (int i = 0; i < Size::kInputs; ++i) {
      const auto at = static_cast<std::size_t>(i);
      hover_u_[i] = vehicle.input_hover[at];
      u_min_[i] = vehicle.input_min[at];
      u_max_[i] = vehicle.input_max[at];
      if (i >= kRotors) continue;
      thrust_n += hover_u_[i] / kRotors;
      if (options.thrust_max_n > 0) u_max_[i] = std::min(u_max_[i], options.thrust_max_n);
    }
    cost_x_ << State::Zero();
    cost_x_.template head<3>().setConstant(kPosition);
    cost_x_.template segment<2>(3).setConstant(kLean);
    cost_x_[5] = kYaw;
    cost_x_.template segment<kHinges>(6).setConstant(kHinge);
    cost_x_.template segment<3>(kV).setConstant(kVelocity);
    cost_x_.template segment<2>(kW).setConstant(kRollPitchRate);
    cost_x_[kW + 2] = kYawRate;
    cost_x_.template tail<kHinges>().setConstant(kHingeRate);
    for (int i = 0; i < Size::kInputs; ++i)
      cost_u_[i] = (i < kRotors ? kThrust : kTorque) / (thrust_n * thrust_n);
    SetSoftLimits();
    SetEndCost();
    plan_.x.assign(lengths_s_.size() + 1, hover_x_);
    plan_.u.assign(lengths_s_.size(), hover_u_);
    next_ = plan_;
  }

  Work Plan(const std::vector<double>& start, const Disturbance& disturbance, double time_s,
            const std::vector<PathPoint>& path) override {
    const State x_0 = Eigen::Map<const State>(start.data());
    if (!has_plan_) {
      plan_.x.assign(plan_.x.size(), x_0);
      plan_.time_s = time_s;
    }
    Shift(time_s, x_0);
    has_plan_ = true;
    Work work;
    for (int i = 0; i < options_.iterations; ++i) {
      InThreads(options_.threads, lengths_s_.size(), [&](std::size_t k) { Shoot(k, disturbance); });
      SetCosts(path, x_0);
      const QpResult result = qp_.Solve(x_0, options_.sweeps_max);
      next_.x = qp_.x;
      next_.u = qp_.u;
      work.sweeps += result.sweeps;
      work.intervals += (1 + result.sweeps) * options_.intervals;
    }
    return work;
  }

  // A plan that diverged holds values that are no numbers: then the plan before goes on, and the next one starts from the state.
  void Adopt() override {
    const auto is_finite = [](const auto& value) { return value.allFinite(); };
    has_plan_ = std::all_of(next_.x.begin(), next_.x.end(), is_finite) &&
                std::all_of(next_.u.begin(), next_.u.end(), is_finite);
    if (has_plan_) plan_ = next_;
  }

  std::vector<double> InputAt(double time_s) const override {
    const Input u = InputOf(plan_, time_s);
    return {u.data(), u.data() + u.size()};
  }

  std::vector<double> Predict(const std::vector<double>& start, const std::vector<double>& input,
                              const Disturbance& disturbance, double length_s) const override {
    const State x = dynamics_.Advance(Eigen::Map<const State>(start.data()),
                                      Eigen::Map<const Input>(input.data()), disturbance, length_s);
    return {x.data(), x.data() + x.size()};
  }

  const std::vector<double>& lengths_s() const override { return lengths_s_; }

 private:
  struct Trajectory {
    double time_s = 0;
    std::vector<State> x;
    std::vector<Input> u;
  };

  void SetSoftLimits() {
    auto& soft = qp_.soft;
    const double r = std::sqrt(0.5), tilt = kOctagon * options_.tilt_max_rad;
    soft.rows(0, 3) = soft.rows(1, 4) = 1;
    soft.rows(2, 3) = soft.rows(2, 4) = soft.rows(3, 3) = r;
    soft.rows(3, 4) = -r;
    for (int i = 0; i < 4; ++i) {
      soft.min[i] = -tilt;
      soft.max[i] = tilt;
    }
    for (int i = 0; i < kHinges; ++i) {
      soft.rows(4 + i, 6 + i) = 1;
      soft.min[4 + i] = vehicle_.hinges[static_cast<std::size_t>(i)].angle_min_rad;
      soft.max[4 + i] = vehicle_.hinges[static_cast<std::size_t>(i)].angle_max_rad;
    }
    soft.linear.setConstant(kSoftLinear);
    soft.quadratic.setConstant(kSoftQuadratic);
    qp_.soft_weight[0] = 0;
    for (std::size_t k = 0; k < lengths_s_.size(); ++k) qp_.soft_weight[k + 1] = lengths_s_[k];
  }

  // The regulator's cost from hover on, by iterating Riccati's equation with the control period until it stands still.
  void SetEndCost() {
    const auto step = dynamics_.AdvanceLinearised(hover_x_, hover_u_, {}, vehicle_.period_s);
    typename Size::A p = cost_x_.asDiagonal();
    constexpr int kStepsMax = 5000;
    for (int i = 0; i < kStepsMax; ++i) {
      const typename Size::B pb = p * step.b;
      Eigen::Matrix<double, Size::kInputs, Size::kInputs> h = step.b.transpose() * pb;
      h.diagonal() += vehicle_.period_s * cost_u_;
      const Eigen::Matrix<double, Size::kInputs, Size::kStates> g = pb.transpose() * step.a;
      typename Size::A next = step.a.transpose() * p * step.a - g.transpose() * h.llt().solve(g);
      next = 0.5 * (next + next.transpose()).eval();
      next.diagonal() += vehicle_.period_s * cost_x_;
      const double change = (next - p).cwiseAbs().maxCoeff();
      p = next;
      if (change < 1e-9 * p.cwiseAbs().maxCoeff()) break;
    }
    qp_.cost_end = p;
  }

  // The plan from `time_s` on.
  void Shift(double time_s, const State& x_0) {
    next_.time_s = time_s;
    double at_s = time_s;
    for (std::size_t k = 0; k < lengths_s_.size(); ++k) {
      next_.x[k] = StateOf(plan_, at_s);
      next_.u[k] = InputOf(plan_, at_s + 0.5 * lengths_s_[k]);
      at_s += lengths_s_[k];
    }
    next_.x.back() = StateOf(plan_, at_s);
    next_.x[0] = x_0;
    // A whole turn between plan and vehicle must not look like an error of yaw.
    for (State& x : next_.x) x[5] = x_0[5] + std::remainder(x[5] - x_0[5], 2 * M_PI);
  }
  Input InputOf(const Trajectory& plan, double time_s) const {
    double end_s = plan.time_s;
    for (std::size_t k = 0; k < lengths_s_.size(); ++k)
      if (time_s < (end_s += lengths_s_[k])) return plan.u[k];
    return hover_u_;
  }
  State StateOf(const Trajectory& plan, double time_s) const {
    double begin_s = plan.time_s;
    for (std::size_t k = 0; k < lengths_s_.size(); ++k) {
      const double share = (time_s - begin_s) / lengths_s_[k];
      if (share < 1) return plan.x[k] + std::max(share, 0.0) * (plan.x[k + 1] - plan.x[k]);
      begin_s += lengths_s_[k];
    }
    return plan.x.back();
  }

  void Shoot(std::size_t k, const Disturbance& disturbance) {
    const State& x = next_.x[k];
    const Input& u = next_.u[k];
    const auto interval = dynamics_.AdvanceLinearised(x, u, disturbance, lengths_s_[k]);
    auto& stage = qp_.stages[k];
    stage.a = interval.a;
    stage.b = interval.b;
    stage.offset = interval.end - interval.a * x - interval.b * u;
  }

  State Target(const PathPoint& point, double yaw_rad) const {
    State x = hover_x_;
    x.template head<3>() = point.p_m;
    x[5] = yaw_rad + std::remainder(point.yaw_rad - yaw_rad, 2 * M_PI);
    x.template segment<3>(kV) = point.v_m_s;
    x[kW + 2] = point.yaw_rate_rad_s;
    return x;
  }

  void SetCosts(const std::vector<PathPoint>& path, const State& x_0) {
    for (std::size_t k = 0; k < lengths_s_.size(); ++k) {
      auto& stage = qp_.stages[k];
      stage.cost_x = lengths_s_[k] * cost_x_;
      stage.slope_x = -stage.cost_x.cwiseProduct(Target(path[k], x_0[5]));
      stage.cost_u = lengths_s_[k] * cost_u_;
      stage.slope_u = -stage.cost_u.cwiseProduct(hover_u_);
      stage.u_min = u_min_;
      stage.u_max = u_max_;
    }
    qp_.slope_end = -qp_.cost_end * Target(path.back(), x_0[5]);
  }

  const Rotorcraft vehicle_;
  const Options options_;
  const Dynamics<kHinges, kRotors> dynamics_;
  std::vector<double> lengths_s_;
  State hover_x_, cost_x_;
  Input hover_u_, cost_u_, u_min_, u_max_;
  Qp qp_;
  Trajectory plan_, next_;
  bool has_plan_ = false;
};

template <int kHinges, int kRotors>
std::unique_ptr<Planner> MakeIf(const Rotorcraft& vehicle, const Options& options) {
  if (vehicle.hinges.size() != kHinges || vehicle.rotors.size() != kRotors) return nullptr;
  return std::make_unique<PlannerOf<kHinges, kRotors>>(vehicle, options);
}

}  // namespace

std::string HorizonProblem(const Options& options, double first_s) {
  const int n = options.intervals;
  char text[240] = "";
  const double longest_s = first_s * std::pow(GrowthOf(first_s, n, options.horizon_s), n - 1);
  if (const double covered_s = SumOf(first_s, kGrowthMax, n); options.horizon_s > covered_s)
    std::snprintf(
        text, sizeof(text),
        "%d intervals cover %.3g s at most, because each is at most %g times as long as the one before: "
        "horizon_s is %g; use more intervals, or a shorter horizon",
        n, covered_s, kGrowthMax, options.horizon_s);
  else if (longest_s > kIntervalMax_s)
    std::snprintf(
        text, sizeof(text),
        "the last of %d intervals over horizon_s = %g is %.3g s long, and at most %g s are allowed, because "
        "the plan diverges over a longer one; use more intervals, or a shorter horizon",
        n, options.horizon_s, longest_s, kIntervalMax_s);
  return text;
}

std::unique_ptr<Planner> MakePlanner(const Rotorcraft& vehicle, const Options& options) {
  if (auto tiltrotor = MakeIf<2, 2>(vehicle, options)) return tiltrotor;
  return MakeIf<0, 4>(vehicle, options);
}

}  // namespace tiltproof::nmpc
