#include "harness/run/realtime/node_processes.h"

#include <fmt/format.h>

#include <csignal>
#include <utility>

#include "harness/run/realtime/client_parts.h"

namespace tiltproof::harness {

NodeProcesses::NodeProcesses(const Scenario& scenario, const RealtimeOptions& options,
                             const dds::Participant& harness, std::map<std::string, double> loss)
    : options_(options), harness_(harness), loss_(std::move(loss)) {
  const auto add = [&](const std::string& role, Part part) {
    names_.push_back(role);
    parts_[role] = std::move(part);
  };
  const auto add_each = [&](const char* kind) {
    for (std::size_t client = 0; client < scenario.client_count(); ++client) {
      const ClientSpec& spec = options.clients.at(client);
      // A board is its own node: it hangs on the link's port.
      const bool has_node = AbilitiesOf(spec, true).node, is_client = kind == std::string_view("client");
      if (is_client && !has_node) continue;
      Part part{.kind = kind};
      if (is_client == has_node) part.client = spec;
      // The nodes of its lines have the others of its devices.
      if (part.client)
        if (auto* board = std::get_if<SerialBoard>(&*part.client)) board->line_devices.clear();
      if (scenario.has_several_clients()) part.id = scenario.client_id(client);
      add(PartName(scenario, kind, client), std::move(part));
    }
  };
  add("plant", {.kind = "plant"});
  add_each("link");
  for (const LineEntry& line : scenario.lines) {
    Part part{.kind = "line", .id = line.id};
    const auto device = [&](const std::string& client) {
      const auto* board = std::get_if<SerialBoard>(&options.clients.at(scenario.FindClient(client).value()));
      return board == nullptr ? std::string("-") : board->line_devices.at(line.id);
    };
    part.cable = device(line.between[0]) + "," + device(line.between[1]);
    add(LineNodeName(line.id), std::move(part));
  }
  add("base_station", {.kind = "base-station"});
  add_each("client");
}

void NodeProcesses::Start(const std::string& role, const std::string& id) {
  ChildSpec spec;
  const Part& part = parts_.at(role);
  spec.command = {options_.program,
                  "node",
                  part.kind,
                  "--name",
                  id,
                  "--domain",
                  std::to_string(options_.place.domain),
                  "--tag",
                  options_.place.tag,
                  "--child",
                  ToText(harness_)};
  const auto add = [&](const char* flag, const std::string& value) {
    if (value.empty()) return;
    spec.command.emplace_back(flag);
    spec.command.push_back(value);
  };
  if (part.client) add("--client", ToText(*part.client));
  if (part.id) add("--id", *part.id);
  add("--cable", part.cable);
  if (const auto loss = loss_.find(role); loss != loss_.end())
    add("--xmit-loss", fmt::format("{}", loss->second));
  auto introduction = std::make_unique<Introduction>();
  spec.descriptors = {introduction->child_end()};
  processes_[role] = std::make_unique<ChildProcess>(spec);
  introduction->Started();
  introductions_[role] = std::move(introduction);
}

void NodeProcesses::StartAll() {
  for (const auto& name : names_) Start(name, name);
}

ChildProcess* NodeProcesses::Find(const std::string& role) {
  const auto found = processes_.find(role);
  return found == processes_.end() ? nullptr : found->second.get();
}

std::optional<dds::Participant> NodeProcesses::ParticipantOf(const std::string& role) {
  const auto found = introductions_.find(role);
  return found == introductions_.end() ? std::nullopt : found->second->Participant();
}

void NodeProcesses::StopAll() {
  // All at once first: the waits overlap.
  for (auto& [name, process] : processes_) {
    process->SignalGroup(SIGCONT);
    process->Signal(SIGTERM);
  }
  processes_.clear();
}

}  // namespace tiltproof::harness
