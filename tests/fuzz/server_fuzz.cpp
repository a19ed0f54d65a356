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
#include <span>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/scenario/reader.h"
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

constexpr TimeNs kFlightMax_ns = 4 * tiltproof::kNsPerS;

// Each dialect, several clients, and faults on all that the server owns.
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
)"};

Scenario ScenarioOf(const char* keys) {
  const std::string text = "name: fuzz\nduration_s: 4\nreference: {type: hover, at_m: [0, 0, 1]}\nmodel: " +
                           tiltproof::testing::TiltrotorFile().string() + "\n" + keys;
  return ParseScenario(text, tiltproof::testing::ScratchFolder() / "fuzz.yaml", {});
}

const Scenario& ScenarioOf(const FrameScript& script) {
  static const std::vector<Scenario> scenarios = [] {
    std::vector<Scenario> all;
    for (const char* keys : kScenarios) all.push_back(ScenarioOf(keys));
    return all;
  }();
  return scenarios[script.choice % scenarios.size()];
}

// What a client says: mostly in the order of a flight.
Bytes PayloadOfClient(const FrameScript& script, std::uint8_t, Draw& draw) {
  const auto dialect =
      ScenarioOf(script).link.protocol->name == "paper" ? link::Dialect::kPaper : link::Dialect::kProvant;
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
  explicit Server(const Scenario& scenario)
      : plant_(scenario, tiltproof::testing::Tiltrotor()), lines_(scenario) {}

  void Transmit(std::size_t client, BootTime now, std::span<const std::uint8_t> bytes) {
    lines_.all()[client % lines_.all().size()]->Transmit(link::Direction::kToPlant, now, bytes);
  }

  // Serves all that arrives until then. False when the flight is over.
  bool ServeUntil(BootTime end) {
    for (;;) {
      BootTime next = BootTime::Never();
      for (Line* line : lines_.all()) {
        if (line->overfull()) return false;
        next = std::min(next, line->NextArrival(link::Direction::kToPlant));
      }
      if (next > end) break;
      now_ns_ = std::max(now_ns_, next);
      plant_.Advance(now_ns_, Counts());
      SpreadNews();
      if (plant_.state().over) return false;
      for (std::size_t client = 0; client < lines_.all().size(); ++client) Serve(client);
    }
    now_ns_ = std::max(now_ns_, end);
    plant_.Advance(now_ns_, Counts());
    SpreadNews();
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
    const PlantLog log = plant_.TakeLog();
    Require(log.rows.size() % log.column_count == 0, "rows are whole");
    for (std::size_t at = log.column_count; at < log.rows.size(); at += log.column_count)
      Require(log.rows[at] > log.rows[at - log.column_count], "rows are in order of time");
    Require(log.clients.size() == lines_.all().size(), "each client has its record");
    Require(state.over == !state.end_text.empty(), "an end has a reason");
    for (Line* line : lines_.all()) line->TakeLog(now_ns_);
  }

 private:
  void Serve(std::size_t client) {
    Line& line = *lines_.all()[client];
    while (const auto piece = line.TakePiece(link::Direction::kToPlant, now_ns_)) {
      Require(piece->arrival_ns <= now_ns_, "nothing is heard before it arrives");
      if (piece->message == nullptr) continue;
      const bool was_started = plant_.state().started();
      replies_.clear();
      plant_.Receive(client, piece->arrival_ns, *piece->message,
                     [this](auto frame) { replies_.emplace_back(frame.begin(), frame.end()); });
      const BootTime arrival = piece->arrival_ns;
      SpreadNews();
      for (const Bytes& reply : replies_) {
        CheckReply(reply);
        line.Transmit(link::Direction::kToClient, arrival, reply);
      }
      SpreadNews();
      if (!was_started && plant_.state().started())
        for (Line* other : lines_.all()) other->SetOrigin(plant_.state().origin);
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

  void SpreadNews() {
    const auto of_plant = plant_.TakeNews();
    for (Line* line : lines_.all()) {
      const auto of_line = line->TakeNews();
      plant_.Hear(of_line);
      for (Line* other : lines_.all())
        if (other != line) other->Hear(of_line);
      line->Hear(of_plant);
    }
  }

  const AllCounts& Counts() {
    counts_.clear();
    for (const Line* line : lines_.all()) counts_.push_back(line->counts());
    return counts_;
  }

  LocalPlantServer plant_;
  LocalLines lines_;
  AllCounts counts_;
  BootTime now_ns_;
  std::vector<Bytes> replies_;
};

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return tiltproof::testing::MutateScript(data, size, max_size, seed, PayloadOfClient);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const FrameScript script = tiltproof::testing::ReadScript({data, size});
  Server server(ScenarioOf(script));
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
  // What is still on its way.
  if (goes_on) goes_on = server.ServeUntil(now + 24 * tiltproof::kNsPerMs);
  server.Check(goes_on);
  return 0;
}
