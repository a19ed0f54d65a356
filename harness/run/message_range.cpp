#include "harness/run/message_range.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>

#include "harness/reference/trajectory.h"
#include "harness/run/message_binding.h"

namespace tiltproof::harness {
namespace {

using link::MessageField;
using link::MessageType;

// The signals that a reference and a start decide, in the axes of the vehicle or of the protocol.
constexpr std::array<std::string_view, 9> kOfPath = {"x_m",    "y_m",      "z_m",       "vx_m_s", "vy_m_s",
                                                     "vz_m_s", "roll_rad", "pitch_rad", "yaw_rad"};
bool IsOfPath(std::string_view signal) {
  return std::find(kOfPath.begin(), kOfPath.end(), signal) != kOfPath.end();
}

// Distance of the value from what the field carries; 0 for what its rounding explains.
double Excess(const MessageField& field, const CarriedRange& carried, double value) {
  const double excess = std::max(carried.low - value, value - carried.high);
  const double rounding = link::IsInteger(field.type) ? field.scale : 1e-6 * std::abs(value);
  return excess > rounding ? excess : 0;
}

// The worst values of one message's fields.
class WorstValues {
 public:
  WorstValues(const MessageType& type, bool of_path)
      : type_(&type), worst_(type.fields.size()), excess_(type.fields.size(), 0.0) {
    for (std::size_t i = 0; i < type.fields.size(); ++i)
      if (type.fields[i].content == link::FieldContent::kSignal &&
          (!of_path || IsOfPath(type.fields[i].signal)))
        watched_.push_back({i, CarriedRangeOf(type.fields[i])});
  }

  bool watches() const { return !watched_.empty(); }

  void Take(std::span<const double> values, TimeNs time_ns, bool at_start) {
    for (const auto& [place, carried] : watched_) {
      const MessageField& field = type_->fields[place];
      const double excess = Excess(field, carried, values[place]);
      if (excess <= excess_[place]) continue;
      excess_[place] = excess;
      worst_[place] = {.message = type_,
                       .field = &field,
                       .carried = carried,
                       .value = values[place],
                       .refused = IsRefused(field, values[place]),
                       .at_start = at_start,
                       .time_ns = time_ns};
    }
  }

  void AppendTo(std::vector<BeyondRange>& all) const {
    std::copy_if(worst_.begin(), worst_.end(), std::back_inserter(all),
                 [](const BeyondRange& each) { return each.field != nullptr; });
  }

 private:
  struct Watched {
    std::size_t place;
    CarriedRange carried;
  };

  const MessageType* type_;
  std::vector<Watched> watched_;
  std::vector<BeyondRange> worst_;
  std::vector<double> excess_;
};

// Writes values into a row of sensors by name.
class StateRow {
 public:
  explicit StateRow(const SignalTable& sensors) : row_(sensors.size(), 0.0) {
    for (const std::string_view name : kOfPath) places_.push_back(sensors.Find(name));
  }
  const std::vector<double>& With(const std::array<double, 3>& position_m,
                                  const std::array<double, 3>& velocity_m_s,
                                  const std::array<double, 3>& attitude_rad) {
    for (std::size_t i = 0; i < 3; ++i) {
      Set(i, position_m[i]);
      Set(3 + i, velocity_m_s[i]);
      Set(6 + i, std::remainder(attitude_rad[i], 2 * std::numbers::pi));  // as a plant's
    }
    return row_;
  }

