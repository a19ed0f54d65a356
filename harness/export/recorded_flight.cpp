#include "harness/export/recorded_flight.h"

#include <fmt/format.h>

#include <charconv>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/json_fields.h"
#include "harness/report/trace_file.h"
#include "harness/score/signals.h"

namespace tiltproof::harness {
namespace {

// Calls `read` with the file's content; what it throws gets the file's name.
template <class Read>
void WithFile(const std::filesystem::path& file, const Read& read) {
  const std::string content = ReadFlightFile(file);
  try {
    read(content);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

std::vector<std::uint8_t> BytesOf(const std::string& hex) {
  if (hex.size() % 2 != 0)
    throw std::runtime_error(
        fmt::format("bytes with {} hexadecimal digits, not a whole number of bytes", hex.size()));
  std::vector<std::uint8_t> bytes(hex.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const char* digits = hex.data() + 2 * i;
    if (std::from_chars(digits, digits + 2, bytes[i], 16).ptr != digits + 2)
      throw std::runtime_error("bytes that are not hexadecimal");
  }
  return bytes;
}

std::vector<dds::Chunk> ChunksOf(const Json& json) {
  std::vector<dds::Chunk> chunks;
  for (const Json& chunk : json)
    chunks.push_back({TimeFromFile(chunk.at("begin_s").get<double>()), BytesOf(chunk.at("bytes"))});
  return chunks;
}

RecordedActivation ActivationOf(const Json& json) {
  RecordedActivation recorded;
  recorded.type = json.at("type");
  recorded.activation.fault_id = json.at("fault");
  recorded.activation.time_ns = TimeFromFile(json.at("time_s").get<double>());
  recorded.activation.what = json.at("what");
  recorded.activation.before = ChunksOf(json.at("before"));
  recorded.activation.after = ChunksOf(json.at("after"));
  return recorded;
}

std::vector<RecordedActivation> ActivationsOf(const std::string& jsonl, const std::string& run_id) {
  std::vector<RecordedActivation> activations;
  std::istringstream lines(jsonl);
  std::size_t line_number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++line_number;
    try {
      const Json json = Json::parse(line);
      if (!json.contains("time_s")) continue;  // how many were not kept
      activations.push_back(ActivationOf(json));
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("line {}: {}", line_number, error.what()));
    }
    activations.back().activation.run_id = run_id;
    activations.back().activation.sequence = static_cast<std::int64_t>(activations.size());
  }
  return activations;
}

}  // namespace

RecordedFlight ReadRecordedFlight(const std::filesystem::path& folder, const std::string& run_id) {
  RecordedFlight flight;
  flight.run_id = run_id;
  flight.scenario_yaml = ReadFile(folder / "scenario.resolved.yaml");
  WithFile(folder / "verdict.json",
           [&](const std::string& content) { flight.result = ResultFromJsonText(content); });
  if (flight.result.trace_hash.empty())
    throw std::runtime_error(fmt::format("{}: no flight: {}", folder.string(), flight.result.score.reason));
  TracePart part = ReadTracePart(folder);
  flight.trace = std::move(part.trace);
  flight.trouble = std::move(part.trouble);
  try {
    flight.times_ns = RowTimes(flight.trace);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", FindTrace(folder).string(), error.what()));
  }
  RunLog log = ReadFlightRecord(folder);
  flight.events = std::move(log.events);
  flight.end_ns = log.end_ns;
  for (const ClientLog& client : log.clients) flight.client_ids.push_back(client.id);
  WithFile(folder / "faults.jsonl",
           [&](const std::string& content) { flight.activations = ActivationsOf(content, run_id); });
  WithFile(folder / "link.bin", [&](const std::string& content) {
    flight.link = LinkLog({content.begin(), content.end()});
  });
  return flight;
}

}  // namespace tiltproof::harness
