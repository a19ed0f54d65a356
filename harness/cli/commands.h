// One function per command; each returns the process's exit code:
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

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
  std::string firmware;  // build that every scenario flies; empty: its own
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
int RunCommand(const RunOptions& options);

struct NodeCommandOptions {
  std::string kind;
  std::string name;
  std::string client;  // of client and link nodes
  std::string input;   // of joystick nodes
  int domain = 0;
  std::string tag;
  std::string interface;
  std::vector<std::string> peers;
  double xmit_loss = 0;
  std::string child;             // of a harness: that harness's participant; or empty
  std::string lockstep;          // "", "dds" or "socket": one part of a distributed lockstep flight
  std::optional<int> http_port;  // of a monitor's live page
  std::filesystem::path run;     // whose flights a monitor hears, in place of domain and tag
};
int NodeCommand(const NodeCommandOptions& options);

struct CheckOptions {
  std::vector<std::filesystem::path> paths;
  std::vector<std::string> clients;
  std::string firmware;  // as of RunOptions
};
int CheckCommand(const CheckOptions& options);
int ListCommand(const CheckOptions& options);
// The signals that formulas of these scenarios may name; without a path, those of a flight of the shipped vehicle.
int SignalsCommand(const CheckOptions& options);
int SchemaCommand();
int NewCommand(const std::filesystem::path& file);
// An empty name prints the whole catalogue.
int FaultsCommand(const std::string& name);

struct ReplayOptions {
  std::filesystem::path run;
  std::string program = "tiltproof";  // as it was called, for the commands that are printed
  std::string format = "human";
};
int ReplayCommand(const ReplayOptions& options);
int ScoreCommand(const ReplayOptions& options);

struct CompareOptions {
  std::filesystem::path a, b;
  double tolerance = 1e-3;
  std::string format = "human";
  bool anyway = false;  // compares different flights, too
};
int CompareCommand(const CompareOptions& options);
// --baseline: whether b got worse than a, in results alone. The tolerance is that of margins.
int BaselineCommand(const CompareOptions& options);
// --outcomes: a is the run of one flight, the reference.
int OutcomesCommand(const CompareOptions& options);

struct ReportOptions {
  std::vector<std::filesystem::path> runs;  // folders of runs, or of flights; or one of an envelope
  std::filesystem::path out;                // empty: report.html in the only run's folder, or here
  std::filesystem::path baseline;           // empty: none
  std::string program = "tiltproof";        // as it was called, for commands on the page
};
int ReportCommand(const ReportOptions& options);

struct ExportOptions {
  std::filesystem::path run;  // folder of a run, or of a flight
  std::string to;             // "mcap" or "csv"
  std::filesystem::path out;  // empty: in the folder of each flight
};
int ExportCommand(const ExportOptions& options);

struct MarginOptions {
  std::filesystem::path scenario;
  std::string fault;  // its id
  std::string parameter;
  std::optional<double> low, high;
  double tolerance = 0.01;
  int repeat_count = 5;
  std::optional<std::uint64_t> seed;
  std::vector<std::string> clients;
  std::string firmware;  // as of RunOptions
  int jobs_count = 1;
  std::string format = "human";
};
int MarginCommand(const MarginOptions& options);

struct EnvelopeOptions {
  std::filesystem::path scenario;
  std::vector<std::string> types;  // patterns; empty: every type
  std::vector<std::string> firmware;
  std::vector<std::string> clients;  // each is a column of its own
  std::vector<std::string> map;      // empty, or two
  double tolerance = 0.01;
  int repeat_count = 5;
  std::optional<std::uint64_t> seed;
  int jobs_count = 1;
  std::filesystem::path out = "results/envelope";
  std::filesystem::path resume;  // the folder of an envelope that was interrupted; or empty
  bool keep = false;             // the flights on both sides of each margin
  bool no_report = false;
  bool no_progress = false;
  std::vector<std::string> command;  // as typed
};
int EnvelopeCommand(const EnvelopeOptions& options);

struct FuzzOptions {
  std::vector<std::string> clients;
  std::string protocol = "paper";
  std::string firmware;                     // build; empty: the usual one
  std::optional<double> time_s;             // none: a minute
  std::optional<std::uint64_t> runs_count;  // inputs; instead of a time
  std::uint64_t seed = 1;
  int jobs_count = 1;
  std::filesystem::path out = "results/fuzz";
  std::string format = "human";
  bool no_progress = false;
};
int FuzzCommand(const FuzzOptions& options);

struct DesignLqrOptions {
  std::string model;
  std::filesystem::path csv;
  std::string firmware_table;
  bool allow_invalid_inertia = false;
};
int DesignLqrCommand(const DesignLqrOptions& options);

struct DoctorOptions {
  std::string client;     // serial:DEV[,REFDEV], or empty
  std::string interface;  // for nodes on several machines; or empty
  std::string format = "human";
  std::filesystem::path root = "/";  // before /dev and /sys: another folder is a simulated machine
};
int DoctorCommand(const DoctorOptions& options);

int FrameEncodeCommand(const std::string& hex);
// An empty path is standard input.
int FrameDecodeCommand(const std::filesystem::path& file);
int LinkDumpCommand(const std::filesystem::path& file);

struct CommandRow;
// Writes the manual pages of the program and of its commands, and completion for shells, into the folder. `date` is
// that of the pages, YYYY-MM-DD.
int ManualCommand(const CommandRow& program, const std::filesystem::path& folder, const std::string& date);

}  // namespace tiltproof::harness
