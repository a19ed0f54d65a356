#include "faults/fault_type.h"

namespace tiltproof::faults {
namespace {

class Echo : public WireModel {
 public:
  explicit Echo(double probability) : probability_(probability) {}

  void Act(link::Chunk&& chunk, const WireContext& context, std::vector<link::Chunk>& out) override {
    if (context.random.Bernoulli(probability_)) {
      context.sent_back.push_back(chunk);
      if (context.what != nullptr) context.Say(std::to_string(chunk.bytes.size()) + " bytes come back");
    }
    out.push_back(std::move(chunk));
  }

 private:
  double probability_;
};

}  // namespace

FaultType WireEcho() {
  return {
      .name = "wire.echo",
      .summary = "Frames come back to their sender.",
      .semantics =
          "Models a terminal at the other end that echoes what it reads (ECHO), or a half-duplex transceiver "
          "(RS-485) whose receiver stays on while it sends. Each frame comes back to its sender with the "
          "given probability, and also goes on as it is. The echo starts when the last byte of the frame has "
          "left the sender; that of a transceiver would start one frame earlier. On its way back the echo "
          "takes the line's time: a frame that is sent there meanwhile waits behind it. The echo has the "
          "bytes that the faults before this one have left. Faults of the other direction do not act on it, "
          "and it does not come back again. `to_plant` is what the client sends, and hears again; "
          "`to_client` "
          "is what the server sends. The reference line has no way back.",
      .source =
          "IEEE Std 1003.1-2017 (POSIX.1), Base Definitions, section 11.2.5, Local Modes (ECHO); Texas "
          "Instruments, The RS-485 Design Guide, SLLA272 (a receiver that is always on hears its own "
          "driver).",
      .parameters = {ProbabilityParameter("probability, per frame, that it comes back", 1.0)},
      .kind = WireKind{.wire_layer = WireLayer::kByte,
                       .make = [](const WireSetup& setup) -> std::unique_ptr<WireModel> {
                         return std::make_unique<Echo>(setup.parameters.Number("probability"));
                       },
                       .default_target = Target::kToPlant,
                       .sends_back = true}};
}

}  // namespace tiltproof::faults
