#include "harness/run/flown_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <system_error>
#include <variant>

#include "harness/run/hash.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {
namespace {

std::string HashOf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return {};
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  return fmt::format("{:016x}", Fnv1a({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}));
}

// None for a vehicle that cannot be read: the hash of its own file differs as well.
std::vector<std::filesystem::path> IncludedBy(const std::filesystem::path& vehicle) {
  try {
    return plant::IncludedFiles(vehicle);
  } catch (const plant::VehicleError&) {
    return {};
  }
}

}  // namespace

std::vector<FlownFile> FlownFiles(const Scenario& scenario) {
  std::vector<FlownFile> files;
  const auto add = [&](const char* what, const std::filesystem::path& path) {
    files.push_back({what, path, HashOf(path)});
  };
  add("vehicle", scenario.model_file);
  // The order of the files is that of their uses, on every host.
  const std::vector<std::filesystem::path> included = IncludedBy(scenario.model_file);
  for (std::size_t i = 0; i < included.size(); ++i)
    files.push_back(
        {fmt::format("file {} that the vehicle includes", i + 1), included[i], HashOf(included[i])});
  std::filesystem::path elements = scenario.model_file;
  elements.replace_extension(".tiltproof.xml");
  std::error_code none;
  if (std::filesystem::exists(elements, none)) add("tiltproof elements", elements);
  if (const auto* recorded = std::get_if<RecordedReference>(&scenario.reference.path))
    add("recorded reference", recorded->file);
  return files;
}

std::string DifferingFile(const Scenario& scenario, std::span<const std::string> files,
                          std::span<const std::string> hashes) {
  const std::vector<FlownFile> own = FlownFiles(scenario);
  for (std::size_t i = 0; i < files.size() && i < hashes.size(); ++i) {
    const auto found = std::ranges::find(own, files[i], &FlownFile::what);
    if (found == own.end()) return fmt::format("this host has no file for the {}", files[i]);
    if (found->hash != hashes[i])
      return fmt::format(
          "the {} {} on this host is another one than the harness flies (hash {}, there {}): copy it",
          found->what, found->path.string(), found->hash, hashes[i]);
  }
  for (const FlownFile& file : own)
    if (std::ranges::find(files, file.what) == files.end())
      return fmt::format("the harness has no file for the {} {}", file.what, file.path.string());
  return {};
}

}  // namespace tiltproof::harness
