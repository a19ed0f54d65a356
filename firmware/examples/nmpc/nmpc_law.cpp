#include "firmware/examples/nmpc/nmpc_law.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "firmware/ports/host/own_numbers.h"
#include "link/time.h"

namespace tiltproof::nmpc {
namespace {

// From the first bit of a command to its effect, with the vehicle's own processing: about the time of its message, and
// half of a processing step of 4 ms.
constexpr double kTransport_s = 0.003;
// Shares of the unexplained acceleration that the disturbance takes over in each period.
constexpr double kLinearGain = 0.1, kAngularGain = 0.1;
constexpr double kLinearMax_m_s2 = 8, kAngularMax_rad_s2 = 30;
// Samples further apart say nothing on an acceleration. Also the age of commands that are kept.
constexpr double kObserved_s = 0.2;
// A longer way to the reference is flown as one of this length, because the horizon sees only so far.
constexpr double kWay_m = 2;
constexpr double kPredictionStep_s = 0.012;

double Limited(double value, double limit) { return std::clamp(value, -limit, limit); }

}  // namespace

std::string ReadOptions(const char* parameters, Options& options) {
  double intervals = options.intervals, iterations = options.iterations, sweeps_max = options.sweeps_max,
         threads = options.threads;
  const std::array<firmware::OwnNumber, 8> known = {{{"intervals", intervals, 2, 200, true},
                                                     {"horizon_s", options.horizon_s, 0.02, 10},
                                                     {"iterations", iterations, 1, 20, true},
                                                     {"sweeps_max", sweeps_max, 1, 100, true},
                                                     {"threads", threads, 1, 64, true},
                                                     {"tilt_max_rad", options.tilt_max_rad, 0.05, 1.4},
                                                     {"thrust_max_n", options.thrust_max_n, 0, 1e3},
                                                     {"compute_us", options.compute_us, 0, 1e5}}};
  std::string problem = firmware::ReadOwnNumbers(parameters, known);
  options.intervals = static_cast<int>(intervals);
  options.iterations = static_cast<int>(iterations);
  options.sweeps_max = static_cast<int>(sweeps_max);
  options.threads = static_cast<int>(threads);
  return problem;
}

NmpcLaw::NmpcLaw(const Rotorcraft& vehicle, const Options& options, bool rates_in_world, Compute compute)
    : vehicle_(vehicle),
      options_(options),
      rates_in_world_(rates_in_world),
      compute_(std::move(compute)),
      planner_(MakePlanner(vehicle, options)),
      last_work_ns_(
          WorkTime({.sweeps = options.iterations, .intervals = 2 * options.iterations * options.intervals})) {
}

TimeNs NmpcLaw::WorkTime(const Work& work) const {
  return std::llround(work.intervals * options_.compute_us * 1e3);
}

NmpcLaw::Row NmpcLaw::StateOf(std::span<const float> sensed) const {
  Row state(sensed.begin(), sensed.end());
  if (!rates_in_world_) return state;
  const std::size_t w = state.size() / 2 + 3;
  const Eigen::Matrix3d R_WB = (Eigen::AngleAxisd(state[5], Eigen::Vector3d::UnitZ()) *
                                Eigen::AngleAxisd(state[4], Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(state[3], Eigen::Vector3d::UnitX()))
                                   .toRotationMatrix();
  const Eigen::Vector3d in_body = R_WB.transpose() * Eigen::Vector3d(state[w], state[w + 1], state[w + 2]);
  std::copy(in_body.data(), in_body.data() + 3, state.begin() + static_cast<long>(w));
  return state;
}

NmpcLaw::Row NmpcLaw::Predicted(Row state, double from_s, double to_s, const std::deque<Sent>& sent) const {
  const Row* input = &vehicle_.input_hover;
  std::size_t next = 0;
  for (; next < sent.size() && sent[next].effect_s <= from_s; ++next) input = &sent[next].input;
  while (from_s < to_s) {
    const bool has_next = next < sent.size() && sent[next].effect_s < to_s;
    const double end_s = std::min(has_next ? sent[next].effect_s : to_s, from_s + kPredictionStep_s);
    state = planner_->Predict(state, *input, disturbance_, end_s - from_s);
    from_s = end_s;
    if (has_next && end_s >= sent[next].effect_s) input = &sent[next++].input;
  }
  return state;
}

NmpcLaw::Row NmpcLaw::ShiftedInput(double at_s) const {
  // There is nothing to shift before the first plan: the vehicle waits for it with hover's input.
  Row input = has_plan_ ? planner_->InputAt(at_s) : vehicle_.input_hover;
  for (std::size_t i = 0; i < input.size(); ++i)
    input[i] = static_cast<float>(std::clamp(input[i], vehicle_.input_min[i], vehicle_.input_max[i]));
  return input;
}

void NmpcLaw::Observe(double sampled_s, const Row& state) {
  if (last_sampled_s_ && sampled_s > *last_sampled_s_ && sampled_s - *last_sampled_s_ < kObserved_s) {
    const Row expected = Predicted(last_state_, *last_sampled_s_, sampled_s, sent_);
    const double rate = 1 / (sampled_s - *last_sampled_s_);
    const std::size_t v = state.size() / 2, w = v + 3;
    for (std::size_t i = 0; i < 3; ++i) {
      double& linear = disturbance_.linear_m_s2[static_cast<long>(i)];
      double& angular = disturbance_.angular_rad_s2[static_cast<long>(i)];
      linear = Limited(linear + kLinearGain * rate * (state[v + i] - expected[v + i]), kLinearMax_m_s2);
      angular = Limited(angular + kAngularGain * rate * (state[w + i] - expected[w + i]), kAngularMax_rad_s2);
    }
  }
  last_sampled_s_ = sampled_s;
  last_state_ = state;
}

TimeNs NmpcLaw::Step(const firmware::ControlPeriod& period, std::span<const float> sensed,
                     const Reference& reference, std::span<float> command) {
  const double sampled_s = ToSeconds(period.requested);
  const Row state = StateOf(sensed);
  Observe(sampled_s, state);
  while (sent_.size() > 1 && sent_[1].effect_s < sampled_s - kObserved_s) sent_.pop_front();
  preview_.Add(ToSeconds(period.now), reference);
  if (computing_ && period.now >= ready_ns_) {
    planner_->Adopt();
    computing_ = false;
    has_plan_ = true;
  }

  TimeNs leaves = period.now;
  if (!computing_) {
    const double effect_s = ToSeconds(period.now + last_work_ns_) + kTransport_s;
    // While a plan is late, the shifted one flies.
    std::deque<Sent> sent = sent_;
    if (period.now + last_work_ns_ > period.deadline)
      for (double at_s = ToSeconds(period.now) + kTransport_s; at_s < effect_s; at_s += vehicle_.period_s)
        sent.push_back({at_s, ShiftedInput(at_s)});
    const Row start = Predicted(state, sampled_s, effect_s, sent);
    std::vector<PathPoint> path = preview_.Path(effect_s, planner_->lengths_s());
    const Eigen::Vector3d way = path[0].p_m - Eigen::Vector3d(start[0], start[1], start[2]);
    if (const double length_m = way.norm(); length_m > kWay_m)
      for (PathPoint& point : path) point.p_m -= (1 - kWay_m / length_m) * way;
    last_work_ns_ = WorkTime(planner_->Plan(start, disturbance_, effect_s, path));
    const TimeNs ready =
        last_work_ns_ > 0 ? compute_(period.now, last_work_ns_, period.deadline) : period.now;
    if (ready <= period.deadline) {
      planner_->Adopt();
      leaves = ready;
      has_plan_ = true;
    } else {
      computing_ = true;
      ready_ns_ = ready;
    }
  }
  const double effect_s = ToSeconds(leaves) + kTransport_s;
  const Row input = ShiftedInput(effect_s);
  std::copy(input.begin(), input.begin() + static_cast<long>(command.size()), command.begin());
  sent_.push_back({effect_s, Row(command.begin(), command.end())});
  return leaves;
}

}  // namespace tiltproof::nmpc
