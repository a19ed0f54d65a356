// The program: its commands, and the errors that end it.
#include <CLI/CLI.hpp>
#include <exception>
#include <filesystem>
#include <iostream>

#include "harness/cli/commands.h"
#include "harness/cli/named_command.h"
#include "harness/report/results.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

constexpr auto kRegistrations = {
    RegisterRun,       RegisterCheck,  RegisterNew,     RegisterFaults, RegisterReplay,   RegisterScore,
    RegisterReport,    RegisterExport, RegisterCompare, RegisterMargin, RegisterEnvelope, RegisterCampaign,
    RegisterMinimise,  RegisterSearch, RegisterWhy,     RegisterFuzz,   RegisterSession,  RegisterVehicle,
    RegisterDesignLqr, RegisterNode,   RegisterDoctor,  RegisterFrame,  RegisterLinkDump, RegisterProtocol,
    RegisterIntegrity, RegisterManual};

// Returns the exit code.
int Act(const CommandLine& line) {
  try {
    const int code = line.action();
    std::cout.flush();
    if (!std::cout) throw std::runtime_error("cannot write to standard output");
    return code;
  } catch (const UsageError& error) {
    // It names its place itself: file:line:col, or the flag.
    Print(stderr, "{}\n", TextLines(error.what()));
    return kExitUsage;
  } catch (const std::filesystem::filesystem_error& error) {
    Print(stderr, "tiltproof: error: {}: {}\n", TextLines(error.path1().string()), error.code().message());
    return kExitError;
  } catch (const std::exception& error) {
    Print(stderr, "tiltproof: error: {}\n", TextLines(error.what()));
    return kExitError;
  }
}

int Main(int argc, char** argv) {
  CLI::App app{"tiltproof: a fault-injection test harness for flight-control firmware", "tiltproof"};
  app.set_help_flag("-h,--help", "Print this page");
  app.set_version_flag("--version", "tiltproof " + std::string(Version()), "Print the version");
  app.require_subcommand(1);
  CommandLine line{.words = {argv, argv + argc}, .action = {}};
  for (const auto& register_command : kRegistrations) register_command(app, line);

  std::vector<std::string> arguments(argv + 1, argv + argc);
  // `help run` is `run --help`.
  const bool asks = !arguments.empty() && arguments.front() == "help";
  if (asks) arguments.erase(arguments.begin());
  const NamedCommand named = FindCommand(app, arguments);
  if (!named.trouble.empty()) {
    Print(stderr, "{}\n", TextLines(named.trouble));
    return kExitUsage;
  }
  if (asks) return PrintHelp(named);
  if (arguments.empty()) {
    PrintHelp(named);
    return kExitUsage;  // a script whose command is empty has done nothing
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    return PrintHelp(named);
  } catch (const CLI::CallForVersion& version) {
    Print(stdout, "{}\n", version.what());
    return kExitGreen;
  } catch (const CLI::ParseError& error) {
    // CLI11's own codes are 100 and more; a mistake in the command line is 2.
    Print(stderr, "{}\n", TextLines(Mistake(named, error)));
    return kExitUsage;
  }
  return Act(line);
}

}  // namespace
}  // namespace tiltproof::harness

// NOLINTNEXTLINE(bugprone-exception-escape): out of memory while the options are set up; nothing to tidy up.
int main(int argc, char** argv) { return tiltproof::harness::Main(argc, argv); }
