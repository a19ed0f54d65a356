#include <algorithm>

#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Reorder : public WireModel {
 public:
  explicit Reorder(const Parameters& parameters)
      : probability_(parameters.Number("probability")), depth_count_(parameters.Integer("depth_count")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    if (!context.random.Bernoulli(probability_)) {
      Pass(std::move(chunk), out);
      return;
    }
    CountDown();
    held_.push_back({std::move(chunk), depth_count_});
    if (context.what != nullptr) {
      context.Say("held back until " + std::to_string(depth_count_) + " later frame" +
                  (depth_count_ == 1 ? " has" : "s have") + " passed");
    }
  }

  void Pass(link::Chunk&& chunk, std::vector<link::Chunk>& out) override {
    CountDown();
    out.push_back(std::move(chunk));
  }

  std::size_t held_bytes() const override {
    std::size_t bytes = 0;
    for (const Held& held : held_) bytes += link::WeightOf(held.chunk);
    return bytes;
  }

  void Release(std::vector<link::Chunk>& out) override {
    const auto due = [](const Held& held) { return held.wait_count > 0; };
    const auto first_waiting = std::find_if(held_.begin(), held_.end(), due);
    for (auto it = held_.begin(); it != first_waiting; ++it) out.push_back(std::move(it->chunk));
    held_.erase(held_.begin(), first_waiting);
  }

 private:
  struct Held {
    link::Chunk chunk;
    std::int64_t wait_count;  // of later frames that it still lets pass
  };

  void CountDown() {
    for (Held& held : held_) --held.wait_count;
  }

  double probability_;
  std::int64_t depth_count_;
  std::vector<Held> held_;  // oldest first, so the least to wait first
};

}  // namespace

FaultType FrameReorder() {
  return {.name = "frame.reorder",
          .summary = "Lets later frames overtake a frame.",
          .semantics =
              "Models a network with several ways, or a queue that serves some messages first. A frame that "
              "the trigger picks is held back with the given probability. It goes on directly after the "
              "`depth_count`-th later frame of its direction. If the fault has a `message`, only later "
              "frames of that kind count. They count whether or not they are held back themselves, and also "
              "after the window. If there are too few of them, the frame never goes on.",
          .source =
              "IEC 61784-3 (incorrect sequence); Hemminger, Network Emulation with NetEm, linux.conf.au, "
              "2005.",
          .parameters = {ProbabilityParameter("probability, per frame, that it is held back", 0.3),
                         {.name = "depth_count",
                          .unit = "frame",
                          .kind = ParameterKind::kInteger,
                          .min = 1,
                          .max = 16,
                          .doc = "how many later frames overtake it",
                          .example = 2.0}},
          .kind = WireKind{.wire_layer = WireLayer::kFrame,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Reorder>(setup.parameters);
                           },
                           .volume = Volume::kMayLose,
                           .remembers = true}};
}

}  // namespace tiltproof::faults
