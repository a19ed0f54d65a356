#include <algorithm>

#include "faults/fault_type.h"
#include "faults/text.h"

namespace tiltproof::faults {
namespace {

class BandwidthCap : public WireModel {
 public:
  explicit BandwidthCap(const WireSetup& setup)
      : rate_(setup.rate), bytes_per_s_(setup.parameters.Number("bytes_per_s")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    if (bytes_per_s_ < kNoLimit) {
      const auto size = static_cast<std::int64_t>(chunk.bytes.size());
      free_ns_ = std::max(free_ns_, chunk.begin_ns) + FromSeconds(static_cast<double>(size) / bytes_per_s_);
      const BootTime begin = std::max(chunk.begin_ns, free_ns_ - rate_.BytesTime(size));
      if (context.what != nullptr && begin > chunk.begin_ns)
        context.Say(Concat({"delayed by ", NumberText(ToSeconds(begin - chunk.begin_ns) * 1e3), " ms"}));
      chunk.begin_ns = begin;
    }
    out.push_back(std::move(chunk));
  }

 private:
  static constexpr double kNoLimit = 1e6;
  LineRate rate_;
  double bytes_per_s_;
  BootTime free_ns_ = BootTime::Earliest();  // when the latest frame leaves the stage
};

}  // namespace

FaultType WireBandwidthCap() {
  return {.name = "wire.bandwidth_cap",
          .summary = "The line carries less than it should.",
          .semantics =
              "Models a radio modem or a shared bus in place of a cable. Frames that the trigger picks pass "
              "one after the other through a stage that carries `bytes_per_s`. Each enters it when it is "
              "sent, or when the one before has left it. Its last byte leaves the line when it leaves the "
              "stage, but not before it would without the stage. When more is sent than it carries, the "
              "delay grows. Frames that the trigger does not pick do not enter the stage, but wait behind "
              "those that do. 1000000 bytes per second are no limit.",
          .source =
              "Cruz, A Calculus for Network Delay, Part I, IEEE Transactions on Information Theory 37(1), "
              "1991 (work-conserving server of a fixed rate).",
          .parameters = {{.name = "bytes_per_s",
                          .unit = "byte/s",
                          .min = 100.0,
                          .max = 1e6,
                          .doc = "bytes that pass per second",
                          .example = 5000.0,
                          .zero = 1e6,
                          .severity = Scale::kLogarithmic}},
          .kind = WireKind{.wire_layer = WireLayer::kTiming,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<BandwidthCap>(setup);
                           },
                           .remembers = true}};
}

}  // namespace tiltproof::faults
