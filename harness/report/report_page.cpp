#include "harness/report/report_page.h"

#include <algorithm>
#include <utility>

#include "harness/report/flight_pack.h"
#include "harness/report/json_fields.h"
#include "harness/report/page_json.h"

namespace tiltproof::harness {
namespace {

// First the flights that a person looks for: in the order of the view, those that are not green before the others.
std::vector<std::size_t> ByInterest(const RunView& view) {
  std::vector<std::size_t> order(view.flights.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_partition(order.begin(), order.end(),
                        [&](std::size_t i) { return !view.flights[i].result.green(); });
  return order;
}

}  // namespace

std::string Base64(std::string_view bytes) {
  static constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t j = 0; j < 3; ++j)
      group = (group << 8) | (i + j < bytes.size() ? static_cast<std::uint8_t>(bytes[i + j]) : 0U);
    for (std::size_t j = 0; j < 4; ++j)
      text += i + j > bytes.size() ? '=' : kDigits[(group >> (18 - 6 * j)) & 0x3F];
  }
  return text;
}

std::string ScriptSafe(std::string_view json) {
  std::string safe;
  safe.reserve(json.size());
  for (const char c : json) {
    if (c == '<')
      safe += "\\u003c";
    else
      safe += c;
  }
  return safe;
}

std::string RunPage(std::string_view run_json, std::string_view details) {
  return PageWith(PageTemplate(), "<script type=\"application/json\" id=\"run\">" + ScriptSafe(run_json) +
                                      "</script>\n" + std::string(details));
}

std::string ReportPage(const RunView& view, const FlightLoader& load, const PageLimits& limits) {
  std::vector<std::size_t> order = ByInterest(view);
  const std::size_t shown = std::min(order.size(), limits.flights_max);
  std::vector<Json> entries(view.flights.size());
  std::string details;
  std::size_t with_details = 0, results_bytes = 0;
  PackLimits pack;
  // Base64 has 4 characters for 3 bytes.
  pack.bytes_aim = limits.bytes_aim * 3 / 4 / std::max<std::size_t>(shown, 1);
  for (std::size_t i = 0; i < shown; ++i) {
    const FlightEntry& flight = view.flights[order[i]];
    Json& entry = entries[order[i]] = EntryJson(view, flight);
    const auto folder = view.runs[flight.run].folder / flight.result.name;
    if (flight.has_folder && details.size() < limits.details_bytes_max) {
      try {
        const FlownFlight flown = load(folder);
        entry["tags"] = flown.scenario.tags;
        const FlightView flight_view = ViewFlight(folder, flight.result, flown.scenario, flown.vehicle);
        const std::string id = "flight-" + std::to_string(with_details);
        details += "<script type=\"text/plain\" id=\"" + id + "\">" + Base64(PackFlight(flight_view, pack)) +
                   "</script>\n";
        entry["details"] = id;
        ++with_details;
        continue;
      } catch (const std::exception& error) {
        entry["problem"] = error.what();
      }
    } else if (flight.has_folder) {
      entry["problem"] =
          "left out, to keep this page small: tiltproof report " + folder.string() + " shows this flight";
    }
    if (results_bytes > limits.results_bytes_max) continue;
    PutResult(entry, flight.result);
    results_bytes += JsonText(entry).size();
  }
  Json json = {
      {"version", Version()}, {"flights", Json::array()}, {"left_out_count", view.flights.size() - shown}};
  for (const RunEntry& run : view.runs) json["runs"].push_back(RunJson(run));
  for (Json& entry : entries)
    if (!entry.is_null()) json["flights"].push_back(std::move(entry));
  if (!view.baseline.empty()) {
    json["baseline"] = view.baseline;
    json["only_in_baseline"] = view.only_in_baseline;
  }
  return RunPage(JsonText(json), details);
}

}  // namespace tiltproof::harness
