// The command line: the table of commands and options. CLI11 is slow to compile: only this file, named_command.cpp and
// command_table.cpp see it.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <functional>
#include <iostream>

#include "harness/cli/client_flag.h"
#include "harness/cli/command_table.h"
#include "harness/cli/commands.h"
#include "harness/cli/named_command.h"
#include "harness/client/debugger.h"
#include "harness/live/live_server.h"
#include "harness/report/results.h"
#include "harness/run/realtime/realtime_flight.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

int Main(int argc, char** argv) {
  CLI::App app{"tiltproof: a fault-injection test harness for flight-control firmware", "tiltproof"};
  app.set_help_flag("-h,--help", "Print this page");
  app.set_version_flag("--version", "tiltproof " + std::string(Version()), "Print the version");
  app.require_subcommand(1);
  std::function<int()> command;

  // A port whose number may be left out.
  const auto add_port = [](CLI::App* to, const char* name, std::optional<int>& port, const char* text,
                           int usual, int least) {
    to->add_option(name, port, text)
        ->type_name("PORT")
        ->expected(0, 1)
        ->default_str(std::to_string(usual))
        ->check(CLI::Range(least, 65535));
  };
  const auto add_bus_options = [](CLI::App* to, int& domain, std::string& interface,
                                  std::vector<std::string>& peers) {
    to->add_option("--domain", domain, "DDS domain (default: the first free one; attached nodes: 1)")
        ->check(CLI::Range(1, 230));
    to->add_option("--interface", interface, "Network interface to other hosts (default: only this machine)");
    to->add_option("--peers", peers, "Hosts to look for where multicast does not reach")->delimiter(',');
  };

  const auto add_firmware = [](CLI::App* to, std::string& firmware) {
    to->add_option("--firmware", firmware,
                   "Every client flies this build of the firmware (paper, tolerant, ...) instead of what the "
                   "scenario says, and `expect` is that of this build")
        ->type_name("NAME")
        ->check([](const std::string& name) { return name.empty() ? "names no build" : ""; });
  };

  RunOptions run;
  run.command.assign(argv, argv + argc);
  auto* run_app = app.add_subcommand("run", "Fly scenarios and score them");
  run_app->add_option("PATH", run.paths, "Scenario files, or folders of them")->required();
  run_app->add_option("--client", run.clients, ClientHelp())->allow_extra_args(false);
  add_firmware(run_app, run.firmware);
  run_app
      ->add_option("--mode", run.mode, "How time passes: lockstep (virtual) or realtime (nodes, real ports)")
      ->check(CLI::IsMember({"lockstep", "realtime"}))
      ->capture_default_str();
  run_app
      ->add_option("--distributed", run.distributed,
                   "Lockstep with plant, link and firmware in processes of their own, over dds or socket")
      ->expected(0, 1)
      ->default_str("dds")
      ->check(CLI::IsMember({"dds", "socket"}));
  run_app->add_flag("--attach", run.attach, "Real time with nodes that run already (tiltproof node ...)");
  add_bus_options(run_app, run.domain, run.interface, run.peers);
  run_app->add_option("-k", run.expression,
                      "Only scenarios whose name or tags match, for example 'delay and not reference'");
  run_app->add_option("--tag", run.tag, "Only scenarios with this tag");
  run_app->add_option("--seed", run.seed, "Overrides every scenario's seed")
      ->check(CLI::Range(std::uint64_t{0}, kSeedMax));
  run_app->add_option("--repeat", run.repeat_count, "Fly each scenario N times, with seeds seed, seed+1, ...")
      ->check(CLI::Range(1, 1'000'000));
  run_app
      ->add_option("--watch", run.watch,
                   "Also record these variables of the emulated image, as watch_NAME; repeatable")
      ->delimiter(',')
      ->allow_extra_args(false);
  run_app->add_option("-j", run.jobs_count, "Worker processes")->check(CLI::Range(1, 1024));
  run_app->add_option("--out", run.out, "Parent of the run's own results folder")->capture_default_str();
  run_app->add_flag("--fail-fast", run.fail_fast,
                    "Start no further scenario after the first that is not green");
  run_app->add_flag("--last-failed", run.last_failed,
                    "Only flights that were not green in the last run (`latest` in --out), with their seeds");
  run_app->add_flag("--dry-run", run.dry_run, "Check and list what would be flown, and stop");
  run_app->add_flag("--strict", run.strict,
                    "Refuse everything when a scenario of a folder cannot be flown with this client");
  run_app->add_option("--format", run.format, "human, or jsonl: one JSON object per finished scenario")
      ->check(CLI::IsMember({"human", "jsonl"}))
      ->capture_default_str();
  run_app
      ->add_option(
          "--keep", run.keep,
          "Which flights keep their folder: all, failing (those that are not green), or verdicts (none)")
      ->check(CLI::IsMember({"all", "failing", "verdicts"}))
      ->capture_default_str();
  run_app
      ->add_option("--trace", run.trace,
                   "The file with a flight's trace: csv (trace.csv), packed (trace.packed, a ninth of its "
                   "size), or none")
      ->check(CLI::IsMember({"csv", "packed", "none"}))
      ->capture_default_str();
  add_port(
      run_app, "--gdb", run.gdb_port,
      "Wait for a debugger at power-on: at an emulated processor (QEMU's gdb server on this PORT of this "
      "machine), or a library",
      DebugStop::kPort, 1);
  run_app->add_option("--gdb-at", run.gdb_at_s, "Wait for it at this time of the flight instead, in s")
      ->check(CLI::Range(0.0, 14400.0));
  add_port(run_app, "--live", run.live_port,
           "Serve the report's page while the run is flown, on this PORT of 127.0.0.1 (0: any that is free). "
           "With --mode realtime it can also abort, and inject faults",
           kLivePort, 0);
  run_app->add_flag("--live-wait", run.live_waits, "Fly only when Start is pressed on that page");
  run_app->add_flag("--no-report", run.no_report, "Write no report.html");
  run_app->add_flag("--no-progress", run.no_progress, "No progress line on the terminal");
  run_app->footer(
      "Domain, tag and run id of a flight on the bus (in real time, or --distributed=dds) are in run.json, "
      "under "
      "its `bus`, while it flies, and in its first event; docs/distributed.md shows how to listen.");
  run_app->callback([&] { command = [&] { return RunCommand(run); }; });

  CheckOptions check;
  auto* check_app =
      app.add_subcommand("check", "Check scenario files, their models, formulas and faults, without flying");
  check_app->add_option("PATH", check.paths, "Scenario files, or folders of them")->required();
  const auto add_client = [&](CLI::App* to) {
    to->add_option("--client", check.clients, ClientHelp() + "\nIt says what `firmware` may be.")
        ->allow_extra_args(false);
    add_firmware(to, check.firmware);
  };
  add_client(check_app);
  check_app->callback([&] { command = [&] { return CheckCommand(check); }; });
  auto* list_app = app.add_subcommand("list", "List scenarios");
  auto* list_path = list_app->add_option("PATH", check.paths, "Scenario files, or folders of them");
  bool lists_signals = false;
  list_app->add_flag(
      "--signals", lists_signals,
      "The signals that formulas may name there, one per line; without PATH, those of a flight of the "
      "shipped vehicle");
  add_client(list_app);
  list_app->callback([&] {
    if (!lists_signals && check.paths.empty()) throw CLI::RequiredError(list_path->get_name());
    command = [&] { return lists_signals ? SignalsCommand(check) : ListCommand(check); };
  });
  std::filesystem::path file;
  auto* new_app = app.add_subcommand(
      "new", "Write a commented scenario to begin with, and beside it the schema that editors use");
  new_app->add_option("FILE", file, "The scenario to be written, NAME.yaml")->required();
  new_app->callback([&] { command = [&] { return NewCommand(file); }; });
  app.add_subcommand("schema", "Print the JSON Schema of scenario files, for editors")->callback([&] {
    command = SchemaCommand;
  });
  std::string fault;
  auto* faults_app = app.add_subcommand("faults", "Print the catalogue of faults (Markdown)");
  faults_app->add_option("NAME", fault, "Print only this fault");
  faults_app->callback([&] { command = [&] { return FaultsCommand(fault); }; });

  ReplayOptions replay;
  replay.program = argv[0];
  auto* replay_app = app.add_subcommand("replay", "Fly an old run again and compare the trace hashes");
  replay_app->add_option("RUN", replay.run, "A run's results folder, or one scenario's folder in it")
      ->required();
  replay_app->callback([&] { command = [&] { return ReplayCommand(replay); }; });
  auto* score_app = app.add_subcommand(
      "score", "Score an old run again from its files, and write its results.json and junit.xml anew");
  score_app->add_option("RUN", replay.run, "A run's results folder, or one scenario's folder in it")
      ->required();
  score_app->add_option("--format", replay.format, "human or jsonl")
      ->check(CLI::IsMember({"human", "jsonl"}))
      ->capture_default_str();
  score_app->callback([&] { command = [&] { return ScoreCommand(replay); }; });

  ReportOptions report;
  report.program = argv[0];
  auto* report_app =
      app.add_subcommand("report", "Write one page that shows runs, for a browser (report.html)");
  report_app
      ->add_option("RUN", report.runs,
                   "Results folders of runs, or of scenarios in them; or one of an envelope")
      ->required();
  report_app->add_option("--out", report.out,
                         "The file (default: report.html in the folder of the only RUN, otherwise here)");
  report_app->add_option("--baseline", report.baseline, "Also show what changed since this run");
  report_app->callback([&] { command = [&] { return ReportCommand(report); }; });

  ExportOptions exported;
  auto* export_app = app.add_subcommand("export", "Write flights as files of other tools: MCAP, or CSV");
  export_app->add_option("RUN", exported.run, "A run's results folder, or one scenario's folder in it")
      ->required();
  export_app
      ->add_option("--to", exported.to,
                   "mcap (Foxglove, PlotJuggler), or csv: tables (pandas, MATLAB), one file each")
      ->required()
      ->check(CLI::IsMember({"mcap", "csv"}));
  export_app->add_option("--out", exported.out,
                         "Of one flight: the .mcap file, or the folder of its tables; of several: the folder "
                         "that they go in, by name "
                         "(default: flight.mcap, or csv/, in each flight's folder)");
  export_app->footer(
      "What is in the files: docs/logs.md. Nothing is written over: remove old exports first.");
  export_app->callback([&] { command = [&] { return ExportCommand(exported); }; });

  CompareOptions compare;
  auto* compare_app = app.add_subcommand(
      "compare", "Compare the flights of two runs: traces, timing, verdicts (0 equal, 1 different)");
  compare_app->add_option("A", compare.a, "A run's results folder, or one scenario's folder in it")
      ->required();
  compare_app->add_option("B", compare.b, "Another one")->required();
  compare_app
      ->add_option("--tolerance", compare.tolerance,
                   "Largest difference allowed in a state of the vehicle, in its unit (m, rad, m/s, rad/s); "
                   "with --baseline the largest fall of a margin")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  compare_app->add_option("--format", compare.format, "human or jsonl")
      ->check(CLI::IsMember({"human", "jsonl"}))
      ->capture_default_str();
  bool outcomes = false, baseline = false;
  auto* baseline_flag = compare_app->add_flag(
      "--baseline", baseline,
      "A is the baseline: 1 when a verdict or a margin of B is worse, or a flight of A is missing, else 0");
  auto* anyway_flag = compare_app
                          ->add_flag("--anyway", compare.anyway,
                                     "Compare different flights, too (another seed, link, fault, ...), and "
                                     "say by which keys they differ")
                          ->excludes(baseline_flag);
  compare_app
      ->add_flag("--outcomes", outcomes,
                 "A is one flight without faults, B a campaign: class each flight of B as crashed, hung, "
                 "failed, detected, wrong_output or masked, and count them")
      ->excludes(baseline_flag)
      ->excludes(anyway_flag);
  compare_app->callback([&] {
    command = [&] {
      return baseline   ? BaselineCommand(compare)
             : outcomes ? OutcomesCommand(compare)
                        : CompareCommand(compare);
    };
  });

  const auto add_search_options = [](CLI::App* to, auto& search) {
    to->add_option("--tolerance", search.tolerance,
                   "How exact a limit is, as a share of its distance from harmless")
        ->check(CLI::Range(1e-6, 0.5))
        ->capture_default_str();
    to->add_option("--repeats", search.repeat_count,
                   "Seeds per level: seed, seed+1, ...; a level is survived when all pass")
        ->check(CLI::Range(1, 10'000))
        ->capture_default_str();
    to->add_option("--seed", search.seed, "Overrides the scenario's seed")
        ->check(CLI::Range(std::uint64_t{0}, kSeedMax));
    to->add_option("-j", search.jobs_count, "Worker processes")->check(CLI::Range(1, 1024));
  };
  MarginOptions margin;
  auto* margin_app =
      app.add_subcommand("margin", "Find the largest severity of a fault that a scenario survives");
  margin_app->add_option("SCENARIO", margin.scenario, "A scenario file")->required();
  margin_app->add_option("--fault", margin.fault, "The id of the fault")->required();
  margin_app->add_option("--parameter", margin.parameter,
                         "The number that is changed (default: the type's severity, or window_s, the length "
                         "of its window)");
  margin_app->add_option("--low", margin.low, "Search only above this value");
  margin_app->add_option("--high", margin.high, "Search only below this value");
  add_search_options(margin_app, margin);
  margin_app->add_option("--client", margin.clients, ClientHelp())->allow_extra_args(false);
  add_firmware(margin_app, margin.firmware);
  margin_app
      ->add_option("--format", margin.format, "human, or jsonl: one JSON object per level and the margin")
      ->check(CLI::IsMember({"human", "jsonl"}))
      ->capture_default_str();
  margin_app->callback([&] { command = [&] { return MarginCommand(margin); }; });

  EnvelopeOptions envelope;
  envelope.command.assign(argv, argv + argc);
  auto* envelope_app = app.add_subcommand(
      "envelope", "Find the margin of every fault that a firmware can take, over one scenario");
  envelope_app
      ->add_option("SCENARIO", envelope.scenario,
                   "A scenario file with a fault of type harness.null: the faults act in its place")
      ->required();
  envelope_app
      ->add_option("--types", envelope.types,
                   "Only fault types that match, for example 'sensor.*,frame.delay'")
      ->delimiter(',')
      ->allow_extra_args(false);
  envelope_app
      ->add_option("--firmware", envelope.firmware,
                   "Builds of the shipped firmware, side by side, all with one client: paper,tolerant")
      ->delimiter(',')
      ->allow_extra_args(false);
  envelope_app->add_option("--client", envelope.clients, ClientHelp() + "\nSeveral stand side by side.")
      ->allow_extra_args(false);
  envelope_app
      ->add_option("--map", envelope.map,
                   "Also fly pairs of levels of two types, each as TYPE or TYPE:PLACE (frame.drop:both); "
                   "without --types nothing else")
      ->type_name("TYPE1 TYPE2")
      ->expected(2);
  auto* envelope_out =
      envelope_app->add_option("--out", envelope.out, "Where envelope.json goes")->capture_default_str();
  envelope_app
      ->add_option("--resume", envelope.resume,
                   "Go on with the envelope.json in this folder: rows that it has are not flown again")
      ->type_name("DIR")
      ->excludes(envelope_out);
  add_search_options(envelope_app, envelope);
  envelope_app->add_flag("--keep", envelope.keep,
                         "At the end fly both sides of each margin once more, and keep these flights");
  envelope_app->add_flag("--no-report", envelope.no_report, "Write no envelope.html");
  envelope_app->add_flag("--no-progress", envelope.no_progress, "No progress on standard error");
  envelope_app->callback([&] { command = [&] { return EnvelopeCommand(envelope); }; });

  FuzzOptions fuzz;
  auto* fuzz_app = app.add_subcommand(
      "fuzz",
      "Send hostile frames to a firmware, and write each that breaks it as a scenario (1: found some)");
  fuzz_app->add_option("--client", fuzz.clients, ClientHelp())->allow_extra_args(false);
  fuzz_app->add_option("--protocol", fuzz.protocol, "What the firmware speaks: paper or provant")
      ->capture_default_str();
  add_firmware(fuzz_app, fuzz.firmware);
  auto* fuzz_time = fuzz_app->add_option("--time", fuzz.time_s, "How long, in s (default: 60)")
                        ->check(CLI::Range(0.1, 1e7));
  fuzz_app
      ->add_option("--runs", fuzz.runs_count,
                   "So many inputs instead; the same --seed and corpus then find the same, with any -j")
      ->check(CLI::Range(std::uint64_t{1}, kSeedMax))
      ->excludes(fuzz_time);
  fuzz_app->add_option("--seed", fuzz.seed, "Of all that is drawn at random")
      ->check(CLI::Range(std::uint64_t{0}, kSeedMax))
      ->capture_default_str();
  fuzz_app->add_option("-j", fuzz.jobs_count, "Worker processes")->check(CLI::Range(1, 1024));
  fuzz_app
      ->add_option("--out", fuzz.out,
                   "Where findings/, corpus/ and fuzz.json go; a corpus that is there is where it begins")
      ->capture_default_str();
  fuzz_app
      ->add_option("--format", fuzz.format, "human, or jsonl: one JSON object per finding, and one of all")
      ->check(CLI::IsMember({"human", "jsonl"}))
      ->capture_default_str();
  fuzz_app->add_flag("--no-progress", fuzz.no_progress, "No progress line on the terminal");
  fuzz_app->footer("How to build a firmware for it, and what a finding is: docs/fuzzing.md.");
  fuzz_app->callback([&] { command = [&] { return FuzzCommand(fuzz); }; });

  DesignLqrOptions design;
  auto* design_app = app.add_subcommand(
      "design-lqr", "Design the DLQR of a model: equilibrium, gain, spectral radius, delay margin");
  design_app->add_option("MODEL", design.model, "A model's name, or a path ending in .sdf")->required();
  design_app->add_option(
      "--csv", design.csv,
      "Write the gain (4x20 for the tilt-rotor): rows are thrusts, then servo torques; no header");
  design_app->add_option("--firmware-table", design.firmware_table,
                         "Print the gain as a binary32 table of that name for firmware/gain_tables.h");
  design_app->add_flag("--allow-invalid-inertia", design.allow_invalid_inertia,
                       "Go on with a physically impossible inertia");
  design_app->footer(
      "Columns of the gain, the states x of u = u_eq - K (x - x_ref): x y z (m), roll pitch yaw and the "
      "angles of the hinges (rad), the rates of all these in the same order (m/s, rad/s; Euler rates), "
      "then the integrals of the errors of x y z (m s) and yaw (rad s), by the trapezoidal rule with the "
      "present error, every 12 ms. firmware/examples/python flies that of the tilt-rotor.");
  design_app->callback([&] { command = [&] { return DesignLqrCommand(design); }; });

  NodeCommandOptions node;
  auto* node_app = app.add_subcommand("node", "Be one node of a distributed run, on this host");
  node_app->add_option("KIND", node.kind, "plant, link, client, base-station, joystick or monitor")
      ->required()
      ->check(CLI::IsMember({"plant", "link", "client", "base-station", "joystick", "monitor"}));
  node_app->add_option("--client", node.client,
                       "client: host, library:FILE, qemu[:ELF] or process:CMD; link: "
                       "serial:DEV[,REFDEV][,reset=HOW] of a board");
  node_app->add_option("--input", node.input, "joystick: /dev/input/js0, an event device, or a recording");
  node_app->add_option("--name", node.name, "Name on the bus (default: kind, host and process)");
  add_bus_options(node_app, node.domain, node.interface, node.peers);
  node_app->add_option("--xmit-loss", node.xmit_loss, "Lose this share of what is sent on the bus, 0 to 1")
      ->check(CLI::Range(0.0, 1.0));
  add_port(node_app, "--http", node.http_port,
           "monitor: also serve the report's page of the flight that it hears, on this PORT of 127.0.0.1 "
           "(0: any that is free)",
           kLivePort, 0);
  node_app->add_option(
      "--tag", node.tag,
      std::string("Hears and is heard only by nodes with this tag on the domain (default: ") + kAttachTag +
          ")");
  node_app
      ->add_option("--run", node.run,
                   "monitor: listen to the flights of the run in this folder, as results/latest, wherever on "
                   "the bus they are")
      ->type_name("FOLDER")
      ->excludes("--domain")
      ->excludes("--tag");
  // Options with which a harness starts its own nodes.
  node_app->add_option("--child", node.child)->group("");
  node_app->add_option("--lockstep", node.lockstep)->check(CLI::IsMember({"dds", "socket"}))->group("");
  node_app->footer(
      std::string("A node that you start is on the bus with the tag '") + kAttachTag +
      "', and meets the runs with --attach. A run that starts its nodes itself has a tag of its own: "
      "`tiltproof "
      "node monitor --run results/latest` listens to it. Domain, tag and run id of each flight are in "
      "run.json, under its `bus`, while it flies, and in its first event (docs/distributed.md).");
  node_app->callback([&] { command = [&] { return NodeCommand(node); }; });

  DoctorOptions doctor;
  auto* doctor_app = app.add_subcommand("doctor", "Check this machine: one line per check, with what to do");
  doctor_app->add_option("--client", doctor.client,
                         "Open these ports as a flight would: serial:DEV[,REFDEV]");
  doctor_app->add_option("--interface", doctor.interface, "Network interface to other machines' nodes");
  doctor_app->add_option("--format", doctor.format, "human, or jsonl: one JSON object per check")
      ->check(CLI::IsMember({"human", "jsonl"}))
      ->capture_default_str();
  doctor_app->add_option("--root", doctor.root, "Folder that holds dev and sys")->group("");
  doctor_app->callback([&] { command = [&] { return DoctorCommand(doctor); }; });

  std::string hex;
  auto* frame_app = app.add_subcommand("frame", "Encode and decode frames of the serial line");
  frame_app->require_subcommand(1);
  auto* encode_app =
      frame_app->add_subcommand("encode", "Print the frame that carries a payload, in hexadecimal");
  encode_app->add_option("HEX", hex, "The payload in hexadecimal")->required();
  encode_app->callback([&] { command = [&] { return FrameEncodeCommand(hex); }; });
  auto* decode_app =
      frame_app->add_subcommand("decode", "Decode raw bytes: one JSON line per frame or rejection");
  decode_app->add_option("FILE", file, "Raw bytes (default: standard input)");
  decode_app->callback([&] { command = [&] { return FrameDecodeCommand(file); }; });
  auto* dump_app = app.add_subcommand("link-dump", "Print a link.bin as decoded frames");
  dump_app->add_option("FILE", file, "link.bin of a scenario")->required();
  dump_app->callback([&] { command = [&] { return LinkDumpCommand(file); }; });
  // Called by the build.
  std::string date;
  auto* manual_app = app.add_subcommand("manual", "Write manual pages and completion")->group("");
  manual_app->add_option("DIR", file, "The folder")->required();
  manual_app->add_option("DATE", date, "Date of the pages")->required();
  manual_app->callback([&] { command = [&] { return ManualCommand(TableOf(app), file, date); }; });

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
  try {
    const int code = command();
    std::cout.flush();
    if (!std::cout) throw std::runtime_error("cannot write to standard output");
    return code;
  } catch (const UsageError& error) {
    // It names its place itself: file:line:col, or the flag.
    Print(stderr, "{}\n", TextLines(error.what()));
    return kExitUsage;
  } catch (const std::exception& error) {
    Print(stderr, "tiltproof: error: {}\n", TextLines(error.what()));
    return kExitError;
  }
}

}  // namespace
}  // namespace tiltproof::harness

// NOLINTNEXTLINE(bugprone-exception-escape): out of memory while the options are set up; nothing to tidy up.
int main(int argc, char** argv) { return tiltproof::harness::Main(argc, argv); }
