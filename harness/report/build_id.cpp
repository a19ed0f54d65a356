#include "harness/report/build_id.h"

#include <fmt/format.h>

#include <cstdint>
#include <span>
#include <string_view>

#include "harness/report/files.h"
#include "harness/run/hash.h"

namespace tiltproof::harness {

std::string BuildId(const std::filesystem::path& firmware_library) {
  std::uint64_t hash = kFnvOffset;
  for (const auto& file : {std::filesystem::path("/proc/self/exe"), firmware_library}) {
    if (file.empty()) continue;
    ReadPieces(file, [&](std::string_view piece) {
      hash = Fnv1a(std::span(reinterpret_cast<const std::uint8_t*>(piece.data()), piece.size()), hash);
    });
  }
  return fmt::format("{:016x}", hash);
}

}  // namespace tiltproof::harness
