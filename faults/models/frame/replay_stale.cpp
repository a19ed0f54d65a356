#include <cstdint>
#include <deque>
#include <map>
#include <string>

#include "faults/fault_type.h"
#include "link/check.h"

namespace tiltproof::faults {
namespace {

class ReplayStale : public WireModel {
 public:
  explicit ReplayStale(const WireSetup& setup)
      : probability_(setup.parameters.Number("probability")),
        age_count_(static_cast<std::size_t>(setup.parameters.Integer("age_count"))),
        protocol_(setup.protocol) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    History& history = HistoryOf(chunk);
    const bool replay = context.random.Bernoulli(probability_);
    if (!replay || history.size() < age_count_) {
      Pass(std::move(chunk), out);
      return;
    }
    link::Chunk stale = chunk;
    Check(!history.empty(), "a stale frame was remembered before");
    stale.bytes = history.front();
    Remember(history, chunk);
    out.push_back(std::move(stale));
    if (context.what != nullptr) {
      context.Say("replaced by the " + NameOf(chunk) + " frame " + std::to_string(age_count_) + " before it");
    }
  }

  void Pass(link::Chunk&& chunk, std::vector<link::Chunk>& out) override {
    Remember(HistoryOf(chunk), chunk);
    out.push_back(std::move(chunk));
  }

  std::size_t held_bytes() const override { return held_bytes_; }

 private:
  using History =
      std::deque<std::vector<std::uint8_t>>;  // the latest frames, oldest first, at most age_count_

  std::string NameOf(const link::Chunk& chunk) const {
    return chunk.message == link::kNoMessage ? "unknown" : protocol_.messages.at(chunk.message).name;
  }
  History& HistoryOf(const link::Chunk& chunk) { return histories_[chunk.message]; }

  void Remember(History& history, const link::Chunk& chunk) {
    std::vector<std::uint8_t> buffer;
    if (history.size() == age_count_) {
      Check(!history.empty(), "a full history has an oldest frame");
      buffer = std::move(history.front());
      history.pop_front();
      held_bytes_ -= buffer.size() + link::kChunkOverheadBytes;
    }
    buffer.assign(chunk.bytes.begin(), chunk.bytes.end());
    held_bytes_ += buffer.size() + link::kChunkOverheadBytes;
    history.push_back(std::move(buffer));
  }

  double probability_;
  std::size_t age_count_;
  std::size_t held_bytes_ = 0;
  const link::Protocol& protocol_;
  std::map<std::uint8_t, History> histories_;  // by message
};

}  // namespace

FaultType FrameReplayStale() {
  return {
      .name = "frame.replay_stale",
      .summary = "Replaces a new frame by an older one.",
      .semantics =
          "Models a buffer that is sent again before it was filled again, or an attacker with a recording. A "
          "frame that the trigger picks is replaced with the given probability. Its replacement is the frame "
          "that was sent `age_count` frames of the same message before it: a well-formed frame with old "
          "content. Frames from before the window are remembered too. As long as no frame is that old, "
          "nothing happens. Equal content (a sensor request, for example) counts as no change.",
      .source = "EN 50159:2010 (repetition of messages); IEC 61784-3 (unintended repetition).",
      .parameters = {ProbabilityParameter("probability, per frame, that it is replaced", 0.3),
                     {.name = "age_count",
                      .unit = "frame",
                      .kind = ParameterKind::kInteger,
                      .min = 1,
                      .max = 10'000,
                      .doc = "age of the replacement, in frames of the same message",
                      .example = 3.0}},
      .kind = WireKind{.wire_layer = WireLayer::kFrame,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<ReplayStale>(setup);
                       },
                       .remembers = true}};
}

}  // namespace tiltproof::faults
