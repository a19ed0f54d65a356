#include "faults/model.h"

namespace tiltproof::faults {
namespace {

class Disconnect : public WireModel {
 public:
  explicit Disconnect(const Line& line) : line_(line) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const std::size_t size = chunk.bytes.size();
    std::size_t head = 0;
    while (head < size && EndOf(chunk, head) <= context.window.begin_ns &&
           BeginOf(chunk, head) < context.window.begin_ns)
      ++head;
    std::size_t tail = head;
    while (tail < size && BeginOf(chunk, tail) < context.window.end_ns) ++tail;
    if (head == tail) {
      out.push_back(std::move(chunk));
      return;
    }
    if (context.what != nullptr) {
      context.Say("bytes " + std::to_string(head) + " to " + std::to_string(tail - 1) + " of " +
                  std::to_string(size) + " lost");
    }
    if (tail < size) {
      link::Chunk rest = chunk;
      rest.begin_ns = BeginOf(chunk, tail);
      rest.bytes.erase(rest.bytes.begin(), rest.bytes.begin() + static_cast<std::ptrdiff_t>(tail));
      chunk.bytes.resize(head);
      if (head > 0) out.push_back(std::move(chunk));
      out.push_back(std::move(rest));
    } else if (head > 0) {
      chunk.bytes.resize(head);
      out.push_back(std::move(chunk));
    }
  }

 private:
  TimeNs BeginOf(const link::Chunk& chunk, std::size_t byte) const {
    return chunk.begin_ns + line_.BytesTime(static_cast<std::int64_t>(byte));
  }
  TimeNs EndOf(const link::Chunk& chunk, std::size_t byte) const { return BeginOf(chunk, byte + 1); }

  Line line_;
};

}  // namespace

FaultType LinkDisconnect() {
  return {.name = "link.disconnect",
          .stage = Stage::kByte,
          .summary = "The plug is pulled.",
          .semantics =
              "Every byte that is on the line during any part of the window is lost, so a frame "
              "under way at its beginning or end is cut in the middle. `every_nth_count` and "
              "`probability` choose among the frames that are on the line during the window. "
              "Without a target both directions of the main line are cut.",
          .make_wire = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
            return std::make_unique<Disconnect>(setup.line);
          },
          .default_target = Target::kBoth,
          .volume = Volume::kMayLose,
          .acts_on_overlap = true};
}

}  // namespace tiltproof::faults
