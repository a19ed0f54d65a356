#include "harness/report/envelope_page.h"

#include <fmt/format.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "harness/report/files.h"
#include "harness/report/json_text.h"
#include "harness/report/report_page.h"
#include "harness/run/hash.h"

namespace tiltproof::harness {
namespace {

using PageJson = nlohmann::ordered_json;

// A client's flag as the name of a folder; what is lost of it is in a hash.
std::string FolderName(const std::string& client) {
  std::string name;
  for (const char c : client) {
    const bool keeps =
        (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || c == '-';
    name += keeps ? c : '_';
  }
  if (name == client) return name;
  const std::uint64_t hash =
      Fnv1a({reinterpret_cast<const std::uint8_t*>(client.data()), client.size()}, kFnvOffset);
  return fmt::format("{}-{:08x}", name.substr(0, 40), hash & 0xffffffffU);
}

std::string TextAt(const PageJson& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

bool SameFile(const std::filesystem::path& a, const std::filesystem::path& b) {
  try {
    return ReadFile(a) == ReadFile(b);
  } catch (const std::exception&) {
    return false;
  }
}

// The command for one side of a row, and the page of its flight if any; null when the folder has no scenario.
PageJson SideJson(const EnvelopeSide& side, const std::filesystem::path& folder,
                  const std::filesystem::path& to_folder, const std::string& program,
                  const std::string& flags) {
  const std::filesystem::path level = folder / side.scenario_file(), run = folder / side.run_folder();
  if (!std::filesystem::exists(level)) return nullptr;
  PageJson json = {{"command", fmt::format("{} run {}{}", program, level.string(), flags)}};
  if (std::filesystem::exists(run / "report.html") &&
      SameFile(level, run / side.name() / "scenario.resolved.yaml")) {
    json["page"] = (to_folder / side.run_folder() / "report.html").lexically_normal().string();
    json["flight"] = side.name();
  }
  return json;
}

}  // namespace

std::string EnvelopeSide::name() const {
  std::string text = FolderName(client) + "-" + type;
  for (const std::string* part : {&place, &side})
    if (!part->empty()) text += "-" + *part;
  return text + (survives ? "-survives" : "-fails");
}

std::filesystem::path EnvelopeSide::scenario_file() const {
  return std::filesystem::path("levels") / FolderName(client) / (name() + ".yaml");
}

std::filesystem::path EnvelopeSide::run_folder() const {
  return std::filesystem::path("flights") / FolderName(client) / type;
}

bool HoldsEnvelope(const std::filesystem::path& folder) {
  return std::filesystem::exists(folder / "envelope.json") && !std::filesystem::exists(folder / "run.json");
}

std::string EnvelopePage(const std::filesystem::path& folder, const std::filesystem::path& to_folder,
                         const std::string& program) {
  const std::filesystem::path file = folder / "envelope.json";
  PageJson envelope;
  try {
    envelope = PageJson::parse(ReadFile(file));
    CheckFormat(envelope);
    PageJson& columns = envelope["columns"];
    for (PageJson& row : envelope.at("rows")) {
      EnvelopeSide side{.client = TextAt(row, "client"),
                        .type = TextAt(row, "type"),
                        .place = {},
                        .side = TextAt(row, "side")};
      for (const char* key : {"target", "signal", "actuator"}) side.place += TextAt(row, key);
      // These make paths.
      for (const std::string* part : {&side.type, &side.place, &side.side})
        if (part->find('/') != std::string::npos) throw std::runtime_error("a row has a name with a slash");
      const std::string flags = columns.contains(side.client) ? TextAt(columns[side.client], "flags") : "";
      for (const bool survives : {true, false}) {
        side.survives = survives;
        row["sides"][survives ? "survives" : "fails"] = SideJson(side, folder, to_folder, program, flags);
      }
    }
  } catch (const FileError&) {
    throw;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{} is not an envelope: {}", file.string(), error.what()));
  }
  return PageWith(EnvelopePageTemplate(), "<script type=\"application/json\" id=\"envelope\">" +
                                              ScriptSafe(JsonText(envelope)) + "</script>\n");
}

}  // namespace tiltproof::harness
