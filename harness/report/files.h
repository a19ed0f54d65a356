// Files of a run: written whole or not at all, with a clear error when the disk refuses.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// A file error; the text names the file and the system's reason.
struct FileError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// A file that is written piece by piece: a temporary beside `path` that is renamed at the end, so that readers never
// see half a file. A device or a pipe at `path` is written to as it is.
//
//   NewFile file("flight.mcap");
//   file.Write(bytes);
//   file.Finish();
class NewFile {
 public:
  // The fate in Finish() of a file that has the name already.
  enum class Existing { kReplaced, kRefused };
  explicit NewFile(std::filesystem::path path, Existing existing = Existing::kReplaced);
  // Without Finish() nothing is left.
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  void Write(std::string_view content);
  void Finish();

 private:
  [[noreturn]] void GiveUp(std::string_view doing);
  void Close();

  std::filesystem::path path_, written_;  // the same for a device
  Existing existing_;
  int file_ = -1;
};

// The same at once.
void WriteFile(const std::filesystem::path& path, std::string_view content);
// Never replaces anything: an error if there is something of that name, be it a link to nothing.
void WriteNewFile(const std::filesystem::path& path, std::string_view content);
std::string ReadFile(const std::filesystem::path& path);
// The bytes in pieces, in their order: a large file does not fill memory.
void ReadPieces(const std::filesystem::path& path, const std::function<void(std::string_view)>& take);

// Creates <parent>/<UTC to the ms>-<suite>-<seed>[-n] exclusively, n = 2, 3, ... when it exists already, and
// points <parent>/latest at it, unless that is not a link but a user's file or folder.
std::filesystem::path CreateRunFolder(const std::filesystem::path& parent, const std::string& suite,
                                      std::uint64_t seed);

// True if <parent>/latest exists and is not a link; CreateRunFolder() then leaves it unchanged.
bool LatestIsTaken(const std::filesystem::path& parent);

// The present UTC time, ISO 8601 to the millisecond.
std::string UtcNow();

}  // namespace tiltproof::harness
