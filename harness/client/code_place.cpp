#include "harness/client/code_place.h"

#include <dlfcn.h>

#include <cstddef>
#include <cstdio>
#include <cstring>

namespace tiltproof::harness {

void DescribeCode(const void* address, std::span<char> text) {
  text[0] = '\0';
  Dl_info info{};
  if (dladdr(address, &info) == 0 || info.dli_fname == nullptr) return;
  const char* const name = std::strrchr(info.dli_fname, '/');
  const char* const file = name == nullptr ? info.dli_fname : name + 1;
  const auto offset = static_cast<const char*>(address) - static_cast<const char*>(info.dli_fbase);
  std::snprintf(text.data(), text.size(), " at %.100s+0x%zx%s%.100s", file, static_cast<std::size_t>(offset),
                info.dli_sname == nullptr ? "" : " in ", info.dli_sname == nullptr ? "" : info.dli_sname);
}

}  // namespace tiltproof::harness
