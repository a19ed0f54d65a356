#include "harness/engine/process_state.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <system_error>
#include <utility>

namespace tiltproof::harness {
namespace {

// Those by which results can be lost.
constexpr std::array kLimits = {std::pair{RLIMIT_FSIZE, std::string_view("RLIMIT_FSIZE")},
                                std::pair{RLIMIT_NOFILE, std::string_view("RLIMIT_NOFILE")},
                                std::pair{RLIMIT_AS, std::string_view("RLIMIT_AS")},
                                std::pair{RLIMIT_DATA, std::string_view("RLIMIT_DATA")},
                                std::pair{RLIMIT_STACK, std::string_view("RLIMIT_STACK")},
                                std::pair{RLIMIT_CPU, std::string_view("RLIMIT_CPU")},
                                std::pair{RLIMIT_MEMLOCK, std::string_view("RLIMIT_MEMLOCK")}};

}  // namespace

std::size_t ThreadCount() {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator("/proc/self/task"),
                                                std::filesystem::directory_iterator()));
}

ProcessState::ProcessState() {
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", none)) {
    const int descriptor = std::atoi(entry.path().filename().c_str());
    struct stat status {};
    if (fstat(descriptor, &status) == 0) files_.push_back({descriptor, status.st_dev, status.st_ino});
  }
  // The listing's own.
  std::erase_if(files_, [](const OpenFile& file) { return fcntl(file.descriptor, F_GETFD) < 0; });
  for (const auto& [limit, name] : kLimits) getrlimit(limit, &limits_[static_cast<std::size_t>(limit)]);
}

std::string ProcessState::WhatChanged() const {
  for (const OpenFile& file : files_) {
    struct stat now {};
    const bool open = fstat(file.descriptor, &now) == 0;
    const bool same = open && now.st_dev == file.device && now.st_ino == file.inode;
    if (!same && (!open || file.descriptor > STDERR_FILENO))
      return fmt::format("closed descriptor {} of its process", file.descriptor);
  }
  for (const auto& [limit, name] : kLimits) {
    rlimit now{};
    const rlimit& before = limits_[static_cast<std::size_t>(limit)];
    if (getrlimit(limit, &now) == 0 && (now.rlim_cur < before.rlim_cur || now.rlim_max < before.rlim_max))
      return fmt::format("lowered {} of its process", name);
  }
  return {};
}

void ProcessState::RestoreLimits() const {
  for (const auto& [limit, name] : kLimits) {
    const rlimit& before = limits_[static_cast<std::size_t>(limit)];
    if (setrlimit(limit, &before) == 0) continue;
    rlimit now{};
    if (getrlimit(limit, &now) != 0) continue;
    now.rlim_cur = now.rlim_max;
    setrlimit(limit, &now);
  }
}

}  // namespace tiltproof::harness
