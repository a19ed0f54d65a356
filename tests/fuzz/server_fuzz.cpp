// The whole server: line, receiver, checks and plant hear whatever clients can send. It answers requests with whole
// frames, its inputs keep the vehicle's limits, its rows keep their order, and its state is finite until it says that
// the vehicle is lost.
//
// Input: a script (frame_script.h). Its choice is the scenario; the line of a step is the client.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/scenario/reader.h"
#include "link/frame.h"
#include "tests/fuzz/frame_script.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch.h"

namespace {

using namespace tiltproof::harness;
using tiltproof::BootTime;
using tiltproof::TimeNs;
using tiltproof::testing::Bytes;
using tiltproof::testing::Draw;
using tiltproof::testing::FrameScript;
using tiltproof::testing::Require;
namespace faults = tiltproof::faults;
namespace link = tiltproof::link;

constexpr TimeNs kFlightMax_ns = 2 * tiltproof::kNsPerS;

// Each dialect, each frame of angular rates, several clients, and faults on all that the server owns. The place in
// this list is what the script chooses.
constexpr std::array kScenarios = {
    "",
    "link: {protocol: provant}\nangular_rates: body\n",
    "clients: [{id: a}, {id: b}]\narbiter: {type: single, client: b}\nangular_rates: euler\n",
    R"(faults:
  - {id: bits, type: wire.bit_error, target: both, parameters: {ber: 0.002}}
  - {id: lost, type: frame.drop, target: to_plant, start_s: 0.1, parameters: {probability: 0.1}}
)",
    R"(faults:
  - {id: wrong-x, type: sensor.bias, when: "z_m > 0.9", edge: rising, parameters: {signal: x_m, offset: 0.2}}
  - {id: slow, type: frame.delay, target: to_client, when: "speed_m_s > 0.5", parameters: {mean_ms: 5}}
  - {id: weak, type: actuator.loss_of_effectiveness, after: {fault: wrong-x, delay_s: 0.05}, parameters: {actuator: f_r, factor: 0.9}}
)",
    R"(link: {protocol: provant}
clients: [{id: a}, {id: b}]
faults:
  - {id: again, type: frame.duplicate, client: b, target: both, parameters: {probability: 0.5}}
  - {id: heavy, type: plant.mass, start_s: 0.05, parameters: {factor: 1.2}}
)",
    R"(angular_rates: world
faults:
  - {id: more, type: wire.byte_insert, target: both, parameters: {probability: 0.05}}
  - {id: less, type: wire.byte_drop, target: to_client, start_s: 0.2, parameters: {probability: 0.05}}
)",
    R"(faults:
  - {id: cold, type: sensor.bias, parameters: {signal: z_m, offset: 0.1}}
  - {id: by-hand, type: frame.drop, target: both, parameters: {probability: 0.2}}
)",
    R"(faults:
  - {id: bits, type: wire.bit_error, target: both, parameters: {ber: 0.001}}
  - {id: by-hand, type: actuator.offset, parameters: {actuator: f_r, value: 1}}
)"};

// The last faults of these come while the vehicle flies, as from the live page.
constexpr std::array<std::size_t, 2> kByHand = {7, 8};

// This scenario makes more of one frame than a line holds. That takes as long as a hundred other inputs. So the mutator
// gives nearly all changes of such an input another scenario.
constexpr std::uint8_t kFlood = 255;
constexpr unsigned kFloodOneOf = 64;
std::string FloodKeys() {
  std::string keys =
      "faults:\n"
      "  - {id: longer, type: frame.long, target: to_plant, start_s: 0.1, parameters: {bytes_count: 1000}}\n"
      "  - {id: held, type: frame.delay, target: to_plant, parameters: {mean_ms: 1}}\n";
  for (int i = 0; i < 14; ++i)
    keys += "  - {id: twice-" + std::to_string(i) +
            ", type: frame.duplicate, target: to_plant, start_s: 0.1, parameters: {probability: 0.99}}\n";
  return keys;
}

Scenario ScenarioOf(const std::string& keys) {
  const std::string text = "name: fuzz\nduration_s: 4\nreference: {type: hover, at_m: [0, 0, 1]}\nmodel: " +
                           tiltproof::testing::TiltrotorFile().string() + "\n" + keys;
  return ParseScenario(text, tiltproof::testing::ScratchFolder() / "fuzz.yaml", {});
}

