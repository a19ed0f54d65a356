#include "harness/client/code_place.h"

#include <dlfcn.h>

#include <cstddef>
#include <cstdio>
#include <cstring>

namespace tiltproof::harness {

std::string CodePlace::text() const {
  if (!known()) return "";
  const std::string in = function[0] == '\0' ? "" : std::string(" in ") + function.data();
  return std::string(" at ") + at.data() + in;
}

void FindCode(const void* address, CodePlace& place) {
  place = {};
  Dl_info info{};
  if (dladdr(address, &info) == 0 || info.dli_fname == nullptr) return;
  const char* const name = std::strrchr(info.dli_fname, '/');
  const char* const file = name == nullptr ? info.dli_fname : name + 1;
  const auto offset = static_cast<const char*>(address) - static_cast<const char*>(info.dli_fbase);
  std::snprintf(place.at.data(), place.at.size(), "%.100s+0x%zx", file, static_cast<std::size_t>(offset));
  if (info.dli_sname != nullptr)
    std::snprintf(place.function.data(), place.function.size(), "%.100s", info.dli_sname);
}

}  // namespace tiltproof::harness
