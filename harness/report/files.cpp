#include "harness/report/files.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>

namespace tiltproof::harness {
namespace {

[[noreturn]] void Fail(std::string_view doing, const std::filesystem::path& path, int error) {
  throw FileError(fmt::format("cannot {} {}: {}", doing, path.string(), std::strerror(error)));
}

std::chrono::sys_time<std::chrono::milliseconds> Now() {
  return std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
}

// Creates `path` with that content, or leaves nothing there; messages name it `named`.
void WriteWhole(const std::filesystem::path& path, int flags, std::string_view content,
                const std::filesystem::path& named) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | flags, 0644);
  if (file < 0) Fail("create", named, errno);
  int error = 0;
  while (!content.empty() && error == 0) {
    const ssize_t written = write(file, content.data(), content.size());
    if (written >= 0)
      content.remove_prefix(static_cast<std::size_t>(written));
    else if (errno != EINTR)
      error = errno;
  }
  if (close(file) != 0 && error == 0) error = errno;
  if (error == 0) return;
  unlink(path.c_str());
  Fail("write", named, error);
}

}  // namespace

void WriteFile(const std::filesystem::path& path, std::string_view content) {
  const std::filesystem::path temporary = path.string() + ".part";
  WriteWhole(temporary, O_TRUNC, content, path);
  if (rename(temporary.c_str(), path.c_str()) != 0) {
    const int error = errno;
    unlink(temporary.c_str());
    Fail("rename to", path, error);
  }
}

void WriteNewFile(const std::filesystem::path& path, std::string_view content) {
  WriteWhole(path, O_EXCL, content, path);
}

std::string ReadFile(const std::filesystem::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) Fail("open", path, errno);
  std::string content;
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
    content.append(buffer, static_cast<std::size_t>(got));
  }
  close(file);
  return content;
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
