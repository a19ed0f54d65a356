// The files that a flight is made of, besides its scenario: hosts that fly together must hold the same.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

struct FlownFile {
  std::string what;  // "vehicle", "tiltproof elements", "recorded reference"; the same on every host
  std::filesystem::path path;
  std::string hash;  // of its content, 16 hexadecimal digits; empty: it cannot be read
};

std::vector<FlownFile> FlownFiles(const Scenario& scenario);

// What is wrong with the files of this host, when another one flies with these hashes, each of the file in its place in
// `files`; empty: they are the same.
std::string DifferingFile(const Scenario& scenario, std::span<const std::string> files,
                          std::span<const std::string> hashes);

}  // namespace tiltproof::harness
