// Options of `tiltproof run`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tiltproof::harness {

struct RunOptions {
  std::vector<std::filesystem::path> paths;
  std::vector<std::string> clients;
  std::string mode = "lockstep";
  std::string distributed;  // "", "dds" or "socket"
  bool attach = false;
  int domain = 0;
  std::string interface;
  std::vector<std::string> peers;
  std::string expression;  // -k
  std::string tag;
  std::vector<std::string> settings;  // --set
  std::string firmware;               // build that every scenario flies; empty: its own
  std::optional<std::uint64_t> seed;
  std::vector<std::string> watch;
  int repeat_count = 1;
  int jobs_count = 1;
  std::filesystem::path out = "results";
  bool fail_fast = false;
  bool dry_run = false;
  bool last_failed = false;
  bool strict = false;  // scenarios in folders that cannot be flown are errors too
  std::string format = "human";
  bool no_progress = false;
  std::string keep = "all";
  std::string trace = "csv";
  bool no_report = false;
  std::optional<int> gdb_port;
  std::optional<double> gdb_at_s;
  std::optional<int> live_port;      // none: no live page
  bool live_waits = false;           // for its button Start
  std::vector<std::string> command;  // as typed, for run.json
};

}  // namespace tiltproof::harness
