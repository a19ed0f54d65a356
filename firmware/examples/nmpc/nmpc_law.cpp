#include "firmware/examples/nmpc/nmpc_law.h"

#include <algorithm>
#include <cmath>
#include <utility>

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

NmpcLaw::Row NmpcLaw::Predicted(Row state, double from_s, double to_s) const {
  const Row* input = &vehicle_.input_hover;
  std::size_t next = 0;
  for (; next < sent_.size() && sent_[next].effect_s <= from_s; ++next) input = &sent_[next].input;
  while (from_s < to_s) {
    const bool has_next = next < sent_.size() && sent_[next].effect_s < to_s;
    const double end_s = std::min(has_next ? sent_[next].effect_s : to_s, from_s + kPredictionStep_s);
    state = planner_->Predict(state, *input, disturbance_, end_s - from_s);
    from_s = end_s;
    if (has_next && end_s >= sent_[next].effect_s) input = &sent_[next++].input;
  }
  return state;
}

void NmpcLaw::Observe(double sampled_s, const Row& state) {
  if (last_sampled_s_ && sampled_s > *last_sampled_s_ && sampled_s - *last_sampled_s_ < kObserved_s) {
    const Row expected = Predicted(last_state_, *last_sampled_s_, sampled_s);
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

TimeNs NmpcLaw::Step(const firmware::Turn& turn, std::span<const float> sensed, const Reference& reference,
                     std::span<float> command) {
  const double sampled_s = ToSeconds(turn.requested);
  const Row state = StateOf(sensed);
  Observe(sampled_s, state);
  while (sent_.size() > 1 && sent_[1].effect_s < sampled_s - kObserved_s) sent_.pop_front();
  preview_.Take(ToSeconds(turn.now), reference);
  if (computing_ && turn.now >= ready_ns_) {
    planner_->Adopt();
    computing_ = false;
    has_plan_ = true;
  }

  TimeNs leaves = turn.now;
  if (!computing_) {
    const double effect_s = ToSeconds(turn.now + last_work_ns_) + kTransport_s;
    const Row start = Predicted(state, sampled_s, effect_s);
    std::vector<PathPoint> path = preview_.Path(effect_s, planner_->lengths_s());
    const Eigen::Vector3d way = path[0].p_m - Eigen::Vector3d(start[0], start[1], start[2]);
    if (const double length_m = way.norm(); length_m > kWay_m)
      for (PathPoint& point : path) point.p_m -= (1 - kWay_m / length_m) * way;
    last_work_ns_ = WorkTime(planner_->Plan(start, disturbance_, effect_s, path));
    const TimeNs ready = last_work_ns_ > 0 ? compute_(turn.now, last_work_ns_, turn.deadline) : turn.now;
    if (ready <= turn.deadline) {
      planner_->Adopt();
      leaves = ready;
      has_plan_ = true;
    } else {
      computing_ = true;
      ready_ns_ = ready;
    }
  }
  const double effect_s = ToSeconds(leaves) + kTransport_s;
  // There is nothing to shift before the first plan: the vehicle waits for it with hover's input.
  const Row input = has_plan_ ? planner_->InputAt(effect_s) : vehicle_.input_hover;
  for (std::size_t i = 0; i < command.size(); ++i)
    command[i] = static_cast<float>(std::clamp(input[i], vehicle_.input_min[i], vehicle_.input_max[i]));
  sent_.push_back({effect_s, Row(command.begin(), command.end())});
  return leaves;
}

}  // namespace tiltproof::nmpc
