// The command of a program with serial ports, and the environment that it gets: the same under `process:` and `clocked:`.
//
//   const SerialProgram program = {.command = "./fw {port} {cross_port}", .port = "/dev/pts/3", .baud = 115200,
//                                  .line_ports = {{"cross", "/dev/pts/5"}}};
//   Start(CommandOf(program), EnvironmentOf(program));   // "./fw /dev/pts/3 /dev/pts/5", TILTPROOF_PORT=/dev/pts/3, ...
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
  std::vector<std::pair<std::string, std::string>> line_ports = {};  // to other boards: id and path
};

// The command for sh -c.
std::string CommandOf(const SerialProgram& program);
std::vector<std::pair<std::string, std::string>> EnvironmentOf(const SerialProgram& program);

}  // namespace tiltproof::harness