struct Case {
  Scenario scenario;
  std::optional<faults::FaultSpec> by_hand;
};

const Case& CaseOf(const FrameScript& script) {
  static const std::vector<Case> cases = [] {
    std::vector<Case> all;
    for (const char* keys : kScenarios) all.push_back({ScenarioOf(keys), {}});
    for (const std::size_t i : kByHand) {
      all[i].by_hand = all[i].scenario.faults.back();
      all[i].scenario.faults.pop_back();
    }
    return all;
  }();
  static const Case flood = {ScenarioOf(FloodKeys()), {}};
  return script.choice == kFlood ? flood : cases[script.choice % cases.size()];
}

// A client's message: of five, one is a start, two are requests and two are commands.
Bytes PayloadOfClient(const FrameScript& script, std::uint8_t, Draw& draw) {
  const auto dialect = CaseOf(script).scenario.link.protocol->name == "paper" ? link::Dialect::kPaper
                                                                              : link::Dialect::kProvant;
  const tiltproof::Actuators actuators = {.f_r_n = 10.3F + 2 * draw.Unit(),
                                          .f_l_n = 10.3F + 2 * draw.Unit(),
                                          .tau_r_nm = 0.1F * draw.Unit(),
                                          .tau_l_nm = 0.1F * draw.Unit()};
  const std::size_t what = draw.Below(5);
  const link::MessageBytes message = what == 0   ? link::EncodeStart(dialect, actuators)
                                     : what <= 2 ? link::EncodeReadSensors(dialect)
                                                 : link::EncodeActuators(dialect, actuators);
  return {message.span().begin(), message.span().end()};
}

// The server, and the lines of its clients, as the lockstep conductor plays them.
class Server {
 public:
  explicit Server(const Case& flown)
      : by_hand_(flown.by_hand ? &*flown.by_hand : nullptr),
        rows_(flown.scenario.client_count()),
        plant_(flown.scenario, tiltproof::testing::Tiltrotor(), rows_,
               faults::ScheduleUse{.grows = by_hand_ != nullptr}) {
    for (std::size_t client = 0; client < flown.scenario.client_count(); ++client)
      lines_.emplace_back(flown.scenario, rows_, client, true,
                          faults::ScheduleUse{.grows = by_hand_ != nullptr});
  }

  void Transmit(std::size_t client, BootTime now, std::span<const std::uint8_t> bytes) {
    if (plant_.state().started()) AddByHand();
    lines_[client % lines_.size()].Transmit(link::Direction::kToPlant, now, bytes);
  }

  // Serves all that arrives until then. False when the flight is over.
  bool ServeUntil(BootTime end) {
    for (;;) {
      BootTime next = BootTime::Never();
      if (overfull()) return false;
      for (const LocalLine& line : lines_) next = std::min(next, line.NextArrival(link::Direction::kToPlant));
      if (next > end) break;
      now_ns_ = std::max(now_ns_, next);
      plant_.Advance(now_ns_, Counts());
      ForwardEvents();
      if (plant_.state().over) return false;
      for (std::size_t client = 0; client < lines_.size(); ++client) Serve(client);
    }
    now_ns_ = std::max(now_ns_, end);
    plant_.Advance(now_ns_, Counts());
    ForwardEvents();
    return !plant_.state().over;
  }

  void Check(bool goes_on) {
    const PlantServer::State& state = plant_.state();
    const auto limits = tiltproof::testing::Tiltrotor();
    const auto min = limits.InputMin(), max = limits.InputMax();
    for (std::size_t i = 0; i < min.size(); ++i)
      Require(plant_.in_force()[i] >= min[i] && plant_.in_force()[i] <= max[i],
              "inputs keep the vehicle's limits");
    if (goes_on)
      for (const double value : plant_.Truth())
        Require(std::isfinite(value), "the vehicle's state is finite");
    if (state.started() && goes_on) plant_.Finish(now_ns_ + 1, Counts());
    plant_.WriteTotals();
    Require(rows_.has_totals, "each client has its totals");
    Require(state.over == !state.end_text.empty(), "an end has a reason");
    for (LocalLine& line : lines_) {
      Require(!line.overfull() || !line.overfull()->text.empty(), "a line that is full says why");
      line.Finish(now_ns_);
    }
  }

