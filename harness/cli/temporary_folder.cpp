#include "harness/cli/temporary_folder.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <cerrno>
#include <cstring>

#include "harness/report/files.h"

namespace tiltproof::harness {

TemporaryFolder::TemporaryFolder(const std::string& purpose) {
  std::error_code error;
  const auto parent = std::filesystem::temp_directory_path(error);
  const char* tmpdir = std::getenv("TMPDIR");
  if (error)
    throw FileError(fmt::format("no temporary folder: TMPDIR is '{}', which is not a folder",
                                tmpdir == nullptr ? "/tmp" : tmpdir));
  std::string name = (parent / fmt::format("tiltproof-{}-XXXXXX", purpose)).string();
  if (mkdtemp(name.data()) == nullptr)
    throw FileError(
        fmt::format("cannot create {}: {}; TMPDIR names another folder for it", name, std::strerror(errno)));
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code error;
  if (!kept_) std::filesystem::remove_all(path_, error);
}

}  // namespace tiltproof::harness
