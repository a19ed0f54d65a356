// Files of a run: written whole or not at all, with a clear error when the disk refuses.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// A file error; the text names the file and the system's reason.
struct FileError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Writes a temporary beside `path` and renames it, so that readers never see half a file.
void WriteFile(const std::filesystem::path& path, std::string_view content);
// Never replaces anything: an error if there is something of that name, be it a link to nothing.
void WriteNewFile(const std::filesystem::path& path, std::string_view content);
std::string ReadFile(const std::filesystem::path& path);

// Creates <parent>/<UTC to the ms>-<suite>-<seed>[-n] exclusively, n = 2, 3, ... when it exists already, and
// points <parent>/latest at it, unless that is not a link but a user's file or folder.
std::filesystem::path CreateRunFolder(const std::filesystem::path& parent, const std::string& suite,
                                      std::uint64_t seed);

// Whether <parent>/latest is not a link, and therefore left unchanged.
bool LatestIsTaken(const std::filesystem::path& parent);

// The present UTC time, ISO 8601 to the millisecond.
std::string UtcNow();

}  // namespace tiltproof::harness
