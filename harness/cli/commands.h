// The commands of the program and their exit codes. One file has all of a command: its options, its help and its action,
// which it registers with the command line. Parsing the words then sets the action of the command that they name.
#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace tiltproof::harness {

enum Exit : int {
  kExitGreen = 0,
  kExitNotGreen = 1,
  kExitUsage = 2,
  kExitError = 3,
  kExitUndecided = 4,
  kExitInterrupted = 130
};

// A user's error in a flag or file: printed unchanged, exit 2.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// As in scenario files: every JSON reader can hold it.
inline constexpr std::uint64_t kSeedMax = (std::uint64_t{1} << 53) - 1;

struct CommandLine {
  std::vector<std::string> words;  // as typed, the program's name first
  std::function<int()> action;     // of the command that they name; returns the process's exit code
};

// In the order of --help.
void RegisterRun(CLI::App& program, CommandLine& line);
void RegisterCheck(CLI::App& program, CommandLine& line);  // and `list`
void RegisterNew(CLI::App& program, CommandLine& line);    // and `schema`
void RegisterFaults(CLI::App& program, CommandLine& line);
void RegisterReplay(CLI::App& program, CommandLine& line);
void RegisterScore(CLI::App& program, CommandLine& line);
void RegisterReport(CLI::App& program, CommandLine& line);
void RegisterExport(CLI::App& program, CommandLine& line);
void RegisterCompare(CLI::App& program, CommandLine& line);
void RegisterMargin(CLI::App& program, CommandLine& line);
void RegisterEnvelope(CLI::App& program, CommandLine& line);
void RegisterCampaign(CLI::App& program, CommandLine& line);
void RegisterMinimise(CLI::App& program, CommandLine& line);
void RegisterSearch(CLI::App& program, CommandLine& line);
void RegisterWhy(CLI::App& program, CommandLine& line);
void RegisterFuzz(CLI::App& program, CommandLine& line);
void RegisterSession(CLI::App& program, CommandLine& line);
void RegisterVehicle(CLI::App& program, CommandLine& line);
void RegisterDesignLqr(CLI::App& program, CommandLine& line);
void RegisterNode(CLI::App& program, CommandLine& line);
void RegisterDoctor(CLI::App& program, CommandLine& line);
void RegisterFrame(CLI::App& program, CommandLine& line);
void RegisterLinkDump(CLI::App& program, CommandLine& line);
void RegisterProtocol(CLI::App& program, CommandLine& line);
void RegisterIntegrity(CLI::App& program, CommandLine& line);
void RegisterManual(CLI::App& program, CommandLine& line);  // after all others, which its pages describe

}  // namespace tiltproof::harness
