// The command of a program with serial ports, and the environment that it gets: the same under `process:` and `clocked:`.
//
//   const SerialProgram program = {.command = "./fw {port}", .port = "/dev/pts/3", .baud = 115200};
//   ChildSpec child{.command = {"/bin/sh", "-c", CommandOf(program)}, .environment = EnvironmentOf(program)};
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace tiltproof::harness {

struct SerialProgram {
  std::string command;               // as in Program, with {port}, {reference_port} and {baud}
  std::string port, reference_port;  // paths
  long baud = 0, reference_baud = 0;
  std::string firmware, dialect;
  std::string parameters;  // TiltproofHost::parameters of firmware/tiltproof_client.h
};

// The command for sh -c.
std::string CommandOf(const SerialProgram& program);
std::vector<std::pair<std::string, std::string>> EnvironmentOf(const SerialProgram& program);

}  // namespace tiltproof::harness
