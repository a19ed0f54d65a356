// What a fault model implements: one class in faults/models/<layer>/<name>.cpp, and a FaultType that
// describes it.
//
// A wire model is asked about one chunk at a time, by the fault stage of one direction (faults/schedule.h). A
// sensor or actuator model edits values. When it is asked (window, every nth, probability, message) and how
// it is recorded is not its business. Data alone, without a class, are faults on a node and on the device,
// which others carry out (faults/node_command.h, faults/device_command.h), and those of the firmware's
// receiver, which mark the bytes that arrive there (FaultSchedule::MarkReceived).
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "faults/fault.h"
#include "faults/random.h"
#include "link/chunk.h"
#include "link/signals.h"
#include "link/time.h"

namespace tiltproof::faults {

using ParameterValue = std::variant<double, std::string>;

// The parameters of one fault, checked, defaults filled in.
class Parameters {
 public:
  explicit Parameters(std::map<std::string, ParameterValue, std::less<>> values)
      : values_(std::move(values)) {}
  double Number(std::string_view name) const { return std::get<double>(values_.find(name)->second); }
  std::int64_t Integer(std::string_view name) const { return static_cast<std::int64_t>(Number(name)); }
  const std::string& Choice(std::string_view name) const { return Text(name); }
  const std::string& Text(std::string_view name) const {
    return std::get<std::string>(values_.find(name)->second);
  }

 private:
  std::map<std::string, ParameterValue, std::less<>> values_;
};

// [begin, end)
struct Window {
  TimeNs begin_ns = kPowerOn;
  TimeNs end_ns = kNever;
  bool Contains(TimeNs t) const { return begin_ns <= t && t < end_ns; }
  // The same in another clock, which shows `origin_ns` at this one's 0. Open ends stay open.
  Window At(TimeNs origin_ns) const {
    return {begin_ns == kPowerOn ? kPowerOn : begin_ns + origin_ns,
            end_ns == kNever ? kNever : end_ns + origin_ns};
  }
};

// Of what is said of one activation.
inline constexpr std::size_t kWhatBytesMax = 4000;

// What a wire model may know beside the chunk.
struct WireContext {
  Random& random;        // of this fault and this frame alone
  const Window& window;  // in the chunks' time
  std::string* what;     // where to say what was done, for a person; null when nobody will read it
  // Beyond kWhatBytesMax the rest is "...".
  void Say(std::string_view text) const;
};

class WireModel {
 public:
  virtual ~WireModel() = default;
  // A chunk that the trigger picked. Appends to `out` what goes on in its place.
  virtual void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) = 0;

  // For models that remember frames (FaultType::remembers): every chunk with the fault's `message` that the
  // trigger did not pick, outside the window too ...
  virtual void Pass(link::Chunk&& chunk, std::vector<link::Chunk>& out) { out.push_back(std::move(chunk)); }
  // ... and, after each Act or Pass, the chance to add what was held back.
  virtual void Release(std::vector<link::Chunk>& /*out*/) {}
  // What it keeps, by link::WeightOf().
  virtual std::size_t held_bytes() const { return 0; }
};

class SensorModel {
 public:
  virtual ~SensorModel() = default;
  // A sample that the trigger picked.
  virtual void Act(Sensors& sensors) = 0;
};

class ActuatorModel {
 public:
  virtual ~ActuatorModel() = default;
  // Without memory: the same command is edited again whenever it is applied anew.
  virtual void Act(ActuatorsTruth& actuators) const = 0;
};

// What becomes of a byte at the firmware's receiver. A byte that is not lost is delivered as it is, with the
// flag set that the USART then shows (RM0090, section 30.3.3).
enum class ReceiveMark : std::uint8_t { kNone, kOverrun, kFraming, kNoise, kParity };
std::string_view Name(ReceiveMark mark);  // "none", "overrun", ...

