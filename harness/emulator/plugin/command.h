// The body of a command of the harness as a struct; and the end of a plug-in that is given what it does not understand.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>

namespace tiltproof::qemu {

[[noreturn]] inline void Die(const char* what) {
  std::fprintf(stderr, "lockstep plug-in: %s\n", what);
  _exit(1);
}

template <class Body>
Body As(const std::vector<std::uint8_t>& bytes) {
  Body body{};
  if (bytes.size() < sizeof(body)) Die("a command is too short: harness and plug-in of different builds?");
  std::memcpy(&body, bytes.data(), sizeof(body));
  return body;
}

}  // namespace tiltproof::qemu
