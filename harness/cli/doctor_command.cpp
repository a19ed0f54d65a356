// Boost 1.74's Asio uses std::exchange without its header.
#include <utility>
//
#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "harness/cli/client_flag.h"
#include "harness/cli/shared_options.h"
#include "harness/client/clocked_program.h"
#include "harness/client/firmware_files.h"
#include "harness/client/make_client.h"
#include "harness/client/program_process.h"
#include "harness/emulator/lockstep_self_test.h"
#include "harness/process/child_process.h"
#include "harness/process/realtime_rights.h"
#include "harness/report/json_text.h"
#include "harness/scenario/scenario.h"
#include "harness/scenario/shipped_protocols.h"
#include "harness/terminal/terminal.h"
#include "link/protocol.h"
#include "link/pty.h"
#include "link/serial_devices.h"
#include "link/serial_port.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

struct DoctorOptions {
  std::string client;     // serial:DEV[,REFDEV], or empty
  std::string interface;  // for nodes on several machines; or empty
  std::string format = "human";
  std::filesystem::path root = "/";  // before /dev and /sys: another folder is a simulated machine
};

namespace fs = std::filesystem;

constexpr std::int64_t kBaud = LinkSpec::kDefaultBaud;
// Time for which an adapter may hold bytes back, out of a scenario's delay margin.
constexpr int kLatencyTimerMax_ms = 1;
// Python 3.x that the module needs.
constexpr int kPythonMinor = 11;

enum class Status { kOk, kWarn, kFail };

struct Check {
  std::string name;
  Status status = Status::kOk;
  std::string text;    // what is
  std::string advice;  // what to do about it; empty when nothing
};
using Checks = std::vector<Check>;

std::string_view Name(Status status) {
  return status == Status::kOk ? "ok" : status == Status::kWarn ? "warn" : "FAIL";
}

// Devices by what they are, each with the lasting names that link to it.
std::map<fs::path, std::vector<std::string>> DevicesByTarget(const fs::path& root) {
  std::map<fs::path, std::vector<std::string>> devices;
  for (const auto& device : link::ListSerialDevices(root)) {
    std::error_code error;
    const fs::path target = fs::canonical(device, error);
    if (error) continue;
    auto& names = devices[target];
    if (fs::path(device) != target) names.push_back(device);
  }
  return devices;
}

Check CheckLatencyTimer(const fs::path& device, int latency_ms, const fs::path& root) {
  Check check{
      .name = "latency timer of " + device.string(), .text = fmt::format("{} ms", latency_ms), .advice = {}};
  if (latency_ms <= kLatencyTimerMax_ms) return check;
  check.status = Status::kWarn;
  check.text += fmt::format(
      ": the adapter holds received bytes back that long; the delay margin (a scenario's delay_margin_s) is "
      "{} ms in all",
      ToSeconds(Scenario{}.delay_margin_ns) * 1e3);
  check.advice = fmt::format(
      "`echo 1 | sudo tee {}`; for good, a line in /etc/udev/rules.d/99-ftdi.rules: ACTION==\"add\", "
      "SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{{latency_timer}}=\"1\"",
      link::LatencyTimerFile(device, root).string());
  return check;
}

// Without opening them: that resets many a board.
void CheckSerialDevices(const fs::path& root, Checks& checks) {
  const auto devices = DevicesByTarget(root);
  if (devices.empty())
    checks.push_back({.name = "serial devices",
                      .text = "none found (only `--client serial:DEV` needs one)",
                      .advice = {}});
  for (const auto& [device, names] : devices) {
    Check check{.name = "serial device " + device.string(), .text = "may be opened", .advice = {}};
    const auto holders = link::ProcessesHolding(device);
    if (access(device.c_str(), R_OK | W_OK) != 0) {
      check.status = Status::kWarn;
      check.text = "no permission to open it";
      check.advice = link::PermissionAdvice(device);
    } else if (!holders.empty()) {
      check.status = Status::kWarn;
      check.text = "held by process " + Text(holders);
      check.advice = "end it before flying with this device";
    }
    if (!names.empty()) check.text += fmt::format("; also {}", fmt::join(names, ", "));
    checks.push_back(std::move(check));
    if (const auto latency_ms = link::ReadLatencyTimer(device, root))
      checks.push_back(CheckLatencyTimer(device, *latency_ms, root));
  }
}

