#include "harness/cli/data_files.h"

#include "harness/client/firmware_files.h"

namespace tiltproof::harness {

std::filesystem::path ModelsFolder() {
  const auto installed = ProgramFolder().parent_path() / "share/tiltproof/models";
  return std::filesystem::exists(installed) ? installed
                                            : std::filesystem::path(TILTPROOF_SOURCE_DIR) / "plant/models";
}

}  // namespace tiltproof::harness
