#include "harness/campaign/envelope.h"

#include <fmt/format.h>

#include <stdexcept>

#include "harness/report/files.h"
#include "harness/report/json_fields.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

// Throws std::runtime_error that names the row.
EnvelopeEntry EntryFrom(const Json& row) {
  try {
    // The reader takes what is missing for null, which has a meaning here.
    for (const char* key : {"survives", "fails"})
      if (!row.contains(key)) throw std::runtime_error(fmt::format("{} is missing", key));
    return FromJson<EnvelopeEntry>(row);
  } catch (const std::exception& error) {
    const auto text = [&](const char* key) {
      return row.contains(key) && row[key].is_string() ? " " + row[key].get<std::string>() : std::string();
    };
    throw std::runtime_error(fmt::format("row{}{}{}{}{}, client{}: {}", text("type"), text("target"),
                                         text("signal"), text("actuator"), text("side"), text("client"),
                                         error.what()));
  }
}

}  // namespace

std::string EnvelopePlace::place() const {
  for (const auto* part : {&target, &signal, &actuator})
    if (*part) return **part;
  return "";
}

EnvelopePlace PlaceOf(const EnvelopeRow& row) {
  EnvelopePlace place;
  place.type = row.type->name;
  if (!row.side.empty()) place.side = row.side;
  if (row.place_key.empty()) return place;
  std::optional<std::string>* part = row.place_key == "target"     ? &place.target
                                     : row.place_key == "signal"   ? &place.signal
                                     : row.place_key == "actuator" ? &place.actuator
                                                                   : nullptr;
  Check(part != nullptr, "envelope.json has a key for the place of each fault type");
  *part = row.place;
  return place;
}

EnvelopeEntry EntryOf(const EnvelopeRow& row, const std::string& client, const Severity& severity,
                      const Margin& margin, int repeat_count) {
  const LevelRange& range = severity.range;
  EnvelopeEntry entry;
  static_cast<EnvelopePlace&>(entry) = PlaceOf(row);
  static_cast<MarginScan&>(entry) = ScanOf(margin, repeat_count);
  entry.client = client;
  entry.parameter = severity.parameter;
  entry.unit = severity.unit;
  entry.survives = margin.survives;
  entry.fails = margin.fails;
  if (margin.fails) {
    entry.first_criterion = margin.at_fails.criterion;
    entry.seed = margin.at_fails.seed;
    entry.time_s = margin.at_fails.time_s;
    entry.reason = margin.at_fails.reason;
  }
  entry.harmless = range.harmless;
  entry.mildest = range.start;
  entry.severest = range.end;
  entry.scale = range.scale == faults::Scale::kLinear ? "linear" : "logarithmic";
  entry.runs = margin.flights_count;
  if (margin.unknown) entry.error = WhyUnknown(*margin.unknown);
  if (margin.never_acted()) {
    entry.survives.reset();
    entry.survived_share.reset();
    entry.error = WhyNeverActed(margin);
  }
  return entry;
}

std::string ToJsonText(const Envelope& envelope) {
  Json json = ToJson(envelope);
  if (envelope.map.empty()) json.erase("map");
  return JsonText(json, 2) + "\n";
}

Envelope ReadEnvelope(const std::filesystem::path& file) {
  const Json json = Json::parse(ReadFile(file));
  CheckFormat(json);
  for (const Json& row : json.at("rows")) EntryFrom(row);
  return FromJson<Envelope>(json);
}

}  // namespace tiltproof::harness
