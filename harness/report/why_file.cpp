#include "harness/report/why_file.h"

#include <fmt/format.h>

#include <stdexcept>

#include "harness/report/files.h"
#include "harness/report/json_fields.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kWhyName = "why.json";

}  // namespace

void WriteWhy(const std::filesystem::path& folder, const WhyFile& why) {
  WriteFile(folder / kWhyName, JsonText(ToJson(why), 2) + "\n");
}

std::optional<WhyFile> ReadWhy(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / kWhyName;
  if (!std::filesystem::exists(file)) return std::nullopt;
  try {
    return FromJson<WhyFile>(Json::parse(ReadFile(file)));
  } catch (const FileError&) {
    throw;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace tiltproof::harness
