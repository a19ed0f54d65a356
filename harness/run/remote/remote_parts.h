// Line, plant server and client of a lockstep flight that live in other processes: what the conductor calls
// becomes messages. harness/run/remote/serve.h answers them.
#pragma once

#include <memory>
#include <string>

#include "harness/client/client.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/run/remote/channel.h"
#include "harness/run/remote/protocol.h"

namespace tiltproof::harness {

// Own time (harness/process/own_time.h) after which a process of ours counts as hung; for the firmware's, its guard's
// and a little more.
inline constexpr TimeNs kPartHungAfterNs = 10 * kNsPerS;

// One part of the flight in another process. Throws std::runtime_error "the <name> process ..." when it fails.
class RemotePart {
 public:
  // `channel` must outlive it. Sends Setup.
  RemotePart(std::string name, Channel& channel, const Setup& setup);

  // Sends a request and returns the answer's bytes.
  std::vector<std::uint8_t> Ask(const Packer& request);
  template <class... Ts>
  static Packer Request(Message kind, const Ts&... values) {
    Packer packer;
    packer(kind, values...);
    return packer;
  }

 private:
  std::string name_;
  Channel& channel_;
};

class RemoteLine final : public Line {
 public:
  RemoteLine(Channel& channel, const Setup& setup);
  TimeNs Transmit(link::Direction direction, TimeNs now, std::span<const std::uint8_t> bytes) override;
  TimeNs NextArrival(link::Direction direction) const override {
    return view_.next_arrival_ns[static_cast<std::size_t>(direction)];
  }
  std::optional<Piece> TakePiece(link::Direction direction, TimeNs until) override;
  const LineCounts& counts() const override { return view_.counts; }
  const std::optional<Overfull>& overfull() const override { return view_.overfull; }
  LineLog TakeLog(TimeNs end) override;

 private:
  RemotePart part_;
  LineView view_;
  std::vector<std::uint8_t> piece_;
};

class RemotePlantServer final : public PlantServer {
 public:
  RemotePlantServer(Channel& channel, const Setup& setup);
  void Advance(TimeNs to, const LineCounts& counts) override;
  void Receive(TimeNs arrival, std::span<const std::uint8_t> bytes, const Reply& reply) override;
  void Finish(TimeNs end, const LineCounts& counts) override;
  const State& state() const override { return state_; }
  PlantLog TakeLog() override;

 private:
  RemotePart part_;
  State state_;
};

// What goes wrong with its process is the firmware's: FirmwareTrouble.
std::unique_ptr<Client> MakeRemoteClient(Channel& channel, const Setup& setup, ClientHost host);

}  // namespace tiltproof::harness
