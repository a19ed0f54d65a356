#include "harness/report/flight_files.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <vector>

#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/report/trace_csv.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

using Json = nlohmann::ordered_json;

Json ToJson(const std::vector<link::LogChunk>& chunks) {
  Json array = Json::array();
  for (const auto& chunk : chunks)
    array.push_back({{"begin_s", ToSeconds(chunk.begin_ns)},
                     {"bytes", fmt::format("{:02x}", fmt::join(chunk.bytes, ""))}});
  return array;
}

Json ClientJson(const ClientLog& log) {
  Json json;
  for (std::size_t d = 0; d < link::kDirectionCount; ++d) {
    const DirectionCounts& counts = log.counts[d];
    json["counts"][std::string(Name(static_cast<link::Direction>(d)))] = {
        {"frames_sent", counts.frames_sent},
        {"frames_accepted", counts.frames_accepted},
        {"frames_rejected", counts.frames_rejected},
        {"bytes_corrupted", counts.bytes_corrupted}};
  }
  json["accepted_wrong_count"] = log.accepted_wrong_count;
  json["accepted_stale_count"] = log.accepted_stale_count;
  json["resync_max_ns"] = log.resync_max_ns;
  json["starts_accepted_count"] = log.starts_accepted_count;
  if (log.failsafe_entered_count) json["failsafe_entered_count"] = *log.failsafe_entered_count;
  if (log.receive_overruns_count) json["receive_overruns_count"] = *log.receive_overruns_count;
  json["restarts"] = Json::array();
  for (const auto& restart : log.restarts)
    json["restarts"].push_back({{"time_ns", restart.time_ns}, {"cause", restart.cause}});
  json["request_times_ns"] = log.request_times_ns;
  json["sent_request_times_ns"] = log.sent_request_times_ns;
  json["reply_latency_ns"] = log.reply_latency_ns;
  json["actuator_times_ns"] = log.actuator_times_ns;
  json["client_round_trip_ns"] = log.client_round_trip_ns;
  return json;
}

ClientLog ClientFromJson(const Json& json) {
  ClientLog log;
  for (std::size_t d = 0; d < link::kDirectionCount; ++d) {
    const Json& counts = json.at("counts").at(std::string(Name(static_cast<link::Direction>(d))));
    counts.at("frames_sent").get_to(log.counts[d].frames_sent);
    counts.at("frames_accepted").get_to(log.counts[d].frames_accepted);
    counts.at("frames_rejected").get_to(log.counts[d].frames_rejected);
    counts.at("bytes_corrupted").get_to(log.counts[d].bytes_corrupted);
  }
  json.at("accepted_wrong_count").get_to(log.accepted_wrong_count);
  json.at("accepted_stale_count").get_to(log.accepted_stale_count);
  json.at("resync_max_ns").get_to(log.resync_max_ns);
  json.at("starts_accepted_count").get_to(log.starts_accepted_count);
  if (json.contains("failsafe_entered_count"))
    log.failsafe_entered_count = json.at("failsafe_entered_count").get<std::int64_t>();
  if (json.contains("receive_overruns_count"))
    log.receive_overruns_count = json.at("receive_overruns_count").get<std::int64_t>();
  json.at("request_times_ns").get_to(log.request_times_ns);
  json.at("reply_latency_ns").get_to(log.reply_latency_ns);
  json.at("actuator_times_ns").get_to(log.actuator_times_ns);
  // Absent from the files of older versions.
  for (const auto& restart : json.value("restarts", Json::array()))
    log.restarts.push_back({restart.at("time_ns").get<TimeNs>(), restart.at("cause").get<std::string>()});
  if (json.contains("sent_request_times_ns"))
    json.at("sent_request_times_ns").get_to(log.sent_request_times_ns);
  if (json.contains("client_round_trip_ns")) json.at("client_round_trip_ns").get_to(log.client_round_trip_ns);
  return log;
}

Json EventJson(const FlightEvent& event) {
  Json json = {{"time_s", ToSeconds(event.time_ns)}, {"kind", event.kind}};
  if (!event.client.empty()) json["client"] = event.client;
  json["text"] = event.text;
  return json;
}

RunEvent EventFromJson(const RunLog& log, const Json& json) {
  RunEvent event{FromSeconds(json.at("time_s").get<double>()), json.at("kind").get<std::string>(),
                 json.at("text").get<std::string>()};
  if (!json.contains("client")) return event;
  const auto id = json["client"].get<std::string>();
  for (std::size_t i = 0; i < log.clients.size(); ++i)
    if (log.clients[i].id == id) event.client = i;
  return event;
}

