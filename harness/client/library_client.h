// A firmware built as a shared library (firmware/tiltproof_client.h), loaded at run time: `--client host` and
// `--client library:FILE`.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "harness/client/captured_output.h"
#include "harness/client/client.h"

namespace tiltproof::harness {

// Loads the library and creates its client as build `firmware`. Throws std::runtime_error saying what is
// wrong with the file: missing, not a library, a function missing, another interface version, or an unknown
// build or dialect. Its output is logged when `output` captures it. A failure in tiltproof_client_destroy is
// a warning on standard error: destroy the client when the flight is judged. `coverage`: it tells what code it executes.
// `parameters`: makes the text of that name in TiltproofHost; it is called for a library that can take it.
std::unique_ptr<Client> LoadLibraryClient(const std::filesystem::path& library, const std::string& firmware,
                                          const std::string& dialect, ClientHost host,
                                          std::unique_ptr<CapturedOutput> output = nullptr,
                                          bool coverage = false,
                                          const std::function<std::string()>& parameters = {});

// The reason that the file is not a firmware library, tested in a separate process; nullopt when it is one.
std::optional<std::string> LibraryMistake(const std::filesystem::path& library);

// True if it has the function tiltproof_client_status, tested in the same way.
bool TellsStatus(const std::filesystem::path& library);
// The same for tiltproof_client_role.
bool TellsRole(const std::filesystem::path& library);

}  // namespace tiltproof::harness