std::vector<std::string> ClientDevices(const std::string& client) {
  const ClientSpec spec = ReadClientFlag(client);
  const auto* board = std::get_if<SerialBoard>(&spec);
  if (board == nullptr)
    throw UsageError(fmt::format("--client {}: doctor looks at serial:DEV[,REFDEV] alone", client));
  std::vector<std::string> devices = {board->device};
  if (!board->reference_device.empty()) devices.push_back(board->reference_device);
  return devices;
}

// As a flight would open them: both at once. An emulator behind a socket may begin as soon as it is connected, so that
// it is only looked for.
void CheckClientDevices(const std::vector<std::string>& devices, Checks& checks) {
  boost::asio::io_context loop;
  std::vector<std::unique_ptr<link::SerialPort>> ports;
  for (const auto& device : devices) {
    Check check{.name = "client's " + device, .text = fmt::format("opens at {} baud", kBaud), .advice = {}};
    try {
      if (link::IsSocketName(device)) {
        if (const auto trouble = link::SocketTrouble(device)) throw std::runtime_error(*trouble);
        check.text = "a socket with a listening process";
        checks.push_back(std::move(check));
        continue;
      }
      ports.push_back(std::make_unique<link::SerialPort>(loop, device, kBaud));
    } catch (const std::runtime_error& error) {
      check.status = Status::kFail;
      check.text = error.what();
    }
    checks.push_back(std::move(check));
  }
}

Check CheckRealTime(const RealtimeRights& rights) {
  if (rights.fifo)
    return {.name = "real-time priority",
            .text = fmt::format("SCHED_FIFO {} granted", kRealtimePriority),
            .advice = {}};
  return {
      .name = "real-time priority",
      .status = Status::kWarn,
      .text = "not granted: flights in real time will be less punctual",
      .advice = fmt::format("a line `@dialout - rtprio {}` in /etc/security/limits.conf, then log out and in "
                            "again",
                            kRealtimePriority)};
}

Check CheckLockedMemory(const RealtimeRights& rights) {
  if (rights.locked_memory) return {.name = "locked memory", .text = "unlimited", .advice = {}};
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  return {
      .name = "locked memory",
      .status = Status::kWarn,
      .text = fmt::format("limited to {} KiB: a page fault may delay a flight in real time",
                          limit.rlim_cur / 1024),
      .advice =
          "a line `@dialout - memlock unlimited` in /etc/security/limits.conf, then log out and in again"};
}

Check CheckProcessors() {
  cpu_set_t usable;
  CPU_ZERO(&usable);
  const int count = sched_getaffinity(0, sizeof usable, &usable) == 0 ? CPU_COUNT(&usable) : 1;
  if (count >= 2) return {.name = "processors", .text = std::to_string(count), .advice = {}};
  return {.name = "processors",
          .status = Status::kWarn,
          .text = "one: plant, line and firmware wait for each other in real time",
          .advice = "fly in real time on a machine with 2 or more; lockstep does not mind"};
}

Check CheckGovernor(const fs::path& root) {
  std::set<std::string> governors;
  std::error_code error;
  for (fs::directory_iterator cpu(root / "sys/devices/system/cpu", error);
       !error && cpu != fs::directory_iterator(); cpu.increment(error)) {
    std::string governor;
    if (std::ifstream(cpu->path() / "cpufreq/scaling_governor") >> governor) governors.insert(governor);
  }
  if (governors.empty()) return {.name = "frequency governor", .text = "none to be seen here", .advice = {}};
  Check check{
      .name = "frequency governor", .text = fmt::format("{}", fmt::join(governors, ", ")), .advice = {}};
  if (governors == std::set<std::string>{"performance"}) return check;
  check.status = Status::kWarn;
  check.text += ": processors that sleep between periods wake late";
  check.advice = "`sudo cpupower frequency-set -g performance`";
  return check;
}

