#include "harness/cli/applicability.h"

#include <fmt/format.h>

#include <map>
#include <string>

#include "faults/device_command.h"
#include "faults/registry.h"
#include "harness/cli/commands.h"
#include "harness/emulator/elf_symbols.h"
#include "harness/scenario/fault_support.h"

namespace tiltproof::harness {
namespace {

ClientAbilities AbilitiesOf(const FlightMeans& means) {
  ClientAbilities abilities{ClientKind::kLibrary, means.realtime};
  if (!means.client.command.empty()) abilities.client = ClientKind::kProcess;
  if (!means.client.device.empty()) abilities.client = ClientKind::kSerial;
  if (means.client.emulator) abilities.client = ClientKind::kEmulator;
  return abilities;
}

// The memory that the scenario's faults flip and the image lacks.
void FindMissingRegions(const ElfSymbols& image, const Scenario& scenario,
                        std::vector<std::string>& problems) {
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    const faults::FaultSpec& fault = scenario.faults[i];
    if (fault.type != "device.bit_flip") continue;
    const faults::Parameters parameters = ResolvedParameters(fault, faults::ValidType(fault));
    try {
      const MemoryRegion region = image.Region(parameters.Text("region"));
      faults::DrawBitFlips(0, region.size_bytes, parameters.Integer("bit_count"));
    } catch (const std::exception& error) {
      problems.push_back(fmt::format("{}: {}", FaultPlace(scenario, i), error.what()));
    }
  }
}

// Reads each image once.
class Images {
 public:
  explicit Images(const ClientChoice& client) : client_(client) {}

  // Throws UsageError when there is none that can be read.
  const ElfSymbols& For(const Scenario& scenario) {
    const auto file = client_.FirmwareFile(scenario);
    if (!std::filesystem::is_regular_file(file))
      throw UsageError(fmt::format("--client {}: no image at {}{}", client_.text, file.string(),
                                   !client_.image.empty() ? ""
                                   : client_.scheduler == "freertos"
                                       ? ": it is built where FREERTOS_KERNEL_PATH names a FreeRTOS kernel, "
                                         "or `./setup --freertos` has fetched one"
                                       : ": it is built where gcc-arm-none-eabi is installed; run ./setup"));
    try {
      return images_.try_emplace(file, file).first->second;
    } catch (const std::runtime_error& error) {
      throw UsageError(fmt::format("--client {}: {}", client_.text, error.what()));
    }
  }

 private:
  const ClientChoice& client_;
  std::map<std::filesystem::path, ElfSymbols> images_;
};

}  // namespace

std::vector<NotApplicable> TakeNotApplicable(const FlightMeans& means, bool strict, Suite& suite) {
  const ClientAbilities abilities = AbilitiesOf(means);
  Images images(means.client);
  std::vector<NotApplicable> left_out;
  std::vector<std::string> refused;
  std::erase_if(suite.scenarios, [&](const SuiteScenario& entry) {
    std::vector<std::string> problems = UnsupportedFaults(entry.scenario, abilities);
    if (means.client.emulator) FindMissingRegions(images.For(entry.scenario), entry.scenario, problems);
    if (problems.empty()) return false;
    if (entry.named || strict)
      refused.insert(refused.end(), problems.begin(), problems.end());
    else
      left_out.push_back({entry.scenario.name, fmt::format("{}", fmt::join(problems, "; "))});
    return true;
  });
  if (!refused.empty()) throw UsageError(fmt::format("{}", fmt::join(refused, "\n")));
  return left_out;
}

}  // namespace tiltproof::harness
