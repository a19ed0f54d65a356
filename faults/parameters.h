// The parameters of a fault type: what a scenario may state about it, checked before a model sees it.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "link/check.h"

namespace tiltproof::faults {

// Numbers as double, choices, texts and names of signals as text, directions as [x, y, z].
using ParameterValue = std::variant<double, std::string, std::array<double, 3>>;

// The parameters of one fault, checked, defaults filled in.
class Parameters {
 public:
  explicit Parameters(std::map<std::string, ParameterValue, std::less<>> values)
      : values_(std::move(values)) {}
  double Number(std::string_view name) const { return Value<double>(name); }
  std::int64_t Integer(std::string_view name) const { return static_cast<std::int64_t>(Number(name)); }
  const std::array<double, 3>& Vector(std::string_view name) const {
    return Value<std::array<double, 3>>(name);
  }
  const std::string& Choice(std::string_view name) const { return Text(name); }
  const std::string& Text(std::string_view name) const { return Value<std::string>(name); }
  bool Has(std::string_view name) const { return values_.contains(name); }
  // The same with this text.
  Parameters With(std::string_view name, std::string text) const {
    Parameters changed = *this;
    changed.values_.insert_or_assign(std::string(name), std::move(text));
    return changed;
  }

 private:
  template <class T>
  const T& Value(std::string_view name) const {
    const auto found = values_.find(name);
    const T* value = found == values_.end() ? nullptr : std::get_if<T>(&found->second);
    Check(value != nullptr, "a model asks for a parameter that its type has, by its kind");
    return *value;
  }

  std::map<std::string, ParameterValue, std::less<>> values_;
};

// kFrameWords is the bytes of frames (faults/frame_words.h). kField names a field of a message of the protocol.
// The last seven name signals and parts of the vehicle (faults/signal_choice.h). They are a sensor, a sensor or all of
// them, a sensor of a position, three sensors that are a vector's components, an input, a rotor, a joint.
// Their names are known only when the vehicle is loaded.
enum class ParameterKind : std::uint8_t {
  kNumber,
  kInteger,
  kChoice,
  kText,
  kFrameWords,
  kVector,
  kField,
  kSensor,
  kSensorOrAll,
  kPositionSensor,
  kSensorVector,
  kInput,
  kRotor,
  kJoint,
};
constexpr bool NamesSignal(ParameterKind kind) {
  return kind == ParameterKind::kSensor || kind == ParameterKind::kSensorOrAll ||
         kind == ParameterKind::kPositionSensor || kind == ParameterKind::kSensorVector ||
         kind == ParameterKind::kInput;
}

constexpr bool NamesPart(ParameterKind kind) {
  return kind == ParameterKind::kRotor || kind == ParameterKind::kJoint;
}

// Spacing of the levels, from harmless to worst, in a search for the level at which a flight fails.
enum class Scale : std::uint8_t { kLinear, kLogarithmic };

// A kText parameter, or the name of a part: printable ASCII, no blank at either end, 1 to this many characters.
inline constexpr std::size_t kParameterTextMax = 200;

// A kFrameWords parameter. Within the limit of a scenario's text on the bus (harness/dds/messages.h).
inline constexpr std::size_t kFrameWordsTextMax = 200'000;

struct ParameterInfo {
  std::string_view name;
  std::string_view
      unit;  // "s", "Hz", "1" for a ratio or probability; empty for a choice, text, field, signal or part
  ParameterKind kind = ParameterKind::kNumber;
  double min = 0.0, max = 0.0;  // both allowed; numbers, integers, and each part of a vector
  std::string_view doc;
  ParameterValue example;                            // in an example that acts
  std::optional<ParameterValue> default_value = {};  // without one the parameter is required
  std::optional<ParameterValue> zero =
      {};  // this value (with the others' zeros) makes the fault change nothing
  std::vector<std::string_view> choices = {};  // kChoice
  // Set for the one parameter of a type that measures its severity: from `zero`, which is harmless, to the
  // far end of its range. For a type without one, the severity is the length of the window, or there is none.
  std::optional<Scale> severity = {};
};

// Probability parameter shared by many faults.
inline ParameterInfo ProbabilityParameter(std::string_view doc, double example) {
  return {.name = "probability",
          .unit = "1",
          .min = 0.0,
          .max = 1.0,
          .doc = doc,
          .example = example,
          .zero = 0.0,
          .severity = Scale::kLogarithmic};
}

// The same where another parameter is the severity: 1 by default.
inline ParameterInfo ProbabilityOfEach(std::string_view doc, double example) {
  ParameterInfo probability = ProbabilityParameter(doc, example);
  probability.default_value = 1.0;
  probability.severity.reset();
  return probability;
}

// A node of the harness: "plant", "link", "client" (the firmware's), "base_station".
inline ParameterInfo NodeParameter(const std::vector<std::string_view>& nodes) {
  return {.name = "node",
          .unit = "",
          .kind = ParameterKind::kChoice,
          .doc = "which node",
          .example = std::string(nodes.front()),
          .choices = nodes};
}

// The node or client with the clock.
inline ParameterInfo ClockNodeParameter() {
  ParameterInfo node = NodeParameter({"client", "plant", "link", "base_station"});
  node.doc = "whose clock";
  node.default_value = "client";
  return node;
}

// The time for which the device is held in reset.
inline ParameterInfo BootParameter() {
  return {.name = "boot_ms",
          .unit = "ms",
          .min = 0.0,
          .max = 600'000.0,
          .doc = "time from the reset until the processor runs again",
          .example = 20.0};
}

// 10 kHz: a thousand times the rate at which nothing gets through any more, and still cheap to compute.
inline ParameterInfo RateParameter(std::string_view doc, double example) {
  return {.name = "rate_hz",
          .unit = "Hz",
          .min = 0.0,
          .max = 10'000.0,
          .doc = doc,
          .example = example,
          .zero = 0.0,
          .severity = Scale::kLogarithmic};
}

}  // namespace tiltproof::faults
