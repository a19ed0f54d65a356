#include "harness/campaign/envelope_sides.h"

#include <fmt/format.h>

#include <cstdint>
#include <stdexcept>
#include <utility>

#include "harness/report/files.h"
#include "harness/run/hash.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

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

EnvelopeSide SideOf(const EnvelopeEntry& entry, bool survives) {
  EnvelopeSide side{.client = entry.client,
                    .type = entry.type,
                    .place = entry.place(),
                    .side = entry.side.value_or(""),
                    .survives = survives};
  for (const std::string* part : {&side.type, &side.place, &side.side})
    if (part->find('/') != std::string::npos) throw std::runtime_error("a row has a name with a slash");
  return side;
}

std::vector<SideFlight> SidesOf(const std::vector<EnvelopeSearchRow>& rows) {
  std::vector<SideFlight> sides;
  for (const EnvelopeSearchRow& row : rows) {
    if (!row.found || row.found->error) continue;
    for (const bool survives : {true, false}) {
      const std::optional<double>& level = survives ? row.found->survives : row.found->fails;
      if (!level) continue;
      SideFlight flight{.side = SideOf(*row.found, survives), .job = row.task.job};
      Scenario& scenario = flight.job.scenario;
      scenario = AtLevel(scenario, row.task.fault, row.task.severity, *level);
      if (!survives) scenario.seed = row.found->seed.value_or(scenario.seed);
      scenario.name = flight.side.name();
      scenario.expect = {.verdict = survives ? Verdict::kPass : Verdict::kFail, .by_firmware = {}};
      flight.job.name = scenario.name;
      sides.push_back(std::move(flight));
    }
  }
  return sides;
}

void WriteLevels(const std::filesystem::path& folder, const std::vector<SideFlight>& sides) {
  for (const SideFlight& flight : sides) {
    const std::filesystem::path file = folder / flight.side.scenario_file();
    std::filesystem::create_directories(file.parent_path());
    WriteFile(file, WriteResolved(flight.job.scenario));
  }
}

}  // namespace tiltproof::harness
