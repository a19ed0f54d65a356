// Options that several commands have, and the action of a command. The options are shared with the action, which is
// called after the command line has been read.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "harness/cli/commands.h"

namespace tiltproof::harness {

// `more`: another line of the help.
void AddClients(CLI::App& command, std::vector<std::string>& clients, const std::string& more = "");
// A check of names of builds.
std::string NamesNoBuild(const std::string& name);
void AddFirmware(CLI::App& command, std::string& build);
void AddBus(CLI::App& command, int& domain, std::string& interface, std::vector<std::string>& peers);
void AddSeed(CLI::App& command, std::optional<std::uint64_t>& seed, const std::string& help);
void AddJobs(CLI::App& command, int& jobs_count);
// A format is human or jsonl.
void AddFormat(CLI::App& command, std::string& format, const std::string& help);

struct PortNumbers {
  int usual = 0;  // when the number is left out
  int least = 0;
};
void AddPort(CLI::App& command, const std::string& name, std::optional<int>& port, PortNumbers numbers,
             const std::string& help);

// Options of the commands that search for limits.
struct SearchOptions {
  double tolerance = 0.01;
  int repeat_count = 5;
  std::optional<std::uint64_t> seed;
  int jobs_count = 1;
};
void AddSearch(CLI::App& command, SearchOptions& options);

// The line gets this action when it names the command.
void SetAction(CLI::App& command, CommandLine& line, std::function<int()> action);

}  // namespace tiltproof::harness
