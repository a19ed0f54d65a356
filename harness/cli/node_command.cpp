#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <memory>

#include "harness/cli/client_flag.h"
#include "harness/cli/live_page.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/cli/watch_targets.h"
#include "harness/live/live_server.h"
#include "harness/node/joystick_input.h"
#include "harness/node/roles.h"
#include "harness/run/introduction.h"
#include "harness/run/realtime/realtime_flight.h"
#include "harness/run/remote/serve.h"
#include "harness/run/run_id.h"
#include "harness/terminal/lines.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

struct NodeCommandOptions {
  std::string kind;
  std::string name;
  std::string client;  // of client and link nodes
  std::string id;      // the same, of several clients; or of a line
  std::string cable;   // the same, on two hosts; of a line, both ends
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

// The descriptor that a harness passes to the processes of a distributed lockstep flight.
constexpr int kLockstepSocket = 3;

dds::NodeKind KindNamed(const std::string& kind) {
  using dds::NodeKind;
  for (const NodeKind node : {NodeKind::kPlant, NodeKind::kLink, NodeKind::kClient, NodeKind::kBaseStation,
                              NodeKind::kJoystick, NodeKind::kMonitor, NodeKind::kLine}) {
    std::string name(Name(node));
    std::replace(name.begin(), name.end(), '_', '-');
    if (name == kind) return node;
  }
  throw UsageError(fmt::format("KIND {}: no such node", kind));
}

// The participant of the harness that started this node.
dds::Participant HarnessOf(const NodeCommandOptions& options) {
  const auto harness = dds::ParticipantNamed(options.child);
  if (!harness) throw UsageError(fmt::format("--child {}: no participant of DDS", options.child));
  return *harness;
}

// The role of a client node. Throws UsageError.
MakeRole RoleOf(const ClientSpec& client) {
  if (std::holds_alternative<HostLibrary>(client)) return MakeLibraryRole;
  if (std::holds_alternative<Program>(client)) return MakeCommandRole;
  if (std::holds_alternative<EmulatedImage>(client)) return MakeEmulatorRole;
  if (std::holds_alternative<LockstepProgram>(client))
    throw UsageError(fmt::format(
        "--client {}: it flies in lockstep only, where no node is started by hand: give it to `run`",
        ToText(client)));
  throw UsageError(
      fmt::format("--client {}: a board has no client node; give this to the link node", ToText(client)));
}

int ServeLockstep(const NodeCommandOptions& options) {
  std::optional<dds::Bus> bus;
  std::unique_ptr<Channel> channel;
  if (options.lockstep == "socket") {
    // Another program in this process's place would keep it open.
    fcntl(kLockstepSocket, F_SETFD, FD_CLOEXEC);
    channel = MakeUnixChannel(kLockstepSocket);
  } else {
    bus.emplace(LockstepBus(options.domain, options.tag));
    Introduce(bus->participant());
    channel = MakeDdsChannel(*bus, options.tag, options.name, HarnessOf(options));
  }
  if (options.kind == "plant") {
    ServePlant(*channel, LoadAnnounced);
  } else if (options.kind == "link") {
    ServeLine(*channel, LoadAnnounced);
  } else {
    ServeClient(*channel, LoadAnnounced);
  }
  return kExitGreen;
}

// With a page, or without.
int Monitor(const NodeOptions& node, const NodeCommandOptions& options) {
  const FindWatchTarget target =
      options.run.empty() ? WatchTargetAt({.domain = node.bus.domain, .tag = node.bus.tag, .run_id = {}})
                          : WatchTargetOfRun(options.run);
  std::unique_ptr<LiveProcess> live;
  if (options.http_port) live = ServeMonitor(*options.http_port, node.bus, target);
  return RunMonitor(node, target);
}

// Prints where a node waits that a user has started.
void TellWhere(const NodeOptions& node, const std::string& kind) {
  const dds::BusConfig& bus = node.bus;
  std::string text = fmt::format("tiltproof: {} node '{}' listens on domain {} with the tag '{}', {}", kind,
                                 node.name, bus.domain, bus.tag,
                                 bus.interface.empty() ? "on this machine only" : "on " + bus.interface);
  if (!bus.peers.empty()) text += fmt::format(", and looks for {}", fmt::join(bus.peers, ", "));
  if (node.kind != dds::NodeKind::kMonitor)
    text += "; `tiltproof run ... --mode realtime --attach` finds it there";
  PrintLine(stderr, 0, text);
}

// Throws UsageError for a flag that this kind of node does not have.
void CheckFlags(const NodeCommandOptions& options) {
  const bool takes_client = options.kind == "client" || options.kind == "link";
  if (!options.client.empty() && !takes_client)
    throw UsageError(fmt::format("--client: a {} node has none", options.kind));
  const bool is_line = options.kind == "line";
  if (!options.id.empty() && !takes_client && !is_line)
    throw UsageError(fmt::format("--id: a {} node serves all clients", options.kind));
  if (options.id.empty() && is_line)
    throw UsageError("--id is missing: the id of the line in the scenario's `lines`");
  if (!options.cable.empty() && !takes_client && !is_line)
    throw UsageError(fmt::format("--cable: a {} node has none", options.kind));
  if (options.http_port && options.kind != "monitor")
    throw UsageError(fmt::format("--http: a {} node has no page; a monitor has one", options.kind));
  if (!options.run.empty() && options.kind != "monitor")
    throw UsageError(fmt::format("--run: a {} node has none; a monitor has one", options.kind));
  if (!options.input.empty() && options.kind != "joystick")
    throw UsageError(fmt::format("--input: a {} node has none", options.kind));
}

// A link node has none of the board's lines to others. Throws UsageError.
void RefuseLines(const SerialBoard& board) {
  if (board.line_devices.empty()) return;
  const std::string& line = board.line_devices.begin()->first;
  throw UsageError(
      fmt::format("a link node has no line to another board: give the device of '{0}' to `tiltproof node "
                  "line --id {0} --cable DEV,DEV`",
                  line));
}

// The ends of the cables that this node has. Throws UsageError.
SerialBoard CableOf(const NodeCommandOptions& options, const std::optional<ClientSpec>& client) {
  const bool has_ports =
      client && (std::holds_alternative<HostLibrary>(*client) || std::holds_alternative<Program>(*client));
  if (options.kind == "client" && !has_ports)
    throw UsageError(
        fmt::format("--cable: --client {} has no serial ports of its own; host, library:FILE and "
                    "process:CMD have",
                    options.client));
  if (options.kind == "link" && client)
    throw UsageError("--cable: --client serial:DEV[,REFDEV] names the cables of a link node already");
  try {
    auto cable = std::get<SerialBoard>(ParseClient("serial:" + options.cable));
    if (options.kind == "link") RefuseLines(cable);
    if (cable.reset.empty()) return cable;
  } catch (const ClientMistake&) {
  }
  throw UsageError(
      fmt::format("--cable {}: must be DEVICE or DEVICE,DEVICE{}", options.cable,
                  options.kind == "client" ? ", then ,LINE=DEVICE for each line to another board" : ""));
}

// The devices at the ends of a line; empty for an end of which the node makes the port. Throws UsageError.
std::array<std::string, 2> EndsOf(const std::string& cable) {
  std::array<std::string, 2> ends = {cable, ""};
  if (const std::size_t comma = cable.find(','); comma != cable.npos)
    ends = {cable.substr(0, comma), cable.substr(comma + 1)};
  for (std::string& end : ends) {
    if (end.empty() || end.find(',') != end.npos)
      throw UsageError(
          fmt::format("--cable {}: must be DEVICE,DEVICE, one for each end of the line in the order of "
                      "`between`, with - for a client node without cables",
                      cable));
    if (end == "-") end.clear();
  }
  return ends;
}

int NodeCommand(const NodeCommandOptions& options) {
  if (!options.lockstep.empty()) return ServeLockstep(options);
  NodeOptions node;
  node.kind = KindNamed(options.kind);
  node.name =
      options.name.empty() ? fmt::format("{}-{}-{}", options.kind, HostName(), getpid()) : options.name;
  node.bus = {.domain = options.domain == 0 ? kAttachDomain : options.domain,
              .tag = options.tag.empty() ? kAttachTag : options.tag,
              .interface = options.interface,
              .peers = options.peers,
              .xmit_loss = options.xmit_loss};
  if (!options.child.empty()) node.harness = HarnessOf(options);
  node.id = options.id;
  node.load = LoadAnnounced;

  CheckFlags(options);

  MakeRole make_role;
  switch (node.kind) {
    case dds::NodeKind::kPlant:
      make_role = MakePlantRole;
      break;
    case dds::NodeKind::kLink:
      make_role = MakeLinkRole;
      if (!options.client.empty()) {
        node.client = ReadClientFlag(options.client);
        if (!std::holds_alternative<SerialBoard>(*node.client))
          throw UsageError(
              fmt::format("--client {}: a link node takes serial:DEV[,REFDEV], the cables to a board; "
                          "other clients are nodes of their own",
                          options.client));
        RefuseLines(std::get<SerialBoard>(*node.client));
      }
      break;
    case dds::NodeKind::kClient:
      node.client = ReadClientFlag(options.client.empty() ? "host" : options.client);
      CheckFirmwareFile(*node.client);
      make_role = RoleOf(*node.client);
      break;
    case dds::NodeKind::kLine:
      make_role = MakeLineRole;
      if (!options.cable.empty()) node.end_devices = EndsOf(options.cable);
      break;
    case dds::NodeKind::kBaseStation:
      make_role = MakeBaseStationRole;
      break;
    case dds::NodeKind::kJoystick:
      if (options.input.empty())
        throw UsageError("--input is missing: the joystick's device (/dev/input/js0), or a recording");
      // A node may wait long for its first flight; what is wrong with the device is told now.
      try {
        OpenJoystick(options.input);
      } catch (const std::runtime_error& error) {
        throw UsageError(fmt::format("--input: {}", error.what()));
      }
      node.joystick_source = options.input;
      make_role = MakeJoystickRole;
      break;
    case dds::NodeKind::kMonitor:
      if (options.run.empty()) TellWhere(node, options.kind);
      return Monitor(node, options);
    case dds::NodeKind::kHarness:
      ThrowBrokenInvariant("a kind of node that a user may start");
  }
  if (!options.cable.empty() && node.kind != dds::NodeKind::kLine) node.cable = CableOf(options, node.client);
  if (options.child.empty()) TellWhere(node, options.kind);
  return RunNode(node, make_role);
}

}  // namespace

