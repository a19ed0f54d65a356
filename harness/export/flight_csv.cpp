#include "harness/export/flight_csv.h"

#include <fmt/format.h>

#include "harness/report/files.h"
#include "harness/report/trace_csv.h"

namespace tiltproof::harness {
namespace {

// RFC 4180.
std::string Cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string ClientOf(const RecordedFlight& flight, std::optional<std::size_t> client) {
  const std::size_t count = flight.client_ids.size();
  if (!client) return "";
  // Lines between boards follow the clients (WireId).
  return *client < count ? Cell(flight.client_ids[*client]) : fmt::format("lines[{}]", *client - count);
}

std::string ActivationsTable(const RecordedFlight& flight) {
  std::string table = "t_s,fault,type,what\n";
  for (const auto& [type, activation] : flight.activations)
    table += fmt::format("{},{},{},{}\n", ToSeconds(activation.time_ns), Cell(activation.fault_id),
                         Cell(type), Cell(activation.what));
  return table;
}

std::string EventsTable(const RecordedFlight& flight) {
  std::string table = "t_s,kind,client,text\n";
  for (const RunEvent& event : flight.events)
    table += fmt::format("{},{},{},{}\n", ToSeconds(event.time_ns), Cell(event.kind),
                         ClientOf(flight, event.client), Cell(event.text));
  return table;
}

std::string FramesTable(const RecordedFlight& flight) {
  std::string table = "t_s,client,direction,side,bytes\n";
  std::size_t offset = 0;
  while (const auto record = flight.link.Next(offset))
    table += fmt::format("{},{},{},{},{:02x}\n", ToSeconds(record->begin_ns),
                         ClientOf(flight, record->wire.client), Name(record->wire.direction),
                         record->delivered ? "delivered" : "sent", fmt::join(record->bytes, ""));
  return table;
}

std::string MetricsTable(const RecordedFlight& flight) {
  std::string table = "metric,value\n";
  for (const auto& [name, value] : flight.result.score.metrics)
    table += fmt::format("{},{}\n", Cell(name), value);
  return table;
}

}  // namespace

void WriteCsvTables(const RecordedFlight& flight, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw FileError(fmt::format("cannot create {}: {}", folder.string(), error.message()));
  WriteFile(folder / "trace.csv", WriteTraceCsv(flight.trace));
  WriteFile(folder / "fault_activations.csv", ActivationsTable(flight));
  WriteFile(folder / "events.csv", EventsTable(flight));
  WriteFile(folder / "frames.csv", FramesTable(flight));
  WriteFile(folder / "metrics.csv", MetricsTable(flight));
}

}  // namespace tiltproof::harness
