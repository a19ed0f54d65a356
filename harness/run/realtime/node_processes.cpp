#include "harness/run/realtime/node_processes.h"

#include <fmt/format.h>

#include <csignal>
#include <utility>

namespace tiltproof::harness {

NodeProcesses::NodeProcesses(const RealtimeOptions& options, const dds::Participant& harness,
                             std::map<std::string, double> loss)
    : options_(options), harness_(harness), loss_(std::move(loss)) {
  names_ = {"plant", "link", "base_station"};
  // A board is its own node: it hangs on the link's port.
  if (AbilitiesOf(options.client, true).node) names_.push_back("client");
}

void NodeProcesses::Start(const std::string& role, const std::string& id) {
  ChildSpec spec;
  const std::string kind = role == "base_station" ? "base-station" : role;
  spec.command = {options_.program,
                  "node",
                  kind,
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
  if (role == (AbilitiesOf(options_.client, true).node ? "client" : "link"))
    add("--client", ToText(options_.client));
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
