#include "harness/cli/data_files.h"

#include "harness/client/firmware_files.h"

namespace tiltproof::harness {

std::filesystem::path ModelsFolder() {
  const auto installed = ProgramFolder().parent_path() / "share/tiltproof/models";
  return std::filesystem::exists(installed) ? installed : ProgramFolder() / "models";
}

}  // namespace tiltproof::harness
