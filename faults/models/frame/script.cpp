#include <utility>

#include "faults/fault_type.h"
#include "faults/frame_words.h"
#include "faults/text.h"

namespace tiltproof::faults {
namespace {

class Script : public WireModel {
 public:
  explicit Script(const Parameters& parameters)
      : frames_(ReadFrameWords(parameters.Text("frames")).frames), place_(parameters.Choice("place")) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    if (context.pick >= frames_.size() || frames_[context.pick].empty()) {
      out.push_back(std::move(chunk));
      return;
    }
    link::Chunk scripted{.begin_ns = chunk.begin_ns,
                         .bytes = frames_[context.pick],
                         .message = chunk.message,
                         .number = chunk.number};
    if (context.what != nullptr)
      context.Say(
          Concat({std::to_string(scripted.bytes.size()), " bytes of word ", std::to_string(context.pick + 1),
                  " ", place_, place_ == "instead" ? " of the frame" : " the frame"}));
    if (place_ == "after") {
      out.push_back(std::move(chunk));
      out.push_back(std::move(scripted));
      return;
    }
    out.push_back(std::move(scripted));
    if (place_ == "before") out.push_back(std::move(chunk));
  }

 private:
  std::vector<std::vector<std::uint8_t>> frames_;
  std::string place_;
};

}  // namespace

FaultType FrameScript() {
  return {.name = "frame.script",
          .summary = "Sends bytes that the scenario states.",
          .semantics =
              "Models what was recorded or found: an attack, a frame of a newer protocol, an input of "
              "`tiltproof fuzz`. The k-th word of `frames` belongs to the k-th frame that the trigger picks "
              "in the direction. It is sent as it stands, as the bytes of the line: flags, escapes and "
              "checks are part of it. A word `-` leaves its frame as it is. Behind the last word, frames "
              "pass unchanged. With `place` `instead` the bytes replace the frame, and begin when it would "
              "have begun. With `before` and `after` they are sent directly before or behind the frame, and "
              "take time on the line. Nothing is drawn. `envelope` leaves it out.",
          .source =
              "Miller, Fredriksen and So, An Empirical Study of the Reliability of UNIX Utilities, "
              "Communications of the ACM 33(12), 1990 (unintended inputs).",
          .parameters =
              {{.name = "frames",
                .unit = "",
                .kind = ParameterKind::kFrameWords,
                .doc = "the bytes for each frame that is picked, in lower-case hexadecimal digits; `-`: none",
                .example = "7e30cf307e - 7e7d7e",
                .zero = "-"},
               {.name = "place",
                .unit = "",
                .kind = ParameterKind::kChoice,
                .doc = "where the bytes are sent: instead of the frame, before it, or after it",
                .example = "instead",
                .default_value = "instead",
                .choices = {"instead", "before", "after"}}},
          .kind = WireKind{.wire_layer = WireLayer::kFrame,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Script>(setup.parameters);
                           },
                           .volume = Volume::kMayLose},
          .has_no_severity = true};
}

}  // namespace tiltproof::faults