void RegisterNode(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<NodeCommandOptions>();
  CLI::App* command = program.add_subcommand("node", "Be one node of a distributed run, on this host");
  command->add_option("KIND", options->kind, "plant, link, client, line, base-station, joystick or monitor")
      ->required()
      ->check(CLI::IsMember({"plant", "link", "client", "line", "base-station", "joystick", "monitor"}));
  command->add_option("--client", options->client,
                      "client: host, library:FILE, qemu[:ELF] or process:CMD; link: "
                      "serial:DEV[,REFDEV][,reset=HOW] of a board");
  command
      ->add_option(
          "--id", options->id,
          "client, link: the id of the client in scenarios with several; each has both nodes; line: the "
          "id of the line between two clients")
      ->type_name("ID");
  command
      ->add_option(
          "--cable", options->cable,
          "client, link: this node's ends of the serial cables between the two, on two hosts: main line, "
          "line for references, and of a client LINE=DEV for each line to another; line: DEV,DEV, the cables "
          "to its ends, with - for a client node without cables")
      ->type_name("DEV[,REFDEV]");
  command->add_option("--input", options->input, "joystick: /dev/input/js0, an event device, or a recording");
  command->add_option("--name", options->name, "Name on the bus (default: kind, host and process)");
  AddBus(*command, options->domain, options->interface, options->peers);
  command->add_option("--xmit-loss", options->xmit_loss, "Lose this share of what is sent on the bus, 0 to 1")
      ->check(CLI::Range(0.0, 1.0));
  AddPort(*command, "--http", options->http_port, {.usual = kLivePort, .least = 0},
          "monitor: also serve the report's page of the flight that it hears, on this PORT of 127.0.0.1 "
          "(0: any that is free)");
  command->add_option("--tag", options->tag,
                      std::string("Hears and is heard only by nodes with this tag on the domain (default: ") +
                          kAttachTag + ")");
  command
      ->add_option("--run", options->run,
                   "monitor: listen to the flights of the run in this folder, as results/latest, wherever on "
                   "the bus they are")
      ->type_name("FOLDER")
      ->excludes("--domain")
      ->excludes("--tag");
  // Options with which a harness starts its own nodes.
  command->add_option("--child", options->child)->group("");
  command->add_option("--lockstep", options->lockstep)->check(CLI::IsMember({"dds", "socket"}))->group("");
  command->footer(
      std::string("A node that you start is on the bus with the tag '") + kAttachTag +
      "', and meets the runs with --attach. A run that starts its nodes itself has a tag of its own: "
      "`tiltproof "
      "node monitor --run results/latest` listens to it. Domain, tag and run id of each flight are in "
      "run.json, under its `bus`, while it flies, and in its first event (docs/distributed.md).");
  SetAction(*command, line, [options] { return NodeCommand(*options); });
}

}  // namespace tiltproof::harness
