// Parts that each client has of its own in real time: a client node, a link node and their ports. With several clients
// the id is part of their names.
//
//   PartName(scenario, "link", 1);      // "link-b"; of the only client "link"
//   ClientPlace(scenario, "b");         // 1
#pragma once

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

inline std::string PartName(const Scenario& scenario, std::string_view part, std::size_t client) {
  std::string name(part);
  if (scenario.has_several_clients()) name.append("-").append(scenario.client_id(client));
  return name;
}

// The client's place in the scenario. `id`: what its node was started with; the only client needs none. Throws
// std::runtime_error when the scenario has no such client.
inline std::size_t ClientPlace(const Scenario& scenario, const std::string& id) {
  if (!scenario.has_several_clients()) return 0;
  std::string ids;
  for (std::size_t client = 0; client < scenario.client_count(); ++client) {
    if (scenario.client_id(client) == id) return client;
    ids += (ids.empty() ? "" : ", ") + scenario.client_id(client);
  }
  throw std::runtime_error("the scenario has no client '" + id +
                           "': give the node one of its ids with --id: " + ids);
}

// True if the flight goes on without this client.
inline bool MayLose(const Scenario& scenario, std::size_t client) {
  return scenario.has_several_clients() && client != scenario.selected_client();
}

// The client that a record is about; none in a flight with one, which needs no name.
inline std::optional<std::size_t> Whose(const Scenario& scenario, std::size_t client) {
  return scenario.has_several_clients() ? std::optional(client) : std::nullopt;
}

}  // namespace tiltproof::harness