Check CheckInterface(const std::string& name) {
  Check check{.name = "network interface " + name, .status = Status::kFail, .text = {}, .advice = {}};
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) {
    check.text = fmt::format("cannot be asked for: {}", std::strerror(errno));
    return check;
  }
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(list, freeifaddrs);
  std::set<std::string> names;
  unsigned flags = 0;
  std::string address;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    names.insert(entry->ifa_name);
    if (entry->ifa_name != name) continue;
    flags |= entry->ifa_flags;
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in ip{};
    std::memcpy(&ip, entry->ifa_addr, sizeof ip);
    char text[INET_ADDRSTRLEN] = {};
    if (inet_ntop(AF_INET, &ip.sin_addr, text, sizeof text) != nullptr) address = text;
  }
  if (!names.contains(name)) {
    check.text = "there is none of that name";
    check.advice = fmt::format("this machine has {}", fmt::join(names, ", "));
  } else if ((flags & IFF_UP) == 0) {
    check.text = "it is down";
    check.advice = fmt::format("`sudo ip link set {} up`", name);
  } else if (address.empty()) {
    check.text = "it has no IPv4 address";
    check.advice = fmt::format(
        "`sudo ip address add 192.168.10.1/24 dev {}`, or set it up with your network manager", name);
  } else if ((flags & IFF_RUNNING) == 0) {
    check.status = Status::kWarn;
    check.text = fmt::format("up at {}, but nothing is connected to it", address);
    check.advice = "check the cable";
  } else if ((flags & (IFF_MULTICAST | IFF_LOOPBACK)) == 0) {
    check.status = Status::kWarn;
    check.text =
        fmt::format("up at {}, without multicast: other machines are not found by themselves", address);
    check.advice =
        fmt::format("`sudo ip link set {} multicast on`, or name them with --peers HOST,...", name);
  } else {
    check.status = Status::kOk;
    check.text = fmt::format("up at {}", address);
  }
  return check;
}

Check CheckPseudoTerminals() {
  try {
    boost::asio::io_context loop;
    const link::Pty pty(loop);
    return {.name = "pseudo-terminals", .text = "available", .advice = {}};
  } catch (const std::runtime_error& error) {
    return {.name = "pseudo-terminals", .status = Status::kFail, .text = error.what(), .advice = {}};
  }
}

Check CheckProgramSocket() {
  Check check{.name = "socket of programs", .text = "can be made", .advice = {}};
  try {
    ProgramProcess::TrySocket();
  } catch (const std::runtime_error& error) {
    check.status = Status::kWarn;
    check.text = fmt::format("{} (only `--client program:CMD` and clocked:CMD need it)", error.what());
    check.advice = "set TMPDIR to a folder of yours with a short path";
  }
  return check;
}

// Starts a program under it.
Check CheckVirtualClock() {
  Check check{.name = "virtual clock", .text = "works", .advice = {}};
  try {
    ClientHost host;
    host.transmit = [](Uart /*uart*/, BootTime now, std::span<const std::uint8_t> /*bytes*/) { return now; };
    host.log = [](BootTime /*now*/, std::string_view /*text*/) {};
    ClientSettings settings;
    settings.protocol = FindProtocol("paper");
    if (const auto mistake = ClockMistake("sleep")) throw std::runtime_error(*mistake);
    const auto client = MakeClient(LockstepProgram{"sleep 1", true}, settings, host);
    if (client->Start(BootTime()) == BootTime(kNsPerS)) return check;
    check.text = "it does not hold `sleep`";
  } catch (const std::exception& error) {
    check.text = error.what();
  }
  check.status = Status::kWarn;
  check.text += " (only `--client clocked:CMD` needs it)";
  check.advice = "fly such a program with --client process:CMD and --mode realtime";
  return check;
}

Check CheckPython() {
  Check check{.name = "python3", .text = {}, .advice = {}};
  try {
    constexpr int kTimeout_ms = 10'000;
    ChildProcess python({.command = {"python3", "-c", "import sys; print('%d.%d' % sys.version_info[:2])"},
                         .output = ChildSpec::kPipe,
                         .error = ChildSpec::kNull});
    pollfd ended{python.pidfd(), POLLIN, 0};
    poll(&ended, 1, kTimeout_ms);
    std::array<char, 64> buffer;
    const ssize_t count = read(python.output(), buffer.data(), buffer.size());
    check.text.assign(buffer.data(), count < 1 ? 0 : static_cast<std::size_t>(count) - 1);
    int minor = 0;
    if (check.text.starts_with("3.") && (minor = std::atoi(check.text.c_str() + 2)) >= kPythonMinor)
      return check;
    check.text = check.text.empty() ? "it does not run" : fmt::format("{} is too old", check.text);
  } catch (const std::runtime_error& error) {
    check.text = error.what();
  }
  check.status = Status::kWarn;
  check.text += fmt::format(" (only the Python module needs it, 3.{} or later)", kPythonMinor);
  check.advice = "`sudo apt-get install --no-install-recommends python3`";
  return check;
}

