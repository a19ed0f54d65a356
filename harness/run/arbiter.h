// Which client flies the vehicle: it stands between the actuator messages that the server has accepted and the
// plant's input.
//
//   Arbiter arbiter(scenario);
//   if (arbiter.Takes(client)) commanded = message.actuators;   // of each accepted actuator message
//
// `single`: one client, which the scenario names, and no other. The others fly along: they are asked, answered and
// logged as they would be alone, and nothing that they say moves the vehicle. t = 0 is the selected client's `start`.
#pragma once

#include <cstddef>

#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

class Arbiter {
 public:
  explicit Arbiter(const Scenario& scenario) : selected_(scenario.selected_client()) {}

  // The client, by its place in the scenario, whose actuators are in force.
  std::size_t selected() const { return selected_; }
  // Whether what this client asks for is to be put in force.
  bool Takes(std::size_t client) const { return client == selected_; }

 private:
  std::size_t selected_;
};

}  // namespace tiltproof::harness
