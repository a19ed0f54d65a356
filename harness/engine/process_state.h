// Open files and limits of this process. A library may not change them, because the flight's results depend on them.
//
//   const ProcessState before;
//   ...                                        // the flight
//   if (const std::string what = before.WhatChanged(); !what.empty())    // "closed descriptor 7 of its process"
//   before.RestoreLimits();
#pragma once

#include <sys/resource.h>
#include <sys/types.h>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace tiltproof::harness {

// The number of this process's threads.
std::size_t ThreadCount();

class ProcessState {
 public:
  // As it is now.
  ProcessState();

  // The first change, of which a firmware can be told that it made it; empty: none. Standard streams may lead elsewhere,
  // and limits may be higher.
  std::string WhatChanged() const;
  // As far as the system permits.
  void RestoreLimits() const;

 private:
  struct OpenFile {
    int descriptor;
    dev_t device;
    ino_t inode;
  };
  std::vector<OpenFile> files_;
  std::array<rlimit, RLIMIT_NLIMITS> limits_{};
};

}  // namespace tiltproof::harness
