#include "harness/report/files.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <utility>

namespace tiltproof::harness {
namespace {

[[noreturn]] void Fail(std::string_view doing, const std::filesystem::path& path, int error) {
  throw FileError(fmt::format("cannot {} {}: {}", doing, path.string(), std::strerror(error)));
}

std::chrono::sys_time<std::chrono::milliseconds> Now() {
  return std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
}

}  // namespace

NewFile::NewFile(std::filesystem::path path, Existing existing)
    : path_(std::move(path)), written_(path_.string() + ".part"), existing_(existing) {
  std::error_code error;
  const auto there = std::filesystem::status(path_, error).type();
  using Type = std::filesystem::file_type;
  const bool device = there == Type::character || there == Type::block || there == Type::fifo;
  if (device && existing_ == Existing::kReplaced) written_ = path_;
  file_ = open(written_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file_ < 0) Fail("create", path_, errno);
}

NewFile::~NewFile() {
  if (file_ >= 0) Close();
}

void NewFile::Close() {
  close(file_);
  file_ = -1;
  if (written_ != path_) unlink(written_.c_str());
}

void NewFile::GiveUp(std::string_view doing) {
  const int error = errno;
  Close();
  Fail(doing, path_, error);
}

void NewFile::Write(std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = write(file_, content.data(), content.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      GiveUp("write");
    }
    content.remove_prefix(static_cast<std::size_t>(written));
  }
}

void NewFile::Finish() {
  // A failing close() has closed it, too.
  const int closed = close(std::exchange(file_, -1));
  const unsigned flags = existing_ == Existing::kRefused ? RENAME_NOREPLACE : 0;
  const bool moved = closed == 0 && (written_ == path_ || renameat2(AT_FDCWD, written_.c_str(), AT_FDCWD,
                                                                    path_.c_str(), flags) == 0);
  if (moved) return;
  const int error = errno;
  if (written_ != path_) unlink(written_.c_str());
  Fail(closed != 0 ? "write" : error == EEXIST ? "create" : "rename to", path_, error);
}

void WriteFile(const std::filesystem::path& path, std::string_view content) {
  NewFile file(path);
  file.Write(content);
  file.Finish();
}

void WriteNewFile(const std::filesystem::path& path, std::string_view content) {
  NewFile file(path, NewFile::Existing::kRefused);
  file.Write(content);
  file.Finish();
}

std::string ReadFile(const std::filesystem::path& path) {
  std::string content;
  std::error_code none;
  // A pipe has no size, and a file may grow.
  if (const auto size = std::filesystem::file_size(path, none); !none) content.reserve(size);
  ReadPieces(path, [&](std::string_view piece) { content += piece; });
  return content;
}

void ReadPieces(const std::filesystem::path& path, const std::function<void(std::string_view)>& take) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) Fail("open", path, errno);
  char buffer[65536];
  for (;;) {
    const ssize_t got = read(file, buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      const int error = errno;
      close(file);
      Fail("read", path, error);
    }
    if (got == 0) break;
    take({buffer, static_cast<std::size_t>(got)});
  }
  close(file);
}

std::filesystem::path CreateRunFolder(const std::filesystem::path& parent, const std::string& suite,
                                      std::uint64_t seed) {
  std::error_code error;
  std::filesystem::create_directories(parent, error);
  if (error) throw FileError(fmt::format("cannot create {}: {}", parent.string(), error.message()));
  const auto now = Now();
  const std::string name =
      fmt::format("{:%Y%m%dT%H%M%S}.{:03d}Z-{}-{}", std::chrono::floor<std::chrono::seconds>(now),
                  now.time_since_epoch().count() % 1000, suite, seed);
  for (int n = 1;; ++n) {
    const std::string unique = n == 1 ? name : fmt::format("{}-{}", name, n);
    const std::filesystem::path folder = parent / unique;
    if (mkdir(folder.c_str(), 0755) == 0) {
      if (LatestIsTaken(parent)) return folder;
      // A link beside it, then a rename: `latest` never misses, whoever else is writing. Not worth failing a
      // run for.
      const std::filesystem::path link = parent / fmt::format(".latest-{}", unique);
      if (symlink(unique.c_str(), link.c_str()) == 0 &&
          rename(link.c_str(), (parent / "latest").c_str()) != 0)
        unlink(link.c_str());
      return folder;
    }
    if (errno != EEXIST) Fail("create", folder, errno);
  }
}

bool LatestIsTaken(const std::filesystem::path& parent) {
  std::error_code error;
  const auto status = std::filesystem::symlink_status(parent / "latest", error);
  return std::filesystem::exists(status) && !std::filesystem::is_symlink(status);
}

std::string UtcNow() {
  const auto now = Now();
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03d}Z", std::chrono::floor<std::chrono::seconds>(now),
                     now.time_since_epoch().count() % 1000);
}

}  // namespace tiltproof::harness