 private:
  void Set(std::size_t signal, double value) {
    if (places_[signal]) row_[*places_[signal]] = value;
  }
  std::vector<double> row_;
  std::vector<std::optional<std::size_t>> places_;
};

// Calls `take(time_ns, point)` for each control period in which the reference changes: of a long flight, for 20 000 of them,
// because a flight of hours shall cost no more than one of minutes.
template <class Take>
void ForEachPoint(const Scenario& scenario, const Take& take) {
  const Trajectory trajectory(scenario.reference);
  std::optional<ReferencePoint> last;
  constexpr std::int64_t kTimesMax = 20'000;
  const TimeNs period_ns = scenario.link.protocol->control_period_ns;
  const TimeNs stride_ns = period_ns * (1 + scenario.duration_ns / period_ns / kTimesMax);
  for (TimeNs time_ns = 0; time_ns <= scenario.duration_ns; time_ns += stride_ns) {
    const ReferencePoint point = trajectory.At(time_ns);
    if (point == last) continue;
    last = point;
    take(time_ns, point);
  }
}

}  // namespace

bool IsRefused(const MessageField& field, double value) {
  const double sent = link::ValueOnLine(field, value);
  return sent < field.min || sent > field.max;
}

CarriedRange CarriedRangeOf(const MessageField& field) {
  return {std::max(field.min, field.scale * link::LeastNumber(field.type)),
          std::min(field.max, field.scale * link::LargestNumber(field.type))};
}

std::vector<BeyondRange> PathBeyondRange(const Scenario& scenario, const VehicleSignals& vehicle) {
  const link::Protocol& protocol = *scenario.link.protocol;
  struct Checked {
    MessageBinding binding;
    WorstValues worst;
  };
  std::vector<Checked> checked;
  for (const MessageType& type : protocol.messages) {
    if (type.direction == link::Direction::kToPlant) continue;
    WorstValues worst(type, true);
    if (worst.watches())
      checked.push_back(
          {MessageBinding(protocol, type, TableOf(type, vehicle), scenario.angular_rates), std::move(worst)});
  }
  if (checked.empty()) return {};
  const auto take = [&](const std::vector<double>* state, const std::vector<double>* reference,
                        TimeNs time_ns, bool at_start) {
    for (auto& [binding, worst] : checked)
      if (const auto* row = binding.type().direction == link::Direction::kReference ? reference : state)
        worst.Take(binding.Values(*row), time_ns, at_start);
  };
  StateRow state(vehicle.sensors);
  take(&state.With(scenario.initial_position_m, {}, scenario.initial_attitude_rad), nullptr, 0, true);
  ForEachPoint(scenario, [&](TimeNs time_ns, const ReferencePoint& point) {
    const std::vector<double> reference = ToRow(point);
    const std::vector<double>& on_path =
        state.With(point.position_m, point.velocity_m_s, {0, 0, point.yaw_rad});
    take(scenario.held ? nullptr : &on_path, &reference, time_ns, false);
  });
  std::vector<BeyondRange> all;
  for (const Checked& each : checked) each.worst.AppendTo(all);
  return all;
}

std::vector<std::string> UnheardReference(const Scenario& scenario) {
  const link::Protocol& protocol = *scenario.link.protocol;
  const bool is_ned = protocol.world == link::WorldAxes::kNed;
  const std::array<std::string_view, 4> names = {is_ned ? "y_m" : "x_m", is_ned ? "x_m" : "y_m", "z_m",
                                                 "yaw_rad"};
  const auto is_carried = [&](std::string_view name) {
    return std::any_of(protocol.messages.begin(), protocol.messages.end(), [&](const MessageType& type) {
      return type.direction == link::Direction::kReference &&
             std::any_of(type.fields.begin(), type.fields.end(),
                         [&](const MessageField& field) { return field.signal == name; });
    });
  };
  constexpr double kChange = 1e-6;  // m or rad
  std::array<bool, 4> changes{};
  std::array<double, 3> start_m = scenario.initial_position_m;
  // The height at which it stands is the vehicle's: only a change counts.
  if (scenario.initial_on_ground) start_m[2] = Trajectory(scenario.reference).At(0).position_m[2];
  ForEachPoint(scenario, [&](TimeNs, const ReferencePoint& point) {
    for (std::size_t i = 0; i < 3; ++i) changes[i] |= std::abs(point.position_m[i] - start_m[i]) > kChange;
    changes[3] |= std::abs(std::remainder(point.yaw_rad - scenario.initial_attitude_rad[2],
                                          2 * std::numbers::pi)) > kChange;
  });
  std::vector<std::string> unheard;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (changes[i] && !is_carried(names[i])) unheard.emplace_back(names[i]);
  return unheard;
}

RangeWatch::RangeWatch(const link::Protocol& protocol)
    : protocol_(protocol), watched_(protocol.messages.size()) {
  for (std::size_t message = 0; message < watched_.size(); ++message)
    for (std::size_t i = 0; i < protocol.messages[message].fields.size(); ++i) {
      const MessageField& field = protocol.messages[message].fields[i];
      const double usual =
          std::min(link::PlausibleMagnitude(field.signal), link::LargestNumber(link::NumberType::kF32));
      if (field.content == link::FieldContent::kSignal &&
          (IsRefused(field, usual) || IsRefused(field, -usual)))
        watched_[message].push_back(i);
    }
}

std::vector<std::string> RangeWatch::Look(const MessageType& message, std::span<const double> sent,
                                          const std::function<std::vector<double>()>& true_values) {
  std::vector<std::size_t>& watched =
      watched_.at(static_cast<std::size_t>(&message - protocol_.messages.data()));
  const auto is_refused = [&](std::span<const double> values, std::size_t i) {
    return IsRefused(message.fields[i], values[i]);
  };
  if (std::none_of(watched.begin(), watched.end(), [&](std::size_t i) { return is_refused(sent, i); }))
    return {};
  const std::vector<double> values = true_values();
  std::vector<std::string> beyond;
  std::erase_if(watched, [&](std::size_t i) {
    if (!is_refused(sent, i) || !is_refused(values, i)) return false;
    const MessageField& field = message.fields[i];
    beyond.push_back(fmt::format("{} = {:.7g}, beyond the range {:.7g} to {:.7g}", field.signal,
                                 link::ValueOnLine(field, sent[i]), field.min, field.max));
    return true;
  });
  return beyond;
}

std::vector<BeyondRange> HoverBeyondRange(const link::Protocol& protocol, const VehicleSignals& vehicle,
                                          std::span<const double> hover) {
  std::vector<BeyondRange> all;
  for (const MessageType& type : protocol.messages) {
    if (type.kind != link::MessageKind::kActuators) continue;
    WorstValues worst(type, false);
    worst.Take(MessageBinding(protocol, type, vehicle.inputs).Values(hover), 0, false);
    worst.AppendTo(all);
  }
  return all;
}

}  // namespace tiltproof::harness