Check CheckEmulator() {
  Check check{.name = "emulator", .text = {}, .advice = {}};
  try {
    const std::string version = QemuVersion();
    check.text = fmt::format("qemu-system-arm {}", version);
    if (version.starts_with(std::string(kLockstepQemuRelease) + ".")) return check;
    check.status = Status::kWarn;
    check.text += fmt::format(": `--client qemu` flies with it in real time; lockstep needs {}.x",
                              kLockstepQemuRelease);
    check.advice = "fly with --mode realtime, or use the qemu-system-arm of Debian 12";
  } catch (const NoSuchProgram& error) {
    check.status = Status::kWarn;
    check.text = fmt::format("{} (only `--client qemu` needs it)", error.what());
    check.advice = "`sudo apt-get install --no-install-recommends qemu-system-arm`";
  } catch (const std::runtime_error& error) {
    check.status = Status::kWarn;
    check.text = fmt::format("{} (only `--client qemu` needs it)", error.what());
  }
  return check;
}

Check CheckLockstep() {
  Check check{.name = "emulator in lockstep", .text = "works", .advice = {}};
  try {
    TestLockstep(LockstepPlugin());
  } catch (const std::runtime_error& error) {
    check.status = Status::kWarn;
    check.text = error.what();
    check.advice = "fly `--client qemu` with --mode realtime";
  }
  return check;
}

// Checks the images that `--client qemu` flies when it names none.
Check CheckImages() {
  Check check{.name = "firmware images", .text = {}, .advice = {}};
  const fs::path folder = FirmwareFile(EmulatedImage{}, "paper", "paper").parent_path();
  std::map<std::string, int> counts;
  std::error_code error;
  for (fs::directory_iterator file(folder, error); !error && file != fs::directory_iterator();
       file.increment(error))
    if (const std::string name = file->path().filename(); file->path().extension() == ".elf")
      ++counts[name.substr(0, name.find('-'))];
  if (counts.contains("executive")) {
    check.text = fmt::format("executive: {}, freertos: {}, in {}", counts["executive"], counts["freertos"],
                             folder.string());
    if (counts["freertos"] == 0)
      check.text += "; those with FreeRTOS need a checkout of its kernel: ./setup --freertos";
    return check;
  }
  check.status = Status::kWarn;
  check.text = fmt::format("none in {} (only `--client qemu` without an image needs them)", folder.string());
  check.advice = HowToGetImages();
  return check;
}

void PrintCheck(const Check& check, bool jsonl) {
  if (jsonl) {
    const nlohmann::ordered_json line = {{"check", check.name},
                                         {"status", Name(check.status)},
                                         {"text", check.text},
                                         {"advice", check.advice}};
    Print(stdout, "{}\n", JsonLine(line));
  } else {
    Print(stdout, "{:<4}  {}: {}{}{}\n", Name(check.status), check.name, check.text,
          check.advice.empty() ? "" : "; do: ", check.advice);
  }
}

int DoctorCommand(const DoctorOptions& options) {
  Checks checks;
  const auto client_devices =
      options.client.empty() ? std::vector<std::string>{} : ClientDevices(options.client);
  checks.push_back(CheckProcessors());
  checks.push_back(CheckGovernor(options.root));
  const RealtimeRights rights = ProbeRealtimeRights();
  checks.push_back(CheckRealTime(rights));
  checks.push_back(CheckLockedMemory(rights));
  checks.push_back(CheckPseudoTerminals());
  checks.push_back(CheckInterface("lo"));
  if (!options.interface.empty() && options.interface != "lo")
    checks.push_back(CheckInterface(options.interface));
  checks.push_back(CheckEmulator());
  if (checks.back().status == Status::kOk) checks.push_back(CheckLockstep());
  checks.push_back(CheckImages());
  checks.push_back(CheckProgramSocket());
  checks.push_back(CheckVirtualClock());
  checks.push_back(CheckPython());
  CheckSerialDevices(options.root, checks);
  CheckClientDevices(client_devices, checks);
  for (const auto& check : checks) PrintCheck(check, options.format == "jsonl");
  const bool failed = std::any_of(checks.begin(), checks.end(),
                                  [](const Check& check) { return check.status == Status::kFail; });
  return failed ? kExitError : kExitGreen;
}

}  // namespace

void RegisterDoctor(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<DoctorOptions>();
  CLI::App* command =
      program.add_subcommand("doctor", "Check this machine: one line per check, with what to do");
  command->add_option("--client", options->client, "Open these ports as a flight would: serial:DEV[,REFDEV]");
  command->add_option("--interface", options->interface, "Network interface to other machines' nodes");
  AddFormat(*command, options->format, "human, or jsonl: one JSON object per check");
  command->add_option("--root", options->root, "Folder that holds dev and sys")->group("");
  SetAction(*command, line, [options] { return DoctorCommand(*options); });
}

}  // namespace tiltproof::harness
