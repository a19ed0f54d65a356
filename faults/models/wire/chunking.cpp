#include <algorithm>

#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Chunking : public WireModel {
 public:
  explicit Chunking(const WireSetup& setup)
      : rate_(setup.rate),
        piece_bytes_(static_cast<std::size_t>(setup.parameters.Integer("max_bytes_count"))),
        gap_ns_(FromSeconds(setup.parameters.Number("gap_ms") * 1e-3)) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    const std::size_t size = chunk.bytes.size();
    if (gap_ns_ == 0 || size <= piece_bytes_) {
      out.push_back(std::move(chunk));
      return;
    }
    BootTime begin_ns = chunk.begin_ns;
    for (std::size_t from = 0; from < size; from += piece_bytes_) {
      const std::size_t to = std::min(from + piece_bytes_, size);
      out.push_back(chunk.Part(from, to));
      out.back().begin_ns = begin_ns;
      begin_ns += rate_.BytesTime(static_cast<std::int64_t>(to - from)) + gap_ns_;
    }
    if (context.what != nullptr)
      context.Say("in " + std::to_string((size + piece_bytes_ - 1) / piece_bytes_) + " pieces");
  }

 private:
  LineRate rate_;
  std::size_t piece_bytes_;
  TimeNs gap_ns_;
};

}  // namespace

FaultType WireChunking() {
  return {.name = "wire.chunking",
          .summary = "Frames arrive in pieces with pauses between them.",
          .semantics =
              "Models a USB adapter or a driver that hands bytes over in blocks. A frame that the trigger "
              "picks is cut into pieces of `max_bytes_count` bytes, the last of which may be shorter. Each "
              "piece but the first begins `gap_ms` after the end of the one before. A frame that is not "
              "longer than that goes on as it is. What comes behind waits.",
          .source =
              "Future Technology Devices International, AN232B-04 Data Throughput, Latency and Handshaking, "
              "2006.",
          .parameters = {{.name = "max_bytes_count",
                          .unit = "byte",
                          .kind = ParameterKind::kInteger,
                          .min = 1,
                          .max = 1024,
                          .doc = "longest piece",
                          .example = 16.0},
                         {.name = "gap_ms",
                          .unit = "ms",
                          .min = 0.0,
                          .max = 1000.0,
                          .doc = "pause between two pieces",
                          .example = 1.0,
                          .zero = 0.0,
                          .severity = Scale::kLogarithmic}},
          .kind = WireKind{.wire_layer = WireLayer::kTiming,
                           .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                             return std::make_unique<Chunking>(setup);
                           }}};
}

}  // namespace tiltproof::faults
