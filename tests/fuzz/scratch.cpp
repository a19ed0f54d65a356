#include "tests/fuzz/scratch.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/tiltrotor_text.h"

namespace tiltproof::testing {

const std::filesystem::path& ScratchFolder() {
  struct Folder {
    Folder() {
      std::string name = (std::filesystem::temp_directory_path() / "tiltproof-fuzz-XXXXXX").string();
      Require(mkdtemp(name.data()) != nullptr, "a temporary folder can be made");
      path = name;
    }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
    std::filesystem::path path;
  };
  static const Folder folder;
  return folder.path;
}

std::filesystem::path ScratchFile(const std::filesystem::path& name, std::span<const std::uint8_t> content) {
  const auto file = ScratchFolder() / name;
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(content.data()), static_cast<std::streamsize>(content.size()));
  out.close();
  Require(out.good(), "a temporary file can be written");
  return file;
}

std::filesystem::path TiltrotorFile() {
  static const std::filesystem::path file = [] {
    const std::string_view text = kTiltrotorText;
    return ScratchFile("tiltrotor.sdf", {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  }();
  return file;
}

const plant::VehicleModel& Tiltrotor() {
  static const plant::VehicleModel model = [] {
    std::vector<std::string> warnings;
    return plant::LoadVehicle(TiltrotorFile(), {}, warnings);
  }();
  return model;
}

}  // namespace tiltproof::testing
