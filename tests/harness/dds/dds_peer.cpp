// The other process in the tests of the bus: dds_peer MODE DOMAIN TAG [ARGUMENT...]. Speaks in lines.
#include <fcntl.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>

#include "harness/dds/bus.h"
#include "harness/dds/domain_slot.h"
#include "harness/dds/qos.h"
#include "harness/dds/topics.h"
#include "tests/harness/dds/condition.h"
#include "tests/harness/dds/peer_process.h"
#include "tests/harness/dds/random_messages.h"

namespace tiltproof::dds {
namespace {

struct Arguments {
  std::vector<std::string> all;
  const std::string& operator[](std::size_t i) const { return all.at(i); }
  int Number(std::size_t i) const { return std::atoi(all.at(i).c_str()); }
  BusConfig Config(double xmit_loss = 0) const {
    BusConfig config;
    config.domain = Number(1);
    config.tag = all.at(2);
    config.xmit_loss = xmit_loss;
    return config;
  }
};

template <class... Values>
void Say(const char* format, Values... values) {
  std::printf(format, values...);
  std::printf("\n");
  std::fflush(stdout);
}
void Say(const char* text) { Say("%s", text); }

// True if a line (or the end) of input comes within the time.
bool InputWithin(int limit_ms) {
  pollfd readable{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  return poll(&readable, 1, limit_ms) > 0;
}
std::string ReadLine() {
  std::string line;
  for (char c = 0; read(STDIN_FILENO, &c, 1) == 1 && c != '\n';) line += c;
  return line;
}

// SEED COUNT: COUNT random messages of each type and then the largest, until everybody has them.
int SendRandom(const Arguments& a) {
  Bus bus(a.Config());
  Random random(static_cast<std::uint64_t>(a.Number(3)));
  bool ok = true;
  const auto send = [&]<class T>() {
    Condition condition;
    Publisher<T> publisher(bus, condition.Waker());
    ok = condition.Wait([&] { return publisher.MatchedCount() == 1; }) && ok;
    for (int i = 0; i < a.Number(4); ++i) ok = publisher.Write(RandomMessage<T>(random, i)) && ok;
    ok = publisher.Write(T{}) && ok;
    ok = publisher.Write(LargestMessage<T>()) && ok;
    ok = publisher.WaitForAcks(20 * kNsPerS) && ok;
  };
#define TILTPROOF_SEND(T, ...) send.template operator()<T>();
  TILTPROOF_DDS_TOPICS(TILTPROOF_SEND)
#undef TILTPROOF_SEND
  Say(ok ? "done" : "failed");
  ReadLine();
  return 0;
}

// NODE [joystick]: a heartbeat every 50 ms, of a client or of a joystick in a run; on a line of input it hangs until the next.
int SendHeartbeats(const Arguments& a) {
  Bus bus(a.Config());
  Publisher<Heartbeat> publisher(bus);
  Heartbeat heartbeat;
  heartbeat.node_id = a[3];
  const bool is_joystick = a.all.size() > 4;
  heartbeat.kind = is_joystick ? NodeKind::kJoystick : NodeKind::kClient;
  if (is_joystick) heartbeat.run_id = "foreign";
  heartbeat.pid = getpid();
  Say("ready");
  for (;;) {
    ++heartbeat.sequence;
    publisher.Write(heartbeat);
    if (!InputWithin(50)) continue;
    if (ReadLine() == "leave") return 0;
    Say("hanging");
    ReadLine();
    Say("going on");
  }
}

// RUN: says which scenario is to be flown, and on a line of input that it is over.
int SendScenario(const BusConfig& config, const std::string& run) {
  Bus bus(config);
  Publisher<RunScenario> publisher(bus);
  RunScenario scenario;
  scenario.run_id = run;
  scenario.scenario_yaml = std::string(kDocumentBytesMax, 'y');
  if (!publisher.Write(scenario)) return 1;
  Say("ready");
  ReadLine();
  publisher.Retire(scenario);
  Say("retired");
  ReadLine();
  return 0;
}

// COUNT: prints the run of each scenario it gets, until it has COUNT.
int TakeScenarios(const BusConfig& config, int count_max) {
  Bus bus(config);
  Condition condition;
  Subscriber<RunScenario> subscriber(bus, condition.Waker());
  int count = 0;
  return condition.Wait([&] {
    for (const auto& scenario : subscriber.Take()) {
      Say("%s", scenario.run_id.c_str());
      ++count;
    }
    return count >= count_max;
  })
             ? 0
             : 1;
}

// COUNT LOSS_PERCENT CUT_MS: all four logs, each COUNT long, with a cut of the network amid.
int SendLogs(const Arguments& a) {
  const int count = a.Number(3);
  Bus bus(a.Config(a.Number(4) / 100.0));
  Condition condition;
  Publisher<SerialTap> taps(bus, condition.Waker());
  Publisher<FaultActivation> activations(bus, condition.Waker());
  Publisher<RunEvent> events(bus, condition.Waker());
  Publisher<Records> records(bus, condition.Waker());
  const bool matched = condition.Wait([&] {
    return taps.MatchedCount() == 1 && activations.MatchedCount() == 1 && events.MatchedCount() == 1 &&
           records.MatchedCount() == 1;
  });
  int refused = 0;
  std::int64_t slowest_us = 0;
  const auto write = [&](auto& publisher, const auto& message) {
    const auto begin = std::chrono::steady_clock::now();
    if (!publisher.Write(message)) ++refused;
    const auto took = std::chrono::steady_clock::now() - begin;
    slowest_us = std::max(slowest_us, std::chrono::duration_cast<std::chrono::microseconds>(took).count());
  };
  for (int i = 1; i <= count; ++i) {
    if (i == count / 2 && a.Number(5) > 0) bus.Partition(true, true, a.Number(5) * kNsPerMs);
    SerialTap tap{"run", "plant", i, std::vector<TapFrame>(5), {1, 2, 3}, {}};
    for (auto& frame : tap.frames) frame.bytes.assign(150, 0x55);
    write(taps, tap);
    write(activations,
          FaultActivation{"run", "plant", i, "bursts", i, "flipped", {{i, {1, 2}}}, {{i, {1, 3}}}});
    write(events, RunEvent{"run", "plant", i, i, "kind", "text"});
    write(records, Records{"run", "plant", i, i == count, std::vector<std::uint8_t>(2000, 9)});
    InputWithin(2);  // paced: nothing comes
  }
  bool acked = matched;
  acked = taps.WaitForAcks(20 * kNsPerS) && acked;
  acked = activations.WaitForAcks(20 * kNsPerS) && acked;
  acked = events.WaitForAcks(20 * kNsPerS) && acked;
  acked = records.WaitForAcks(20 * kNsPerS) && acked;
  Say("refused %d acked %d", refused, acked ? 1 : 0);
  Say("slowest write %lld us", static_cast<long long>(slowest_us));
  ReadLine();
  return 0;
}

int SendScenarioMode(const Arguments& a) { return SendScenario(a.Config(), a[3]); }
int TakeScenariosMode(const Arguments& a) { return TakeScenarios(a.Config(), a.Number(3)); }

// Takes tap messages until its input ends; at "?" it says up to which it has all, and how many came.
int TakeTaps(const Arguments& a) {
  Bus bus(a.Config());
  std::atomic<std::int64_t> count = 0;
  std::atomic<Subscriber<SerialTap>*> taps = nullptr;
  Subscriber<SerialTap> subscriber(bus, [&] {
    if (auto* s = taps.load()) count += static_cast<std::int64_t>(s->Take().size());
  });
  taps = &subscriber;
  count += static_cast<std::int64_t>(subscriber.Take().size());
  Say("ready");
  while (ReadLine() == "?") {
    Say("%lld of %lld", static_cast<long long>(count.load()),
        static_cast<long long>(subscriber.CompleteUpTo("run", "plant")));
  }
  return 0;
}

// Answers each step within the callback, the fastest way there is.
int EchoSteps(const Arguments& a) {
  Bus bus(a.Config());
  Condition condition;
  Publisher<StepResponse> responses(bus, condition.Waker());
  std::atomic<Subscriber<StepRequest>*> requests = nullptr;
  Subscriber<StepRequest> subscriber(bus, [&] {
    if (auto* s = requests.load()) {
      for (auto& r : s->Take()) responses.Write({r.run_id, r.node_id, r.sequence, std::move(r.payload)});
    }
  });
  requests = &subscriber;
  // An answer that goes out before the asker's subscriber is known here would be lost.
  if (!condition.Wait([&] { return responses.MatchedCount() == 1; })) return 1;
  Say("ready");
  ReadLine();
  return 0;
}

// PERIOD_MS COUNT: plant states at that pace; prints how many milliseconds that took.
int SendStates(const Arguments& a) {
  Bus bus(a.Config());
  Condition condition;
  Publisher<PlantState> states(bus, condition.Waker());
  condition.Wait([&] { return states.MatchedCount() == 1; });
  PlantState state;
  state.run_id = "run";
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < a.Number(4); ++i) {
    ++state.sequence;
    states.Write(state);
    InputWithin(a.Number(3));
  }
  states.Retire(state);
  const auto took = std::chrono::steady_clock::now() - begin;
  Say("%lld", static_cast<long long>(std::chrono::duration_cast<std::chrono::milliseconds>(took).count()));
  ReadLine();
  return 0;
}

// NODE: says under that name, on each line of input, that it has finished: the ack, the state and the event of the next
// sequence, and its heartbeat; at "dispose" it takes them back. Its first line is who it is on the bus.
int Speak(const Arguments& a) {
  Bus bus(a.Config());
  Publisher<Heartbeat> heartbeats(bus);
  Publisher<RunAck> acks(bus);
  Publisher<RunState> states(bus);
  Publisher<RunEvent> events(bus);
  Say(ToText(bus.participant()).c_str());
  RunAck ack{"run", a[3], 0, true, ToText(bus.participant()), {}};
  RunState state;
  state.run_id = "run";
  state.node_id = a[3];
  state.text = ack.text;
  Heartbeat heartbeat;
  heartbeat.node_id = a[3];
  for (std::string line = ReadLine(); !line.empty(); line = ReadLine()) {
    if (line == "dispose") {
      acks.Retire(ack);
      states.Retire(state);
      heartbeats.Retire(heartbeat);
    } else {
      ++ack.sequence;
      acks.Write(ack);
      states.Write(state);
      events.Write({"run", a[3], ack.sequence, 0, "kind", ack.text});
      heartbeats.Write(heartbeat);
    }
    Say("done");
  }
  return 0;
}

// An event as a node packs it (harness/run/record.h).
std::vector<std::uint8_t> RecordOfAnEvent() {
  std::string bytes(9, '\0');  // time; no client
  bytes += '\3';               // the fourth kind
  for (const std::string text : {"intruder", "an intruder's record"})
    bytes += static_cast<char>(text.size()) + std::string(7, '\0') + text;
  return {bytes.begin(), bytes.end()};
}

// An intruder in a run, which it finds by what everybody can hear. Until its input ends it says everything that a
// node or a harness could say, under the names of the others.
int Intrude(const Arguments& a) {
  Bus bus(a.Config());
  Subscriber<Heartbeat> heartbeats(bus);
  Publisher<Heartbeat> beats(bus);
  Publisher<RunScenario> scenarios(bus);
  Publisher<RunCommand> commands(bus);
  Publisher<RunAck> acks(bus);
  Publisher<RunState> states(bus);
  Publisher<PlantState> plant_states(bus);
  Publisher<Reference> references(bus);
  Publisher<FaultCommand> faults(bus);
  Publisher<SerialTap> taps(bus);
  Publisher<FaultActivation> activations(bus);
  Publisher<RunEvent> events(bus);
  Publisher<Records> records(bus);
  Say("ready");
  for (std::int64_t i = 1; !InputWithin(5); ++i) {
    heartbeats.Take();
    for (const auto& node : heartbeats.Nodes()) {
      if (node.participant == bus.participant() || node.last.run_id.empty()) continue;
      const std::string &run = node.last.run_id, &name = node.last.node_id;
      const std::int64_t sequence = 1'000'000 + i;
      // A second one of its kind and name, that lives and then dies.
      auto beat = node.last;
      beat.sequence = i;
      if (i % 20 < 10) beats.Write(beat);
      if (i % 40 == 39) beats.Retire(beat);
      scenarios.Write({run, "name: intruder", {name}, {ToText(bus.participant())}});
      for (std::int64_t command = 1; command < 8; ++command)
        acks.Write({run, name, command, command % 2 == 0, "an intruder's answer", {}});
      for (const auto verb : {Verb::kStop, Verb::kRelease}) commands.Write({run, "", sequence, verb, {}});
      RunState state;
      state.run_id = run;
      state.node_id = name;
      state.origin_ns = 1;
      state.text = "an intruder's word";
      for (const auto* reason : {"firmware_crashed", "diverged"}) {
        state.phase = i % 2 == 0 ? Phase::kFailed : Phase::kFinished;
        state.end_reason = reason;
        states.Write(state);
      }
      plant_states.Write({run, sequence, 3600 * kNsPerS, {}, {}});
      references.Write({run, name, sequence, 0, {100, 100, 100, 0, 0, 0, 0}});
      faults.Write({run, name, sequence, "intruder", "dds.partition", {}, 3600 * kNsPerS});
      faults.Write({run, name, sequence + 1, "intruder", "clock.jump", {{"jump_ms", 1e6}}, 0});
      faults.Write({run, name, sequence + 2, "intruder", "clock.drift", {{"ppm", 5e5}}, 0});
      taps.Write({run, name, sequence, {{1, 0, true, {1, 2, 3}, {}}}, {1}, {1}});
      activations.Write({run, name, sequence, "intruder", 1, "an intruder's", {}, {}});
      events.Write({run, name, sequence, 1, "intruder", "an intruder's event"});
      records.Write({run, name, 1, true, {1, 2, 3}});
      records.Write({run, name, sequence, i % 2 == 0, RecordOfAnEvent()});
    }
  }
  return 0;
}

// RunEvents without pause, for tests of coming and going.
int SendEvents(const Arguments& a) {
  Bus bus(a.Config());
  Publisher<RunEvent> events(bus);
  Publisher<PlantState> states(bus);
  Say("ready");
  for (std::int64_t i = 1; !InputWithin(0); ++i) {
    PlantState state;
    state.run_id = "run";
    state.sequence = i;
    states.Write(state);
    if (i < 2000) events.Write({"run", "plant", i, i, "kind", "text"});
  }
  return 0;
}

int TakeSlot(const Arguments&) {
  const DomainSlot slot;
  Say("%d", slot.domain());
  ReadLine();
  return 0;
}

// True if this process now has a network of its own, and may configure it.
bool EnterNetworkOfItsOwn() {
  const auto user = std::to_string(getuid());
  const auto group = std::to_string(getgid());
  if (unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return false;
  std::ofstream("/proc/self/setgroups") << "deny";
  std::ofstream("/proc/self/uid_map") << "0 " << user << " 1";
  std::ofstream("/proc/self/gid_map") << "0 " << group << " 1";
  return true;
}

// A machine with nothing but loopback: first down, then up.
int LoopbackOnly(const Arguments& a) {
  if (!EnterNetworkOfItsOwn()) {
    Say("not permitted");
    return 0;
  }
  try {
    const Bus bus(a.Config());
    Say("came up without a network");
  } catch (const std::runtime_error& error) {
    Say("%s", error.what());
  }
  const int control = socket(AF_INET, SOCK_DGRAM, 0);
  ifreq request{};
  std::snprintf(request.ifr_name, sizeof request.ifr_name, "lo");
  request.ifr_flags = IFF_UP | IFF_RUNNING;
  if (ioctl(control, SIOCSIFFLAGS, &request) != 0) return 1;
  PeerProcess other({"send_scenario", a[1], a[2], "lonely"});
  return TakeScenarios(a.Config(), 1);
}

// multicast|peers: two hosts with a cable between them. Without multicast they know each other by address.
int TwoHosts(const Arguments& a) {
  const bool multicast = a[3] == "multicast";
  const auto configure = [multicast](const std::string& name, const std::string& address) {
    return std::system(("ip addr add " + address + "/24 dev " + name + " && ip link set " + name +
                        " multicast " + (multicast ? "on" : "off") + " up")
                           .c_str()) == 0;
  };
  const auto config = [&](const std::string& interface, const std::string& other) {
    auto result = a.Config();
    result.interface = interface;
    if (!multicast) result.peers = {other};
    return result;
  };
  std::array<int, 2> to_parent{};
  std::array<int, 2> to_child{};
  if (!EnterNetworkOfItsOwn() || std::system("command -v ip >/dev/null") != 0 ||
      pipe(to_parent.data()) != 0 || pipe(to_child.data()) != 0) {
    Say("not permitted");
    return 0;
  }
  char byte = 0;
  const auto child = fork();
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (unshare(CLONE_NEWNET) != 0 || write(to_parent[1], &byte, 1) != 1 ||
        read(to_child[0], &byte, 1) != 1 || !configure("right", "10.77.0.2"))
      _exit(1);
    _exit(TakeScenarios(config("right", "10.77.0.1"), 1));
  }
  if (read(to_parent[0], &byte, 1) != 1 ||
      std::system(("ip link add left type veth peer name right netns " + std::to_string(child)).c_str()) !=
          0) {
    Say("not permitted");
    return 0;
  }
  if (!configure("left", "10.77.0.1") || write(to_child[1], &byte, 1) != 1) return 1;
  return SendScenario(config("left", "10.77.0.2"), a[4]);
}

int Main(const Arguments& arguments) {
  const std::map<std::string, int (*)(const Arguments&)> modes{{"send_random", SendRandom},
                                                               {"heartbeat", SendHeartbeats},
                                                               {"send_scenario", SendScenarioMode},
                                                               {"take_scenarios", TakeScenariosMode},
                                                               {"send_logs", SendLogs},
                                                               {"take_taps", TakeTaps},
                                                               {"echo_steps", EchoSteps},
                                                               {"send_states", SendStates},
                                                               {"send_events", SendEvents},
                                                               {"speak", Speak},
                                                               {"intrude", Intrude},
                                                               {"take_slot", TakeSlot},
                                                               {"two_hosts", TwoHosts},
                                                               {"loopback_only", LoopbackOnly}};
  return modes.at(arguments[0])(arguments);
}

}  // namespace
}  // namespace tiltproof::dds

int main(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  alarm(120);
  try {
    return tiltproof::dds::Main({std::vector<std::string>(argv + 1, argv + argc)});
  } catch (const std::exception& error) {
    std::printf("%s\n", error.what());
    return 1;
  }
}
