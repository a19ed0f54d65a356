// A folder of this machine for what a command needs only while it runs.
//
//   TemporaryFolder folder("replay");
//   Use(folder.path() / "flight");
#pragma once

#include <filesystem>
#include <string>

namespace tiltproof::harness {

// Removed at the end, in every case, unless a path in it was printed.
class TemporaryFolder {
 public:
  // In TMPDIR, or /tmp. `purpose`: a part of its name. Throws FileError.
  explicit TemporaryFolder(const std::string& purpose);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // The path of what has this name in it, for a message.
  std::string Keep(const std::string& name) {
    kept_ = true;
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_;
  bool kept_ = false;
};

}  // namespace tiltproof::harness
