#include <CLI/CLI.hpp>

#include <memory>

#include "harness/cli/campaign_results.h"
#include "harness/cli/campaign_run.h"
#include "harness/cli/shared_options.h"

namespace tiltproof::harness {
namespace {

void AddDrawing(CLI::App& command, CampaignOptions& options) {
  command.add_option(
      "PATH", options.paths,
      "A campaign file; or scenario files, or folders of them, with faults of every type that the "
      "client can take");
  command.add_option("--runs", options.runs_count, "Number of flights (default: the file's, or 1000)")
      ->check(CLI::Range(std::int64_t{1}, kRunsMax));
  AddSeed(command, options.seed, "Of all draws (default: the file's, or 1)");
  AddClients(command, options.clients);
  command
      .add_option(
          "--firmware", options.firmware,
          "Builds of the firmware that fly the same draws: paper,tolerant (default: as the file or the "
          "scenarios say)")
      ->delimiter(',')
      ->check(NamesNoBuild)
      ->allow_extra_args(false);
}

void AddWork(CLI::App& command, CampaignOptions& options) {
  AddJobs(command, options.jobs_count);
  CLI::Option* out =
      command.add_option("--out", options.out, "Folder of the campaign's files")->capture_default_str();
  CLI::Option* resume =
      command
          .add_option("--resume", options.resume,
                      "Go on with the campaign in this folder: what it has is not flown again")
          ->type_name("DIR");
  resume->excludes(out);
  for (const char* other : {"PATH", "--runs", "--seed", "--client", "--firmware"})
    resume->excludes(command.get_option(other));
  CLI::Option* shard =
      command.add_option("--shard", options.shard, "Fly only part K of N equal parts of the runs")
          ->type_name("K/N");
  resume->excludes(shard);
  command
      .add_option("--confirm", options.confirm,
                  "At the end fly the first failures of each way to fail, and what passed with the least "
                  "margin, with this client, too: qemu:IMAGE")
      ->type_name("CLIENT");
  command
      .add_option("--executor", options.executor,
                  "local: on this machine. slurm: in tasks on a cluster; sbatch's own options come from the "
                  "environment (SBATCH_PARTITION, SBATCH_TIMELIMIT)")
      ->check(CLI::IsMember({"local", "slurm"}))
      ->capture_default_str();
  command
      .add_option("--task-runs", options.task_runs,
                  "Runs of a task of Slurm, at least (default: 500, or a thousandth of all)")
      ->check(CLI::Range(std::int64_t{1}, kRunsMax));
  command.add_flag("--no-report", options.no_report, "Write no pages");
  command.add_flag("--no-progress", options.no_progress, "No progress on standard error");
}

int Begin(const CampaignOptions& options) {
  if (options.paths.empty() && options.resume.empty())
    throw UsageError("campaign: name a campaign file, scenarios, or a campaign to go on with (--resume DIR)");
  return FlyCampaign(options);
}

}  // namespace

void RegisterCampaign(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<CampaignOptions>();
  options->command = line.words;
  CLI::App* command = program.add_subcommand(
      "campaign", "Fly many scenarios with faults that are drawn at random, and gather how they fail");
  command->require_subcommand(0, 1);
  AddDrawing(*command, *options);
  AddWork(*command, *options);
  // Called after the callback of a command below it, whose action stands.
  command->callback([&line, options, command] {
    if (command->get_subcommands().empty()) line.action = [options] { return Begin(*options); };
  });

  const auto number = std::make_shared<std::uint64_t>();
  const CLI::Range is_number(std::int64_t{0}, kRunsMax - 1);
  CLI::App* show = command->add_subcommand(
      "show", "Fly one run of a campaign again, keep its files, and compare it with the database");
  show->add_option("DIR", options->resume, "Folder of the campaign")->required();
  show->add_option("RUN", *number, "Number of the run, from 0")->required()->check(is_number);
  show->add_flag("--no-report", options->no_report, "Write no report.html");
  SetAction(*show, line, [options, number] { return ShowCampaignRun(*options, *number); });

  CLI::App* task = command->add_subcommand(
      "task",
      "Fly one task of a campaign on a cluster, as Slurm does; it may be flown again, or twice at once");
  task->add_option("DIR", options->resume, "Folder of the campaign")->required();
  task->add_option("K", *number, "Number of the task, from 1")->required();
  AddJobs(*task, options->jobs_count);
  SetAction(*task, line, [options, number] { return FlyCampaignTask(*options, *number); });

  CLI::App* status = command->add_subcommand("status", "Print how far a campaign is");
  status->add_option("DIR", options->resume, "Folder of the campaign")->required();
  SetAction(*status, line, [options] { return CampaignStatus(options->resume); });

  RegisterCampaignResults(*command, line);
}

}  // namespace tiltproof::harness
