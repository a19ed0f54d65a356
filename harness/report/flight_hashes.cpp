#include "harness/report/flight_hashes.h"

#include <fmt/format.h>

#include <cstdint>
#include <nlohmann/json.hpp>

#include "harness/report/files.h"
#include "harness/run/hash.h"

namespace tiltproof::harness {
namespace {

constexpr std::string_view kScenarioFile = "scenario.resolved.yaml";

bool IsHashed(const std::string& name) {
  return name == "trace.csv" || name == "trace.packed" || name == "faults.jsonl" || name == "link.bin" ||
         name == "flight.json" || name == kScenarioFile ||
         (name.starts_with("firmware.") && name.ends_with(".log"));
}

// As verdict.json says; empty: it does not.
std::string RecordedHash(const std::filesystem::path& path) {
  const std::filesystem::path verdict = path.parent_path() / "verdict.json";
  std::error_code none;
  if (!std::filesystem::exists(verdict, none)) return {};
  // One that is damaged has its own message where it is read.
  const auto json = nlohmann::json::parse(ReadFile(verdict), nullptr, false);
  if (!json.is_object() || !json.contains("files") || !json["files"].is_object()) return {};
  const auto found = json["files"].find(path.filename().string());
  return found != json["files"].end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

std::string HashOf(std::string_view content) {
  return fmt::format("{:016x}",
                     Fnv1a({reinterpret_cast<const std::uint8_t*>(content.data()), content.size()}));
}

std::map<std::string, std::string> HashesOf(const std::filesystem::path& folder) {
  std::map<std::string, std::string> hashes;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (const std::string name = entry.path().filename(); IsHashed(name))
      hashes[name] = HashOf(ReadFile(entry.path()));
  return hashes;
}

void CheckFlightFiles(const std::filesystem::path& folder) {
  for (const auto& [name, hash] : HashesOf(folder))
    if (name != kScenarioFile) ReadFlightFile(folder / name);
}

bool HasChanged(const std::filesystem::path& path) {
  const std::string recorded = RecordedHash(path);
  return !recorded.empty() && HashOf(ReadFile(path)) != recorded;
}

std::string ReadFlightFile(const std::filesystem::path& path) {
  std::string content = ReadFile(path);
  CheckFlightFile(path, content);
  return content;
}

void CheckFlightFile(const std::filesystem::path& path, std::string_view content) {
  if (const std::string recorded = RecordedHash(path); !recorded.empty())
    if (const std::string hash = HashOf(content); hash != recorded)
      throw FileError(
          fmt::format("{} has changed since the flight: its hash is {}, in verdict.json {}; put the old one "
                      "back, or take it out of `files` in verdict.json to read this one",
                      path.string(), hash, recorded));
}

}  // namespace tiltproof::harness
