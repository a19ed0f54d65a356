#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Disconnect : public WireModel {
 public:
  explicit Disconnect(const LineRate& rate) : rate_(rate) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const std::size_t size = chunk.bytes.size();
    const auto lost = [&](std::size_t byte) {
      return context.ActiveWithin(BeginOf(chunk, byte), BeginOf(chunk, byte + 1));
    };
    std::size_t from = 0;
    while (from < size) {  // runs of bytes that go on, and of lost ones
      const bool goes_on = !lost(from);
      std::size_t to = from + 1;
      while (to < size && lost(to) != goes_on) ++to;
      if (goes_on && to - from == size) {
        out.push_back(std::move(chunk));
        return;
      }
      if (goes_on) {
        link::Chunk run = chunk.Part(from, to);
        run.begin_ns = BeginOf(chunk, from);
        out.push_back(std::move(run));
      } else if (context.what != nullptr) {
        context.Say("bytes " + std::to_string(from) + " to " + std::to_string(to - 1) + " of " +
                    std::to_string(size) + " lost");
      }
      from = to;
    }
  }

 private:
  BootTime BeginOf(const link::Chunk& chunk, std::size_t byte) const {
    return chunk.begin_ns + rate_.BytesTime(static_cast<std::int64_t>(byte));
  }

  LineRate rate_;
};

}  // namespace

FaultType LinkDisconnect() {
  return {.name = "link.disconnect",
          .summary = "The plug is pulled.",
          .semantics =
              "Models a plug that comes off, a wire that breaks, a contact that is loose. Every byte that "
              "is on the line during any part of the window is lost. A frame that is on the line when the "
              "window begins or ends is therefore cut in the middle. `every_nth_count` and `probability` "
              "choose among the frames that are on the line during the window. Without a target, both "
              "directions of the main line are cut.",
          .source = "ISO 26262-5:2018, Annex D (harnesses and connectors: open circuit).",
          .kind = WireKind{.wire_layer = WireLayer::kByte,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Disconnect>(setup.rate);
                           },
                           .default_target = Target::kBoth,
                           .volume = Volume::kMayLose,
                           .acts_on_overlap = true}};
}

}  // namespace tiltproof::faults
