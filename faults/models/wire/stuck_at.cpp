#include "faults/bits.h"
#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class StuckAt : public WireModel {
 public:
  explicit StuckAt(const WireSetup& setup)
      : rate_(setup.rate), low_(setup.parameters.Choice("level") == "low") {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    link::Chunk heard = chunk.Part(0, 0);
    std::size_t stuck_count = 0;
    for (std::size_t i = 0; i < chunk.bytes.size(); ++i) {
      const bool is_stuck = context.ActiveDuringByte(chunk, i, rate_);
      if (is_stuck) ++stuck_count;
      if (!is_stuck) heard.Append(chunk, i);
      if (is_stuck && low_) heard.Append(0, LowIsParityError(rate_.character));
    }
    if (context.what != nullptr && stuck_count > 0)
      context.Say(std::to_string(stuck_count) + (low_ ? " bytes read as 00" : " bytes lost"));
    if (!heard.bytes.empty()) out.push_back(std::move(heard));
  }

 private:
  LineRate rate_;
  bool low_;
};

}  // namespace

FaultType WireStuckAt() {
  return {.name = "wire.stuck_at",
          .summary = "The line is stuck at one level.",
          .semantics =
              "Models a short circuit or a dead level shifter between sender and receiver. A line that is "
              "stuck `high` looks idle: every byte that is on the line during any part of the window is "
              "lost. On a line that is stuck `low`, each of them arrives as 00, with a parity error if "
              "parity is odd. The receiver takes every low "
              "bit time for a start bit, and passes on bytes with a framing error. Between frames nothing "
              "arrives. `every_nth_count` and `probability` choose among the frames that are on the line "
              "during the window.",
          .source =
              "Texas Instruments, PC16550D Universal Asynchronous Receiver/Transmitter With FIFOs, SNLS378C, "
              "2015 (break interrupt, framing error).",
          .parameters = {{.name = "level",
                          .unit = "",
                          .kind = ParameterKind::kChoice,
                          .doc = "the level at which it is stuck",
                          .example = "low",
                          .choices = {"low", "high"}}},
          .kind = WireKind{.wire_layer = WireLayer::kByte,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<StuckAt>(setup);
                           },
                           .volume = Volume::kMayLose,
                           .acts_on_overlap = true}};
}

}  // namespace tiltproof::faults
