#include "harness/campaign/envelope_page.h"

#include <fmt/format.h>

#include <stdexcept>

#include "harness/campaign/envelope.h"
#include "harness/campaign/envelope_sides.h"
#include "harness/report/files.h"
#include "harness/report/json_fields.h"
#include "harness/report/report_page.h"

namespace tiltproof::harness {
namespace {

bool SameFile(const std::filesystem::path& a, const std::filesystem::path& b) {
  try {
    return ReadFile(a) == ReadFile(b);
  } catch (const std::exception&) {
    return false;
  }
}

// The command for one side of a row, and the page of its flight if any; null when the folder has no scenario.
Json SideJson(const EnvelopeSide& side, const std::filesystem::path& folder,
              const std::filesystem::path& to_folder, const std::string& program, const std::string& flags) {
  const std::filesystem::path level = folder / side.scenario_file(), run = folder / side.run_folder();
  if (!std::filesystem::exists(level)) return nullptr;
  Json json = {{"command", fmt::format("{} run {}{}", program, level.string(), flags)}};
  if (std::filesystem::exists(run / "report.html") &&
      SameFile(level, run / side.name() / "scenario.resolved.yaml")) {
    json["page"] = (to_folder / side.run_folder() / "report.html").lexically_normal().string();
    json["flight"] = side.name();
  }
  return json;
}

}  // namespace

bool HoldsEnvelope(const std::filesystem::path& folder) {
  return std::filesystem::exists(folder / "envelope.json") && !std::filesystem::exists(folder / "run.json");
}

std::string EnvelopePage(const std::filesystem::path& folder, const std::filesystem::path& to_folder,
                         const std::string& program) {
  const std::filesystem::path file = folder / "envelope.json";
  Json json;
  try {
    const Envelope envelope = ReadEnvelope(file);
    json = ToJson(envelope);
    for (std::size_t i = 0; i < envelope.rows.size(); ++i) {
      const EnvelopeEntry& entry = envelope.rows[i];
      const auto column = envelope.columns.find(entry.client);
      const std::string flags = column == envelope.columns.end() ? "" : column->second.flags;
      for (const bool survives : {true, false})
        json["rows"][i]["sides"][survives ? "survives" : "fails"] =
            SideJson(SideOf(entry, survives), folder, to_folder, program, flags);
    }
  } catch (const FileError&) {
    throw;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{} is not an envelope: {}", file.string(), error.what()));
  }
  return PageWith(EnvelopePageTemplate(), "<script type=\"application/json\" id=\"envelope\">" +
                                              ScriptSafe(JsonText(json)) + "</script>\n");
}

}  // namespace tiltproof::harness