Json FlightJson(const RunLog& log) {
  Json json = {{"format", kResultsFormat}};
  json["end_reason"] = Name(log.end_reason);
  json["end_text"] = log.end_text;
  json["end_ns"] = log.end_ns;
  json["wall_s"] = log.wall_s;
  json["hover_input"] = log.hover_input;
  json["input_min"] = log.input_min;
  json["input_max"] = log.input_max;
  json["fault_activation_counts"] = log.fault_activation_counts;
  if (log.clients.size() == 1) {
    json.update(ClientJson(log.clients.front()));
  } else {
    for (const ClientLog& client : log.clients) {
      json["clients"].push_back({{"id", client.id}});
      json["clients"].back().update(ClientJson(client));
    }
  }
  if (log.harness_overrun_count) json["harness_overrun_count"] = *log.harness_overrun_count;
  if (log.harness_late_max_ns) json["harness_late_max_ns"] = *log.harness_late_max_ns;
  if (!log.harness_late.empty()) {
    json["harness_late_ns"] = Json::array();
    for (const auto& span : log.harness_late) json["harness_late_ns"].push_back({span.begin_ns, span.end_ns});
  }
  json["events"] = Json::array();
  for (const FlightEvent& event : EventsOf(log)) json["events"].push_back(EventJson(event));
  return json;
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
    line["before"] = ToJson(activation.before);
    line["after"] = ToJson(activation.after);
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

FlightRecorder RecorderIn(const std::filesystem::path& folder, Keep keep) {
  const auto begin = [folder](const Scenario& scenario) {
    std::filesystem::create_directories(folder);
    WriteFile(folder / "scenario.resolved.yaml", WriteResolved(scenario));
  };
  const auto end = [folder](const Scenario& scenario, const RunLog& log, const FlightResult&) {
    WriteFlight(folder, scenario, log);
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
    // Of a worker that could not leave it.
    const auto resolved = folder / "scenario.resolved.yaml";
    if (!std::filesystem::exists(resolved)) WriteFile(resolved, WriteResolved(scenario));
    WriteFile(folder / "verdict.json", ToJsonText(result));
  } catch (const std::runtime_error&) {
    // results.json says the same, or fails for the same reason and tells.
  }
}

void WriteFlight(const std::filesystem::path& folder, const Scenario& scenario, const RunLog& log) {
  WriteFile(folder / "trace.csv", WriteTraceCsv(log.trace));
  WriteFile(folder / "faults.jsonl", FaultsJsonl(scenario, log));
  const auto& bytes = log.link.content();
  WriteFile(folder / "link.bin", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  for (const ClientLog& client : log.clients)
    WriteFile(folder / (client.id.empty() ? "firmware.log" : "firmware." + client.id + ".log"),
              client.firmware_log);
  WriteFile(folder / "flight.json", JsonText(FlightJson(log)) + "\n");
}

RunLog ReadFlight(const std::filesystem::path& folder) {
  RunLog log;
  const auto trace_file = folder / "trace.csv";
  try {
    log.trace = ReadTraceCsv(ReadFile(trace_file));
  } catch (const FileError&) {
    throw;
  } catch (const std::exception& error) {
    throw std::runtime_error(trace_file.string() + ": " + error.what());
  }
  const auto flight_file = folder / "flight.json";
  const std::string text = ReadFile(flight_file);
  try {
    const Json json = Json::parse(text);
    CheckFormat(json);
    log.end_reason =
        EnumNamed("end_reason", json.at("end_reason").get<std::string>(), EndReason::kHarnessError);
    json.at("end_text").get_to(log.end_text);
    json.at("end_ns").get_to(log.end_ns);
    json.at("wall_s").get_to(log.wall_s);
    json.at("hover_input").get_to(log.hover_input);
    json.at("input_min").get_to(log.input_min);
    json.at("input_max").get_to(log.input_max);
    json.at("fault_activation_counts").get_to(log.fault_activation_counts);
    log.clients.clear();
    for (const Json& client : json.value("clients", Json::array())) {
      log.clients.push_back(ClientFromJson(client));
      client.at("id").get_to(log.clients.back().id);
    }
    if (log.clients.empty()) log.clients.push_back(ClientFromJson(json));
    if (json.contains("harness_overrun_count"))
      log.harness_overrun_count = json["harness_overrun_count"].get<std::int64_t>();
    if (json.contains("harness_late_max_ns"))
      log.harness_late_max_ns = json["harness_late_max_ns"].get<std::int64_t>();
    if (json.contains("harness_late_ns"))
      for (const auto& span : json["harness_late_ns"])
        log.harness_late.push_back({span.at(0).get<TimeNs>(), span.at(1).get<TimeNs>()});
    for (const auto& event : json.at("events")) log.events.push_back(EventFromJson(log, event));
  } catch (const std::exception& error) {
    throw std::runtime_error(flight_file.string() + ": " + error.what());
  }
  return log;
}

}  // namespace tiltproof::harness