// The line a wire model stands in.
struct Line {
  std::int64_t baud = 921'600;  // 0: ideal, bytes take no time
  TimeNs BytesTime(std::int64_t byte_count) const { return link::BytesTime(baud, byte_count); }
  // Where the time of a byte within its frame matters, an ideal line has the paper's.
  std::int64_t clock_baud() const { return baud == 0 ? 921'600 : baud; }
};

// What a model's factory is given.
struct WireSetup {
  const Parameters& parameters;
  Line line;
  std::uint64_t stream;  // key of the random stream, for what does not belong to one frame
};

enum class ParameterKind : std::uint8_t { kNumber, kInteger, kChoice, kText };

// A kText parameter: printable ASCII, no blank at its ends, 1 to this many characters.
inline constexpr std::size_t kParameterTextMax = 200;

struct ParameterInfo {
  std::string_view name;
  std::string_view unit;  // "s", "Hz", "1" for a ratio or probability; empty for a choice or text
  ParameterKind kind = ParameterKind::kNumber;
  double min = 0.0, max = 0.0;  // both allowed; numbers and integers
  std::string_view doc;
  ParameterValue example;                            // in an example that acts
  std::optional<ParameterValue> default_value = {};  // required when there is none
  std::optional<ParameterValue> zero =
      {};  // this value (with the others' zeros) makes the fault change nothing
  std::vector<std::string_view> choices = {};  // kChoice
};

// Which faults act first on the wire; sensors, actuators and received bytes are edited at their own places,
// and nodes and the device are commanded.
enum class Stage : std::uint8_t { kFrame, kByte, kTiming, kSensor, kActuator, kReceiver, kNode, kDevice };
std::string_view Name(Stage stage);

// What a fault on the wire does to the number of bytes.
enum class Volume : std::uint8_t {
  kKeeps,    // as many go on, or more
  kMayLose,  // fewer may go on, or later
  kDoubles,  // with its parameter `probability` at 1, exactly twice as many go on
};

// Whether a fault's window has this end.
enum class Bound : std::uint8_t { kOptional, kRequired, kRefused };

// What a fault asks of the firmware's side, for the harness to refuse it before the flight where nobody could
// carry it out.
enum class Needs : std::uint8_t {
  kNothing,     // the harness does it alone, whatever the client
  kNodes,       // processes of the harness's own: real time
  kReset,       // a client that can be reset
  kProcessor,   // a processor to stop, and its memory to write to
  kEmulation,   // the board's clock, reset cause, watchdog and receiver, at exact virtual times
  kParityLine,  // a line with a parity bit; all of ours are 8N1
};

struct FaultType {
  std::string_view name;  // "<layer>.<what>"
  Stage stage{};
  std::string_view summary;    // one sentence
  std::string_view semantics;  // what exactly happens
  std::vector<ParameterInfo> parameters = {};

  // Exactly one of these three, mark, on_node and on_device.
  std::unique_ptr<WireModel> (*make_wire)(const WireSetup&) = nullptr;
  std::unique_ptr<SensorModel> (*make_sensor)(const Parameters&) = nullptr;
  std::unique_ptr<ActuatorModel> (*make_actuator)(const Parameters&) = nullptr;
  // Edits nothing: a command that the harness carries out on a node, in real time only. Its window is not
  // before t = 0, and it has no trigger.
  bool on_node = false;
  // The same for the firmware's processor, its memory or its clock.
  bool on_device = false;
  bool at_an_instant = false;  // a window is no more than where the instant is drawn from
  bool asks_restart = false;   // each makes the firmware boot anew once, at its start or some time later
  // What becomes of bytes at the firmware's receiver, each with the parameter `probability`.
  ReceiveMark mark = ReceiveMark::kNone;

  Bound start = Bound::kOptional, end = Bound::kOptional;
  std::string_view duration_ms = {};  // the parameter that ends the window, where `end` is refused

  Needs needs = Needs::kNothing;

  std::optional<Target> default_target = {};  // wire faults without one must state their target
  Volume volume = Volume::kKeeps;
  bool remembers = false;        // a wire model with Pass() and Release()
  bool acts_on_overlap = false;  // picked when any of the frame's time lies in the window, not its first byte
  bool always_counts = false;    // an activation is recorded although nothing changed

  std::string_view layer() const { return name.substr(0, name.find('.')); }
  bool on_wire() const { return make_wire != nullptr; }
  bool on_receiver() const { return mark != ReceiveMark::kNone; }
  bool is_command() const { return on_node || on_device; }
  bool has_target() const { return on_wire() || on_receiver(); }
};

// Probability parameter shared by many faults.
inline ParameterInfo ProbabilityParameter(std::string_view doc, double example) {
  return {.name = "probability",
          .unit = "1",
          .min = 0.0,
          .max = 1.0,
          .doc = doc,
          .example = example,
          .zero = 0.0};
}

// Which node of the harness: "plant", "link", "client" (the firmware's), "base_station".
inline ParameterInfo NodeParameter(const std::vector<std::string_view>& nodes) {
  return {.name = "node",
          .unit = "",
          .kind = ParameterKind::kChoice,
          .doc = "which node",
          .example = std::string(nodes.front()),
          .choices = nodes};
}

// How long the device is held in reset.
inline ParameterInfo BootParameter() {
  return {.name = "boot_ms",
          .unit = "ms",
          .min = 0.0,
          .max = 600'000.0,
          .doc = "from the reset until the processor runs again",
          .example = 20.0};
}

// 10 kHz: a thousand times the rate at which nothing gets through any more, and still cheap.
inline ParameterInfo RateParameter(std::string_view doc, double example) {
  return {.name = "rate_hz",
          .unit = "Hz",
          .min = 0.0,
          .max = 10'000.0,
          .doc = doc,
          .example = example,
          .zero = 0.0};
}

}  // namespace tiltproof::faults
