#include "harness/cli/shared_options.h"

#include <CLI/CLI.hpp>
#include <utility>

#include "harness/cli/client_flag.h"

namespace tiltproof::harness {

void AddClients(CLI::App& command, std::vector<std::string>& clients, const std::string& more) {
  command.add_option("--client", clients, ClientHelp() + (more.empty() ? "" : "\n" + more))
      ->allow_extra_args(false);
}

std::string NamesNoBuild(const std::string& name) { return name.empty() ? "names no build" : ""; }

void AddFirmware(CLI::App& command, std::string& build) {
  command
      .add_option("--firmware", build,
                  "Every client flies this build of the firmware (paper, tolerant, ...) instead of what the "
                  "scenario says, and `expect` is that of this build")
      ->type_name("NAME")
      ->check(NamesNoBuild);
}

void AddBus(CLI::App& command, int& domain, std::string& interface, std::vector<std::string>& peers) {
  command.add_option("--domain", domain, "DDS domain (default: the first free one; attached nodes: 1)")
      ->check(CLI::Range(1, 230));
  command.add_option("--interface", interface,
                     "Network interface to other hosts (default: only this machine)");
  command.add_option("--peers", peers, "Hosts to look for where multicast does not reach")->delimiter(',');
}

void AddSeed(CLI::App& command, std::optional<std::uint64_t>& seed, const std::string& help) {
  command.add_option("--seed", seed, help)->check(CLI::Range(std::uint64_t{0}, kSeedMax));
}

void AddJobs(CLI::App& command, int& jobs_count) {
  command.add_option("-j", jobs_count, "Worker processes")->check(CLI::Range(1, 1024));
}

void AddFormat(CLI::App& command, std::string& format, const std::string& help) {
  command.add_option("--format", format, help)
      ->check(CLI::IsMember({"human", "jsonl"}))
      ->capture_default_str();
}

void AddPort(CLI::App& command, const std::string& name, std::optional<int>& port, PortNumbers numbers,
             const std::string& help) {
  command.add_option(name, port, help)
      ->type_name("PORT")
      ->expected(0, 1)
      ->default_str(std::to_string(numbers.usual))
      ->check(CLI::Range(numbers.least, 65535));
}

void AddSearch(CLI::App& command, SearchOptions& options) {
  command
      .add_option("--tolerance", options.tolerance,
                  "How exact a limit is, as a share of its distance from harmless")
      ->check(CLI::Range(1e-6, 0.5))
      ->capture_default_str();
  command
      .add_option("--repeats", options.repeat_count,
                  "Seeds per level: seed, seed+1, ...; a level is survived when all pass")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  AddSeed(command, options.seed, "Overrides the scenario's seed");
  AddJobs(command, options.jobs_count);
}

void SetAction(CLI::App& command, CommandLine& line, std::function<int()> action) {
  command.callback([&line, action = std::move(action)] { line.action = action; });
}

}  // namespace tiltproof::harness
