// Line, plant server and client of a lockstep flight that run in other processes. Calls of the conductor
// become messages, which harness/run/remote/serve.h answers.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "harness/client/client.h"
#include "harness/run/line.h"
#include "harness/run/plant_server.h"
#include "harness/run/remote/channel.h"
#include "harness/run/remote/protocol.h"

namespace tiltproof::harness {

// Own time (harness/process/own_time.h) after which a process of the harness counts as hung. For the
// firmware's process it is that of its guard and a little more.
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
  // `protocol` and `sink`, which gets the line's records, must outlive it.
  RemoteLine(Channel& channel, const Setup& setup, const link::Protocol& protocol, RecordSink& sink);
  BootTime Transmit(link::Direction direction, BootTime now, std::span<const std::uint8_t> bytes) override;
  BootTime NextArrival(link::Direction direction) const override {
    return view_.next_arrival_ns[static_cast<std::size_t>(direction)];
  }
  std::optional<Piece> TakePiece(link::Direction direction, BootTime until) override;
  void SetOrigin(Origin origin) override;
  const LineCounts& counts() const override { return view_.counts; }
  const std::optional<Overfull>& overfull() const override { return view_.overfull; }
  std::vector<faults::FaultEvent> PollEvents() override { return std::exchange(news_, {}); }
  void Hear(std::span<const faults::FaultEvent> events) override;
  void Finish(BootTime end) override;

 private:
  void ReadView(Unpacker& answer);

  RemotePart part_;
  LineView view_;
  const link::Protocol& protocol_;
  RecordSink& sink_;
  std::vector<faults::FaultEvent> news_;
  std::vector<std::uint8_t> piece_, parity_errors_;
  link::Message message_;
};

class RemotePlantServer final : public PlantServer {
 public:
  // `sink`, which gets the server's records, must outlive it.
  RemotePlantServer(Channel& channel, const Setup& setup, RecordSink& sink);
  void Advance(BootTime to, const AllCounts& counts) override;
  void Receive(std::size_t client, BootTime arrival, const link::Message& message,
               const Reply& reply) override;
  void SendOwn(BootTime now, const SendTo& send) override;
  void NoteRole(std::size_t client, std::uint32_t role) override;
  void Finish(BootTime end, const AllCounts& counts) override;
  const State& state() const override { return state_; }
  std::vector<faults::FaultEvent> PollEvents() override { return std::exchange(news_, {}); }
  void Hear(std::span<const faults::FaultEvent> events) override;
  void WriteTotals() override;

 private:
  void ReadState(Unpacker& answer);

  RemotePart part_;
  RecordSink& sink_;
  State state_;
  std::vector<faults::FaultEvent> news_;
};

// A failure of its process is blamed on the firmware: FirmwareTrouble.
std::unique_ptr<Client> MakeRemoteClient(Channel& channel, const Setup& setup, ClientHost host);

}  // namespace tiltproof::harness
