#include "harness/export/recorded_flight.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "harness/report/activations_file.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_hashes.h"
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

std::vector<dds::Chunk> OnTheBus(std::vector<KeptChunk> kept) {
  std::vector<dds::Chunk> chunks;
  for (KeptChunk& chunk : kept) chunks.push_back({chunk.begin_ns, std::move(chunk.bytes)});
  return chunks;
}

std::vector<RecordedActivation> ActivationsOf(const std::string& jsonl, const std::string& run_id) {
  std::vector<RecordedActivation> activations;
  ReadActivations(jsonl, ActivationBytes::kAll, [&](KeptActivation kept) {
    RecordedActivation recorded;
    recorded.type = std::move(kept.type);
    recorded.activation.run_id = run_id;
    recorded.activation.sequence = static_cast<std::int64_t>(activations.size()) + 1;
    recorded.activation.fault_id = std::move(kept.fault);
    recorded.activation.time_ns = kept.time_ns;
    recorded.activation.what = std::move(kept.what);
    recorded.activation.before = OnTheBus(std::move(kept.before));
    recorded.activation.after = OnTheBus(std::move(kept.after));
    activations.push_back(std::move(recorded));
    return true;
  });
  return activations;
}

}  // namespace

RecordedFlight ReadRecordedFlight(const std::filesystem::path& folder, const std::string& run_id) {
  RecordedFlight flight;
  flight.run_id = run_id;
  flight.scenario_yaml = ReadFile(folder / "scenario.resolved.yaml");
  flight.result = ReadVerdict(folder);
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
