#include "harness/report/flight_files.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "harness/report/files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/json_fields.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

Json ChunksJson(const std::vector<link::LogChunk>& chunks) {
  Json array = Json::array();
  for (const auto& chunk : chunks)
    array.push_back({{"begin_s", ToSeconds(chunk.begin_ns)},
                     {"bytes", fmt::format("{:02x}", fmt::join(chunk.bytes, ""))}});
  return array;
}

RunEvent ToRunEvent(const RunLog& log, const FlightEvent& from) {
  RunEvent event{TimeFromFile(from.time_s), from.kind, from.text};
  for (std::size_t i = 0; i < log.clients.size(); ++i)
    if (log.clients[i].id == from.client) event.client = i;
  return event;
}

constexpr const char *kHarnessLate = "harness_late_ns", *kBoardDisturbed = "board_disturbed_ns",
                     *kFirmwareLate = "firmware_late_ns";

// The record of an only client stands among the flight's.
Json ToFile(const RunLog& log) {
  Json json = {{"format", kResultsFormat}};
  JsonWriter::PutFields(json, log);
  if (log.clients.size() == 1) {
    JsonWriter::PutFields(json, log.clients.front());
  } else {
    JsonWriter::Put(json["clients"], log.clients);
  }
  const auto put = [&json](const char* key, const std::vector<LateSpan>& from) {
    if (from.empty()) return;
    Json& spans = json[key] = Json::array();
    for (const LateSpan& span : from) spans.push_back({span.begin_ns, span.end_ns});
  };
  put(kHarnessLate, log.harness_late);
  put(kFirmwareLate, log.firmware_late);
  put(kBoardDisturbed, log.board_disturbed);
  JsonWriter::Put(json["events"], EventsOf(log));
  return json;
}

void FromFile(const Json& json, RunLog& log) {
  CheckFormat(json);
  JsonReader::GetFields(json, log);
  log.clients.clear();
  if (json.contains("clients")) {
    JsonReader::Get(json["clients"], log.clients);
  } else {
    JsonReader::GetFields(json, log.clients.emplace_back());
  }
  const auto get = [&json](const char* key, std::vector<LateSpan>& to) {
    for (const Json& span : json.value(key, Json::array()))
      to.push_back({FromJson<TimeNs>(span.at(0)), FromJson<TimeNs>(span.at(1))});
  };
  get(kHarnessLate, log.harness_late);
  get(kFirmwareLate, log.firmware_late);
  get(kBoardDisturbed, log.board_disturbed);
  for (const auto& event : FromJson<std::vector<FlightEvent>>(json.at("events")))
    log.events.push_back(ToRunEvent(log, event));
}

// The hash of a verdict.json without its hashes.
std::string HashOfEntry(Json json) {
  json.erase("hash");
  json.erase("files");
  return HashOf(JsonText(json));
}

std::string FaultsJsonl(const Scenario& scenario, const RunLog& log) {
  std::string lines;
  const auto begin = [&scenario](std::size_t fault) {
    Json line;
    line["fault"] = scenario.faults.at(fault).id;
    line["type"] = scenario.faults.at(fault).type;
    return line;
  };
  std::vector<std::int64_t> left_out = log.fault_activation_counts;
  left_out.resize(scenario.faults.size(), 0);
  for (const auto& activation : log.activations) {
    Json line;
    line["time_s"] = ToSeconds(activation.time_ns);
    line.update(begin(activation.fault));
    line["what"] = activation.what;
    line["before"] = ChunksJson(activation.before);
    line["after"] = ChunksJson(activation.after);
    lines += JsonText(line) + "\n";
    --left_out[activation.fault];
  }
  for (std::size_t fault = 0; fault < left_out.size(); ++fault) {
    if (left_out[fault] <= 0) continue;
    Json line = begin(fault);
    line["left_out_count"] = left_out[fault];
    lines += JsonText(line) + "\n";
  }
  return lines;
}

}  // namespace

