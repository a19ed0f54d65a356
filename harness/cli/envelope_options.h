// Options of `tiltproof envelope`.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "harness/cli/shared_options.h"

namespace tiltproof::harness {

struct EnvelopeOptions : SearchOptions {
  std::filesystem::path scenario;
  std::vector<std::string> types;  // patterns; empty: every type
  std::vector<std::string> firmware;
  std::vector<std::string> clients;  // each is a column of its own
  std::vector<std::string> map;      // empty, or two
  std::filesystem::path out = "results/envelope";
  std::filesystem::path resume;  // the folder of an envelope that was interrupted; or empty
  bool keep = false;             // the flights on both sides of each margin
  bool no_report = false;
  bool no_progress = false;
  std::vector<std::string> command;  // as typed
};

}  // namespace tiltproof::harness
