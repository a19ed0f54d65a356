// The control law of the example: observes the vehicle, plans, and gives the first input of the plan.
//
//   NmpcLaw law(vehicle, options, rates_in_world, compute);
//   TimeNs leaves = law.Step(period, sensed, reference, command);   // once per period
//
// Four parts:
//
//  - The state is predicted from its sampling to the time at which the command takes effect, with the commands that
//    are in force meanwhile. So a late line and the computing time are no delay of the loop.
//  - A disturbance, one acceleration of the body and one angular, makes up for what the model does not explain: wind, a
//    weak rotor, another mass. It follows the difference between prediction and measurement.
//  - The planner plans from there along the previewed reference.
//  - Computing takes time. A plan that is ready before the period's end is sent at once. For a later one the plan
//    before it is shifted: its input for the present time leaves without delay in each period, until the new plan is ready.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware/examples/nmpc/planner.h"
#include "firmware/examples/nmpc/reference_preview.h"
#include "firmware/lqr/lqr_application.h"

namespace tiltproof::nmpc {

using firmware::Compute;

// The numbers that a scenario sets (docs/nmpc.md). Returns what is wrong with them; empty: nothing.
std::string ReadOptions(const char* parameters, Options& options);

class NmpcLaw final : public firmware::CycleLaw {
 public:
  NmpcLaw(const Rotorcraft& vehicle, const Options& options, bool rates_in_world, Compute compute);

  // False: there is no code for this vehicle, and Step must not be called.
  bool can_fly() const { return planner_ != nullptr; }

  TimeNs Step(const firmware::ControlPeriod& period, std::span<const float> sensed,
              const Reference& reference, std::span<float> command) override;

 private:
  using Row = std::vector<double>;
  struct Sent {
    double effect_s;
    Row input;
  };

  Row StateOf(std::span<const float> sensed) const;
  // From `from_s` to `to_s`, with these inputs.
  Row Predicted(Row state, double from_s, double to_s, const std::deque<Sent>& sent) const;
  // The input of the plan in force, as it is sent.
  Row ShiftedInput(double at_s) const;
  void Observe(double sampled_s, const Row& state);
  TimeNs WorkTime(const Work& work) const;

  const Rotorcraft vehicle_;
  const Options options_;
  const bool rates_in_world_;
  const Compute compute_;
  const std::unique_ptr<Planner> planner_;
  ReferencePreview preview_;
  Disturbance disturbance_;
  std::deque<Sent> sent_;
  std::optional<double> last_sampled_s_;
  Row last_state_;
  TimeNs last_work_ns_ = 0;
  TimeNs ready_ns_ = 0;  // of the plan that is being computed
  bool computing_ = false;
  bool has_plan_ = false;
};

}  // namespace tiltproof::nmpc
