#include "harness/report/machine.h"

#include <fmt/format.h>
#include <gnu/libc-version.h>

#include <fstream>
#if __has_include(<sys/platform/x86.h>)
#ifdef __clang__
using _Bool = bool;  // NOLINT: the header is written for C; GCC knows the word in C++, too
#endif
#include <sys/platform/x86.h>
#endif

namespace tiltproof::harness {
namespace {

// "model name : Intel(R) Xeon(R) Processor", of the first processor. Not every architecture has that line.
std::string ProcessorModel() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("model name")) continue;
    const std::size_t value = line.find_first_not_of(" \t", line.find(':') + 1);
    if (value != line.npos) return line.substr(value);
  }
  return "unknown";
}

#if __has_include(<sys/platform/x86.h>)
std::string ProcessorFeatures() {
  std::string features;
  const auto add = [&features](std::string_view name, bool active) {
    if (active) features += fmt::format("{}{}", features.empty() ? "" : " ", name);
  };
  add("SSE4_1", CPU_FEATURE_ACTIVE(SSE4_1));
  add("AVX", CPU_FEATURE_ACTIVE(AVX));
  add("AVX2", CPU_FEATURE_ACTIVE(AVX2));
  add("FMA", CPU_FEATURE_ACTIVE(FMA));
  add("FMA4", CPU_FEATURE_ACTIVE(FMA4));
  return features;
}
#endif

}  // namespace

Machine ThisMachine() {
  Machine machine;
#ifdef __clang__
  machine["compiler"] = "Clang " __clang_version__;
#else
  machine["compiler"] = "GCC " __VERSION__;
#endif
  machine["libc"] = fmt::format("glibc {}", gnu_get_libc_version());
  machine["processor"] = ProcessorModel();
#if __has_include(<sys/platform/x86.h>)
  machine["processor_features"] = ProcessorFeatures();
#endif
  return machine;
}

std::string MachineDifference(const Machine& a, const Machine& b, std::string_view in_a,
                              std::string_view in_b) {
  if (a.empty() || b.empty()) return {};
  Machine names = a;
  names.insert(b.begin(), b.end());
  std::string text;
  const auto value = [](const Machine& machine, const std::string& name) {
    const auto found = machine.find(name);
    return found == machine.end() ? std::string("none") : fmt::format("'{}'", found->second);
  };
  for (const auto& [name, ignored] : names) {
    const std::string of_a = value(a, name), of_b = value(b, name);
    if (of_a != of_b)
      text += fmt::format("{}{} {} {}, {} {}", text.empty() ? "" : "; ", name, of_a, in_a, of_b, in_b);
  }
  return text;
}

}  // namespace tiltproof::harness
