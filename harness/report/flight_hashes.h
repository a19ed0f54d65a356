// Hashes of a flight's files, by which a changed one is noticed. verdict.json has them, as `files`. A changed scenario is
// not refused, because its criteria may be changed, and the flight scored again.
//
//   const std::map<std::string, std::string> files = HashesOf(folder);   // when the flight has ended
//   const std::string content = ReadFlightFile(folder / "link.bin");     // later; throws when it has changed
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// Hashes of the trace, faults.jsonl, link.bin, the firmware's logs, flight.json and scenario.resolved.yaml, as far as they
// are there: by the file's name. Throws FileError.
std::map<std::string, std::string> HashesOf(const std::filesystem::path& folder);

// FNV-1a as 16 hexadecimal digits. Any single changed byte changes it; not cryptographic.
std::string HashOf(std::string_view content);

// The content of a file in a flight's folder. Throws FileError when it cannot be read, or when verdict.json beside it has
// another hash for it. A folder of an older program has no hashes.
std::string ReadFlightFile(const std::filesystem::path& path);

// The same for a content that is read already.
void CheckFlightFile(const std::filesystem::path& path, std::string_view content);

// True if verdict.json beside the file has another hash for it.
bool HasChanged(const std::filesystem::path& path);

// Throws FileError for the first file of the folder that ReadFlightFile() refuses, except the scenario.
void CheckFlightFiles(const std::filesystem::path& folder);

}  // namespace tiltproof::harness
