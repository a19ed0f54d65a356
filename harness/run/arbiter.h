// Decides which client flies the vehicle. It acts between the actuator messages that the server has accepted
// and the plant's input.
//
//   Arbiter arbiter(scenario);
//   if (arbiter.Takes(client)) commanded = message.actuators;   // for each accepted actuator message
//
// `single`: one client, named by the scenario, flies the vehicle. The others fly along: they are asked,
// answered and logged as if they were the only one, but nothing that they say moves the vehicle. t = 0 is the
// `start` of the selected client.
#pragma once

#include <cstddef>

#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

class Arbiter {
 public:
  explicit Arbiter(const Scenario& scenario) : selected_(scenario.selected_client()) {}

  // Place in the scenario of the client whose actuators are in force.
  std::size_t selected() const { return selected_; }
  // True if the commands of this client are in force.
  bool Takes(std::size_t client) const { return client == selected_; }

 private:
  std::size_t selected_;
};

}  // namespace tiltproof::harness
