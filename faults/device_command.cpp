#include "faults/device_command.h"

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "faults/random.h"
#include "faults/registry.h"
#include "faults/text.h"

namespace tiltproof::faults {
namespace {

// A bit flips at an instant: the window's begin, or one drawn from the window when it has an end.
TimeNs FlipInstant(const Window& window, std::uint64_t stream) {
  if (window.end_ns == kNever) return window.begin_ns;
  const auto length_ns = static_cast<std::uint64_t>(window.end_ns - window.begin_ns);
  return window.begin_ns + static_cast<TimeNs>(Random(stream).Below(length_ns));
}

// None for the clock of another node.
std::optional<DeviceAction> ActionOnClient(const ClockKind& clock, const Parameters& parameters) {
  if (parameters.Choice("node") != "client") return std::nullopt;
  return std::visit([](const auto& action) -> DeviceAction { return action; }, clock.make(parameters));
}

}  // namespace

std::vector<DeviceCommand> DeviceCommands(const std::vector<FaultSpec>& specs, std::uint64_t seed) {
  std::vector<DeviceCommand> commands;
  for (std::size_t fault = 0; fault < specs.size(); ++fault) {
    const FaultSpec& spec = specs[fault];
    const FaultType& type = ValidType(spec);
    const Parameters parameters = ResolvedParameters(spec, type);
    const auto* kind = type.As<DeviceKind>();
    std::optional<DeviceAction> action;
    if (kind != nullptr) action = kind->make({parameters, StreamKey(seed, {spec.id, "bits"})});
    if (const auto* clock = type.As<ClockKind>()) action = ActionOnClient(*clock, parameters);
    if (!action) continue;
    for (const Window& stretch : Activity(spec, WindowOf(spec)).Stretches()) {
      DeviceCommand command{.at_ns = std::max<TimeNs>(stretch.begin_ns, 0),
                            .until_ns = stretch.end_ns,
                            .fault = fault,
                            .action = *action};
      if (kind != nullptr && kind->at_an_instant) {
        command.at_ns = FlipInstant(stretch, StreamKey(seed, {spec.id, "instant"}));
        command.until_ns = kNever;
      }
      commands.push_back(std::move(command));
    }
  }
  std::stable_sort(commands.begin(), commands.end(),
                   [](const DeviceCommand& a, const DeviceCommand& b) { return a.at_ns < b.at_ns; });
  return commands;
}

std::vector<BitFlip> DrawBitFlips(const FlipBits& request, std::uint32_t size_bytes) {
  const std::int64_t bit_count = request.bit_count;
  const std::uint64_t bits = std::uint64_t{8} * size_bytes;
  if (bit_count < 0 || static_cast<std::uint64_t>(bit_count) > bits)
    throw std::invalid_argument(Concat({"cannot flip ", std::to_string(bit_count), " different bits of ",
                                        std::to_string(size_bytes), " bytes"}));
  Random random(request.stream);
  std::vector<BitFlip> flips;
  while (flips.size() < static_cast<std::size_t>(bit_count)) {
    const std::uint64_t drawn = random.Below(bits);
    const BitFlip flip{static_cast<std::uint32_t>(drawn / 8), static_cast<int>(drawn % 8)};
    if (std::find(flips.begin(), flips.end(), flip) == flips.end()) flips.push_back(flip);
  }
  return flips;
}

}  // namespace tiltproof::faults