FlightRecorder RecorderIn(const std::filesystem::path& folder, Keep keep, TraceFormat trace) {
  const auto begin = [folder](const Scenario& scenario) {
    std::filesystem::create_directories(folder);
    WriteFile(folder / "scenario.resolved.yaml", WriteResolved(scenario));
  };
  const auto end = [folder, trace](const Scenario& scenario, const RunLog& log, const FlightResult&) {
    WriteFlight(folder, scenario, log, trace);
  };
  switch (keep) {
    case Keep::kAll:
      return {begin, end};
    case Keep::kFailing:
      return {.end = [begin, end](const Scenario& scenario, const RunLog& log, const FlightResult& result) {
        if (result.green()) return;
        begin(scenario);
        end(scenario, log, result);
      }};
    case Keep::kVerdicts:
      break;
  }
  return {};
}

void KeepVerdict(const std::filesystem::path& folder, const Scenario& scenario, const FlightResult& result,
                 Keep keep) {
  if (keep == Keep::kVerdicts || (keep == Keep::kFailing && result.green())) return;
  try {
    std::filesystem::create_directories(folder);
    // Replaces the scenario of a worker that could not leave it.
    const auto resolved = folder / "scenario.resolved.yaml";
    if (!std::filesystem::exists(resolved)) WriteFile(resolved, WriteResolved(scenario));
    Json json = Json::parse(ToJsonText(result));
    json["hash"] = HashOfEntry(json);
    json["files"] = HashesOf(folder);
    WriteFile(folder / "verdict.json", JsonText(json, 2) + "\n");
  } catch (const std::runtime_error&) {
    // results.json says the same, or fails for the same reason and tells.
  }
}

FlightResult ReadVerdict(const std::filesystem::path& folder) {
  const auto file = folder / "verdict.json";
  const std::string text = ReadFile(file);
  try {
    FlightResult result = ResultFromJsonText(text);
    const Json json = Json::parse(text);
    // An older program wrote none.
    const std::string recorded = json.value("hash", "");
    if (const std::string hash = HashOfEntry(json); !recorded.empty() && hash != recorded)
      throw std::runtime_error(
          fmt::format("has changed since the flight: its hash is {}, and `hash` in it {}; put the old one "
                      "back, or take `hash` out to read this one",
                      hash, recorded));
    return result;
  } catch (const std::exception& error) {
    throw FileError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

void WriteFlight(const std::filesystem::path& folder, const Scenario& scenario, const RunLog& log,
                 TraceFormat trace) {
  WriteTrace(folder, log.trace, trace);
  WriteFile(folder / "faults.jsonl", FaultsJsonl(scenario, log));
  const auto& bytes = log.link.content();
  WriteFile(folder / "link.bin", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  for (const ClientLog& client : log.clients)
    WriteFile(folder / (client.id.empty() ? "firmware.log" : "firmware." + client.id + ".log"),
              client.firmware_log);
  WriteFile(folder / "flight.json", JsonText(ToFile(log)) + "\n");
}

RunLog ReadFlight(const std::filesystem::path& folder) {
  Trace trace = ReadTrace(folder);
  RunLog log = ReadFlightRecord(folder);
  log.trace = std::move(trace);
  return log;
}

RunLog ReadFlight(const std::filesystem::path& folder, const Scenario& scenario) {
  RunLog log = ReadFlight(folder);
  if (log.clients.size() != scenario.client_count())
    throw std::runtime_error(fmt::format(
        "{}: clients: has {}, and the flight's scenario has {}; was one of the two changed? Fly the "
        "scenario again",
        (folder / "flight.json").string(), log.clients.size(), scenario.client_count()));
  return log;
}

RunLog ReadFlightRecord(const std::filesystem::path& folder) {
  RunLog log;
  const auto flight_file = folder / "flight.json";
  const std::string text = ReadFlightFile(flight_file);
  try {
    FromFile(Json::parse(text), log);
  } catch (const std::exception& error) {
    throw std::runtime_error(flight_file.string() + ": " + error.what());
  }
  return log;
}

}  // namespace tiltproof::harness
