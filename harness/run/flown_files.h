// The files that a flight is made of, besides its scenario: hosts that fly together must hold the same.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

struct FlownFile {
  std::string
      what;  // "vehicle", "file 1 that the vehicle includes", "tiltproof elements", "recorded reference"; the same on every host
  std::filesystem::path path;
  std::string hash;  // of its content, 16 hexadecimal digits; empty: it cannot be read
};

std::vector<FlownFile> FlownFiles(const Scenario& scenario);

// The first difference between this host's files and those with these hashes, which another host flies; empty: they
// are the same. Each hash belongs to the file at its place in `files`.
std::string DifferingFile(const Scenario& scenario, std::span<const std::string> files,
                          std::span<const std::string> hashes);

}  // namespace tiltproof::harness
