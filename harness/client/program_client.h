// A program that flies in lockstep over a socket (docs/program.md): `--client 'program:CMD'`.
//
//   const auto client = StartProgramClient({.name = "program:python3 fw.py", .command = "python3 fw.py"}, hello, host);
#pragma once

#include <memory>

#include "harness/client/client.h"
#include "harness/client/program_messages.h"
#include "harness/client/program_process.h"

namespace tiltproof::harness {

// Starts the program. Throws std::runtime_error that says what is wrong with it: it cannot be started, does not connect,
// refuses, or speaks another version. Throws FirmwareTrouble as a flight does.
std::unique_ptr<Client> StartProgramClient(const ProgramSpec& spec, const ProgramHello& hello,
                                           ClientHost host);

}  // namespace tiltproof::harness