  bool overfull() const {
    return std::ranges::any_of(lines_, [](const LocalLine& line) { return line.overfull().has_value(); });
  }

 private:
  void AddByHand() {
    if (by_hand_ == nullptr) return;
    plant_.Add(*by_hand_);
    for (LocalLine& line : lines_) line.Add(*by_hand_);
    by_hand_ = nullptr;
  }

  void Serve(std::size_t client) {
    LocalLine& line = lines_[client];
    while (const auto piece = line.TakePiece(link::Direction::kToPlant, now_ns_)) {
      Require(piece->arrival_ns <= now_ns_, "nothing is heard before it arrives");
      if (piece->message == nullptr) continue;
      const bool was_started = plant_.state().started();
      replies_.clear();
      plant_.Receive(client, piece->arrival_ns, *piece->message,
                     [this](auto frame) { replies_.emplace_back(frame.begin(), frame.end()); });
      const BootTime arrival = piece->arrival_ns;
      ForwardEvents();
      for (const Bytes& reply : replies_) {
        CheckReply(reply);
        line.Transmit(link::Direction::kToClient, arrival, reply);
      }
      ForwardEvents();
      if (!was_started && plant_.state().started())
        for (LocalLine& other : lines_) other.SetOrigin(plant_.state().origin);
    }
    while (line.TakePiece(link::Direction::kToClient, now_ns_)) {
    }
  }

  static void CheckReply(std::span<const std::uint8_t> reply) {
    link::FrameDecoder decoder;
    const auto event = decoder.Next(reply);
    Require(event && event->status == link::FrameStatus::kOk && reply.empty(), "a reply is one whole frame");
    Require(event->payload.size() == link::kSensorMessageBytes, "a reply has all sensors");
  }

  void ForwardEvents() {
    const auto of_plant = plant_.PollEvents();
    for (LocalLine& line : lines_) {
      const auto of_line = line.PollEvents();
      plant_.Hear(of_line);
      for (LocalLine& other : lines_)
        if (&other != &line) other.Hear(of_line);
      line.Hear(of_plant);
    }
  }

  const AllCounts& Counts() {
    counts_.clear();
    for (const LocalLine& line : lines_) counts_.push_back(line.counts());
    return counts_;
  }

  // Judges the records.
  struct Rows final : RecordSink {
    explicit Rows(std::size_t clients_count_in) : clients_count(clients_count_in) {}
    void Write(const Record& record) override {
      Require(record.client.value_or(0) < clients_count, "a record is of a client that there is");
      if (const auto* row = std::get_if<record::Row>(&record.body)) {
        Require(columns_count == 0 || row->values.size() == columns_count, "rows are whole");
        Require(!(row->values.at(0) <= last_s), "rows are in order of time");
        columns_count = row->values.size();
        last_s = row->values[0];
      } else if (const auto* end = std::get_if<record::PlantEnd>(&record.body)) {
        has_totals = end->starts_accepted_counts.size() == clients_count;
      }
    }
    std::size_t clients_count, columns_count = 0;
    double last_s = -1;
    bool has_totals = false;
  };

  const faults::FaultSpec* by_hand_;  // until it was added
  Rows rows_;
  LocalPlantServer plant_;
  std::deque<LocalLine> lines_;
  AllCounts counts_;
  BootTime now_ns_;
  std::vector<Bytes> replies_;
};

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  const std::size_t new_size = tiltproof::testing::MutateScript(data, size, max_size, seed, PayloadOfClient);
  if (new_size > 0 && data[0] == kFlood && seed % kFloodOneOf != 0)
    data[0] = static_cast<std::uint8_t>(seed / kFloodOneOf % kFlood);
  return new_size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const FrameScript script = tiltproof::testing::ReadScript({data, size});
  Server server(CaseOf(script));
  BootTime now;
  bool goes_on = true;
  for (const FrameScript::Step& step : script.steps) {
    const BootTime next = now + step.Wait_ns();
    if (next.ns() > kFlightMax_ns) break;
    goes_on = server.ServeUntil(next);
    if (!goes_on) break;
    now = next;
    server.Transmit(step.line, now, step.bytes);
  }
  // Lets the bytes arrive that are still on their way.
  if (goes_on) goes_on = server.ServeUntil(now + 24 * tiltproof::kNsPerMs);
  server.Check(goes_on);
  return 0;
}
