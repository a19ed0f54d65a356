// Parts that each client has of its own in real time: a client node, a link node and their ports. With several clients
// the id is part of their names. A line between clients has a node, and a port for each end.
//
//   PartName(scenario, "link", 1);      // "link-b"; of the only client "link"
//   ClientPlace(scenario, "b");         // 1
//   LineNodeName("cross");              // "line-cross", the node
//   LinePortName("cross", "b");         // "line-cross-b", what the board b is connected to
#pragma once

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

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

inline std::string LineNodeName(const std::string& line) { return "line-" + line; }
inline std::string LinePortName(const std::string& line, const std::string& client) {
  return LineNodeName(line) + "-" + client;
}

// The ids of the client's lines to others, in the order of its UARTs.
inline std::vector<std::string> LinesOf(const Scenario& scenario, std::size_t client) {
  std::vector<std::string> ids;
  for (const LineEndId& end : scenario.line_ends_of(client)) ids.push_back(scenario.lines[end.line].id);
  return ids;
}

// The line's place in the scenario. `id`: what its node was started with. Throws std::runtime_error when there is none.
inline std::size_t LinePlace(const Scenario& scenario, const std::string& id) {
  std::string ids;
  for (std::size_t line = 0; line < scenario.lines.size(); ++line) {
    if (scenario.lines[line].id == id) return line;
    ids += (ids.empty() ? "" : ", ") + scenario.lines[line].id;
  }
  throw std::runtime_error("the scenario has no line '" + id + "' between clients: " +
                           (ids.empty() ? "it has none" : "give the node one of its ids with --id: " + ids));
}

// Refuses a client that tells no role where the arbiter needs it; std::runtime_error.
inline void NeedRole(const Scenario& scenario, std::size_t client, bool tells_role) {
  if (scenario.arbiter.type == ArbiterType::kActiveClaims && !tells_role)
    throw std::runtime_error("the arbiter active_claims needs the role of client '" +
                             scenario.client_id(client) + "', which this client does not tell");
}

// True if the flight goes on without this client, as long as another one is left.
inline bool MayLose(const Scenario& scenario, std::size_t client) {
  return scenario.is_redundant() || (scenario.has_several_clients() && client != scenario.selected_client());
}

// The client that a record is about; none in a flight with one, which needs no name.
inline std::optional<std::size_t> Whose(const Scenario& scenario, std::size_t client) {
  return scenario.has_several_clients() ? std::optional(client) : std::nullopt;
}

}  // namespace tiltproof::harness
