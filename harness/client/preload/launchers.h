// Programs that start the firmware, as `sh -c CMD` does, and are not it: they run in the machine's time.
//
//   if (IsLauncher("nice")) return;   // what it starts is the firmware
#pragma once

#include <array>
#include <string_view>

namespace tiltproof {

// `name`: of the file, without its folder.
constexpr bool IsLauncher(std::string_view name) {
  constexpr std::array<std::string_view, 11> kNames = {
      "sh", "dash", "bash", "busybox", "env", "nice", "ionice", "taskset", "stdbuf", "setarch", "chrt"};
  for (const std::string_view known : kNames)
    if (name == known) return true;
  return false;
}

}  // namespace tiltproof
