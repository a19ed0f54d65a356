#include "harness/scenario/scenario.h"

#include <cmath>

#include "faults/random.h"
#include "link/raw_framing.h"

namespace tiltproof::harness {

std::string_view Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kPass:
      return "pass";
    case Verdict::kInconclusive:
      return "inconclusive";
    case Verdict::kFail:
      return "fail";
    case Verdict::kError:
      return "error";
  }
  return "unknown";
}

std::string_view Name(AngularRates rates) {
  switch (rates) {
    case AngularRates::kWorld:
      return "world";
    case AngularRates::kBody:
      return "body";
    case AngularRates::kEuler:
      return "euler";
  }
  return "unknown";
}

std::string_view Name(ArbiterType type) {
  switch (type) {
    case ArbiterType::kSingle:
      return "single";
    case ArbiterType::kPrimaryBackup:
      return "primary_backup";
    case ArbiterType::kActiveClaims:
      return "active_claims";
    case ArbiterType::kMidValue:
      return "mid_value";
    case ArbiterType::kDuplexCompare:
      return "duplex_compare";
  }
  return "unknown";
}

Verdict Expectation::Of(std::string_view firmware) const {
  for (const auto& [name, own] : by_firmware)
    if (name == firmware) return own;
  return verdict;
}

void Scenario::FlyFirmware(const std::string& build) {
  firmware = build;
  for (ClientEntry& client : clients) client.firmware.clear();
}

std::string Scenario::client_id(std::size_t client) const {
  return clients.empty() ? std::string(kOnlyClient) : clients.at(client).id;
}

const std::string& Scenario::firmware_of(std::size_t client) const {
  return clients.empty() || clients.at(client).firmware.empty() ? firmware : clients[client].firmware;
}

std::uint64_t Scenario::seed_of(std::size_t client) const {
  return has_several_clients() ? faults::StreamKey(seed, {"client", client_id(client)}) : seed;
}

std::uint64_t Scenario::seed_of_line(std::size_t line) const {
  return faults::StreamKey(seed, {"line", lines.at(line).id});
}

void PutOnLine(const LineEntry& line, std::optional<std::size_t> end, faults::FaultSpec& fault) {
  fault.line = line.id;
  fault.line_end = end ? line.between.at(*end) : "";
  fault.target = !end        ? faults::Target::kBoth
                 : *end == 0 ? faults::Target::kToClient
                             : faults::Target::kToPlant;
}

std::vector<LineEndId> Scenario::line_ends_of(std::size_t client) const {
  std::vector<LineEndId> ends;
  const std::string id = client_id(client);
  for (std::size_t line = 0; line < lines.size(); ++line)
    for (std::size_t end = 0; end < lines[line].between.size(); ++end)
      if (lines[line].between[end] == id) ends.push_back({line, end});
  return ends;
}

const link::Protocol& Scenario::protocol_of(const faults::FaultSpec& fault) const {
  if (fault.line.empty()) return *link.protocol;
  for (const LineEntry& line : lines)
    if (line.id == fault.line) return line.protocol == nullptr ? *link::RawProtocol() : *line.protocol;
  return *link.protocol;
}

std::string Scenario::wire_owner_id(std::size_t place) const {
  return place < client_count() ? client_id(place) : lines.at(place - client_count()).id;
}

std::optional<std::size_t> Scenario::FindClient(std::string_view id) const {
  for (std::size_t i = 0; i < client_count(); ++i)
    if (client_id(i) == id) return i;
  return std::nullopt;
}

std::size_t Scenario::selected_client() const {
  if (arbiter.type == ArbiterType::kPrimaryBackup && !arbiter.order.empty())
    return FindClient(arbiter.order.front()).value_or(0);
  return arbiter.type == ArbiterType::kSingle ? FindClient(arbiter.client).value_or(0) : 0;
}

TimeNs Scenario::arbiter_timeout_ns() const {
  if (arbiter.timeout_ms) return static_cast<TimeNs>(std::llround(*arbiter.timeout_ms * 1e6));
  return 3 * link.protocol->control_period_ns;
}

std::string ClientName(const Scenario& scenario, std::string_view before, std::size_t client, char separator,
                       std::string_view after) {
  std::string name(before);
  if (scenario.has_several_clients()) name.append(scenario.client_id(client)).append(1, separator);
  return name.append(after);
}

std::string WatchColumn(std::string_view variable) {
  std::string column = "watch_";
  for (const char c : variable) {
    const bool is_word = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    // One for several in a row; none at the end.
    if (is_word || column.back() != '_') column += is_word ? c : '_';
  }
  if (column.back() == '_') column.pop_back();
  return column;
}

std::vector<std::string> MetricNamesOf(const Scenario& scenario,
                                       const std::vector<std::string>& metric_names) {
  std::vector<std::string> names;
  for (const std::string& metric : metric_names) {
    // Only of several clients.
    if ((metric.starts_with("redundancy.") || metric == "firmware.lost_at_s") &&
        !scenario.has_several_clients())
      continue;
    const std::size_t group = metric.find('.') + 1;
    const bool of_client = metric.starts_with("link.") || metric.starts_with("firmware.") ||
                           metric.starts_with("protocol.") ||
                           (metric.starts_with("timing.") && !metric.starts_with("timing.harness_"));
    for (std::size_t client = 0; client < (of_client ? scenario.client_count() : 1); ++client)
      names.push_back(of_client
                          ? ClientName(scenario, metric.substr(0, group), client, '.', metric.substr(group))
                          : metric);
  }
  return names;
}

}  // namespace tiltproof::harness
