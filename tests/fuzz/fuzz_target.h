// Helpers that the fuzz targets share. A target is one file, NAME_fuzz.cpp, and one line in CMakeLists.txt:
//
//   extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
//     const auto log = Tried<std::runtime_error>([&] { return LinkLog({data, data + size}); });
//     if (log) Require(log->content().size() >= 8, "a log without its magic");
//     return 0;
//   }
#pragma once

#include <cstdio>
#include <cstdlib>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

namespace tiltproof::testing {

// Aborts unless `holds`, as it must for every input. The engine keeps the input of a program that ends here.
inline void Require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

// The result, or nothing when the input was refused as it should be: by this exception and no other.
template <class Refusal, class Act>
auto Tried(const Act& act) -> std::optional<decltype(act())> {
  try {
    return act();
  } catch (const Refusal& refusal) {
    Require(!std::string_view(refusal.what()).empty(), "a refusal says why");
    return std::nullopt;
  }
}

}  // namespace tiltproof::testing
