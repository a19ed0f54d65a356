// A firmware built as a shared library (firmware/tiltproof_client.h), loaded at run time: `--client host` and
// `--client library:FILE`.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "harness/client/client.h"
#include "link/messages.h"

namespace tiltproof::harness {

// Loads the library and creates its client as build `firmware`. Throws std::runtime_error saying what is
// wrong with the file: missing, not a library, a function missing, another interface version, or a build or
// dialect that it does not know.
std::unique_ptr<Client> LoadLibraryClient(const std::filesystem::path& library, const std::string& firmware,
                                          link::Dialect dialect, ClientHost host);

}  // namespace tiltproof::harness
