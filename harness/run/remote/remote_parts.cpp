#include "harness/run/remote/remote_parts.h"

#include <utility>

#include "harness/client/firmware_guard.h"

namespace tiltproof::harness {
namespace {

// The guard in the firmware's process speaks first.
constexpr TimeNs kClientHungAfterNs = FirmwareGuard::kUnreachableAfterNs;

class RemoteClient final : public Client {
 public:
  RemoteClient(Channel& channel, const Setup& setup, ClientHost host)
      : channel_(channel), host_(std::move(host)) {
    const auto answer = Ask(RemotePart::Request(Message::kSetup, setup));
    runs_on_ = Unpacker(answer).Next<bool>();
  }

  bool RunsOn() const override { return runs_on_; }
  BootTime Start(BootTime now) override { return AskTime(RemotePart::Request(Message::kStart, now)); }
  void Receive(Uart uart, BootTime arrival, std::span<const std::uint8_t> bytes,
               std::span<const faults::ReceiveMark> marks) override {
    Ask(RemotePart::Request(Message::kReceive, uart, arrival,
                            std::vector<std::uint8_t>(bytes.begin(), bytes.end()),
                            std::vector<faults::ReceiveMark>(marks.begin(), marks.end())));
  }
  BootTime Grant(BootTime now, BootTime horizon) override {
    return AskTime(RemotePart::Request(Message::kGrant, now, horizon));
  }
  void Command(const std::vector<faults::DeviceCommand>& commands, Origin origin) override {
    Ask(RemotePart::Request(Message::kCommand, commands, origin));
  }
  BootTime Add(const std::vector<faults::DeviceCommand>& commands) override {
    return AskTime(RemotePart::Request(Message::kAddCommands, commands));
  }
  std::optional<ClientStatus> Status() override {
    const auto answer = Ask(RemotePart::Request(Message::kStatus));
    return Unpacker(answer).Next<std::optional<ClientStatus>>();
  }
  ClientSample Sample() override {
    const auto answer = Ask(RemotePart::Request(Message::kSample));
    return Unpacker(answer).Next<ClientSample>();
  }

 private:
  BootTime AskTime(const Packer& request) {
    const auto answer = Ask(request);
    return Unpacker(answer).Next<BootTime>();
  }

  std::vector<std::uint8_t> Ask(const Packer& request) {
    try {
      channel_.Send(request.bytes());
      for (;;) {
        const auto message = channel_.Receive(kClientHungAfterNs);
        Unpacker unpacker(message);
        switch (unpacker.Next<Message>()) {
          case Message::kClientTransmits: {
            const auto uart = unpacker.Next<Uart>();
            const auto now = unpacker.Next<BootTime>();
            const auto bytes = unpacker.Next<std::vector<std::uint8_t>>();
            Packer answer;
            answer(Message::kDone, host_.transmit(uart, now, bytes));
            channel_.Send(answer.bytes());
            continue;
          }
          case Message::kClientLogs: {
            const auto now = unpacker.Next<BootTime>();
            host_.log(now, unpacker.Next<std::string>());
            continue;
          }
          case Message::kClientEvent:
            host_.event(unpacker.Next<DeviceEvent>());
            continue;
          case Message::kDone:
            return {message.begin() + 1, message.end()};
          case Message::kFirmwareFailed: {
            const bool hung = unpacker.Next<bool>();
            const auto text = unpacker.Next<std::string>();
            throw FirmwareTrouble(hung, text, unpacker.Next<FirmwareEnd>());
          }
          case Message::kFailed:
            throw std::runtime_error(unpacker.Next<std::string>());
          default:
            throw ChannelLost(false, "the firmware's process sent a damaged message");
        }
      }
    } catch (const ChannelLost& lost) {
      throw FirmwareTrouble(lost.silent, "the firmware's process: " + std::string(lost.what()));
    }
  }

  Channel& channel_;
  ClientHost host_;
  bool runs_on_ = false;
};

}  // namespace

RemotePart::RemotePart(std::string name, Channel& channel, const Setup& setup)
    : name_(std::move(name)), channel_(channel) {
  Ask(Request(Message::kSetup, setup));
}

std::vector<std::uint8_t> RemotePart::Ask(const Packer& request) {
  try {
    channel_.Send(request.bytes());
    auto message = channel_.Receive(kPartHungAfterNs);
    Unpacker unpacker(message);
    const auto kind = unpacker.Next<Message>();
    if (kind == Message::kFailed) throw std::runtime_error(unpacker.Next<std::string>());
    if (kind != Message::kDone) throw std::runtime_error("it sent a damaged message");
    message.erase(message.begin());
    return message;
  } catch (const std::runtime_error& error) {
    throw std::runtime_error("the " + name_ + " process: " + error.what());
  }
}

RemoteLine::RemoteLine(Channel& channel, const Setup& setup, const link::Protocol& protocol, RecordSink& sink)
    : part_("link", channel, setup), protocol_(protocol), sink_(sink) {}

void RemoteLine::ReadView(Unpacker& answer) {
  answer(view_);
  news_.insert(news_.end(), view_.events.begin(), view_.events.end());
  ReadPacked(view_.records, sink_);
}

void RemoteLine::Hear(std::span<const faults::FaultEvent> events) {
  if (!events.empty())
    part_.Ask(
        RemotePart::Request(Message::kHear, std::vector<faults::FaultEvent>(events.begin(), events.end())));
}

BootTime RemoteLine::Transmit(link::Direction direction, BootTime now, std::span<const std::uint8_t> bytes) {
  const auto answer = part_.Ask(RemotePart::Request(Message::kTransmit, direction, now,
                                                    std::vector<std::uint8_t>(bytes.begin(), bytes.end())));
  Unpacker unpacker(answer);
  ReadView(unpacker);
  return unpacker.Next<BootTime>();
}

std::optional<Line::Piece> RemoteLine::TakePiece(link::Direction direction, BootTime until) {
  // The line knows of nothing before that.
  if (NextArrival(direction) == BootTime::Never()) return std::nullopt;
  const auto answer = part_.Ask(RemotePart::Request(Message::kTakePiece, direction, until));
  Unpacker unpacker(answer);
  ReadView(unpacker);
  if (!unpacker.Next<bool>()) return std::nullopt;
  const auto arrival = unpacker.Next<BootTime>();
  unpacker(piece_);
  Piece piece{arrival, piece_};
  if (const auto message = unpacker.Next<std::optional<PackedMessage>>()) {
    message_ = Unpacked(*message, protocol_);
    piece.message = &message_;
  }
  unpacker(parity_errors_);
  piece.parity_errors = parity_errors_;
  return piece;
}

void RemoteLine::SetOrigin(Origin origin) { part_.Ask(RemotePart::Request(Message::kSetOrigin, origin)); }

void RemoteLine::Finish(BootTime end) {
  const auto answer = part_.Ask(RemotePart::Request(Message::kFinish, end));
  Unpacker unpacker(answer);
  ReadView(unpacker);
}

RemotePlantServer::RemotePlantServer(Channel& channel, const Setup& setup, RecordSink& sink)
    : part_("plant", channel, setup), sink_(sink) {
  // Nothing to do at that time; but the server may send by itself from power-on on.
  const auto answer = part_.Ask(RemotePart::Request(Message::kAdvance, BootTime::Earliest(), AllCounts()));
  Unpacker unpacker(answer);
  ReadState(unpacker);
}

void RemotePlantServer::ReadState(Unpacker& answer) {
  answer(state_);
  const auto events = answer.Next<std::vector<faults::FaultEvent>>();
  news_.insert(news_.end(), events.begin(), events.end());
  ReadPacked(answer.Next<std::vector<std::uint8_t>>(), sink_);
}

void RemotePlantServer::Hear(std::span<const faults::FaultEvent> events) {
  if (!events.empty())
    part_.Ask(
        RemotePart::Request(Message::kHear, std::vector<faults::FaultEvent>(events.begin(), events.end())));
}

void RemotePlantServer::Advance(BootTime to, const AllCounts& counts) {
  if (to <= state_.quiet_until_ns || state_.over) return;
  const auto answer = part_.Ask(RemotePart::Request(Message::kAdvance, to, counts));
  Unpacker unpacker(answer);
  ReadState(unpacker);
}

void RemotePlantServer::Receive(std::size_t client, BootTime arrival, const link::Message& message,
                                const Reply& reply) {
  const auto answer = part_.Ask(RemotePart::Request(Message::kServe, client, arrival, Packed(message)));
  Unpacker unpacker(answer);
  ReadState(unpacker);
  for (const auto& frame : unpacker.Next<std::vector<std::vector<std::uint8_t>>>()) reply(frame);
}

void RemotePlantServer::SendOwn(BootTime now, const SendTo& send) {
  const auto answer = part_.Ask(RemotePart::Request(Message::kSendOwn, now));
  Unpacker unpacker(answer);
  ReadState(unpacker);
  for (const auto& [client, frame] : unpacker.Next<std::vector<FrameTo>>()) send(client, frame);
}

void RemotePlantServer::NoteRole(std::size_t client, std::uint32_t role) {
  part_.Ask(RemotePart::Request(Message::kRole, client, role));
}

void RemotePlantServer::Finish(BootTime end, const AllCounts& counts) {
  const auto answer = part_.Ask(RemotePart::Request(Message::kFinish, end, counts));
  Unpacker unpacker(answer);
  ReadState(unpacker);
}

void RemotePlantServer::WriteTotals() {
  const auto answer = part_.Ask(RemotePart::Request(Message::kWriteTotals));
  Unpacker unpacker(answer);
  ReadState(unpacker);
}

std::unique_ptr<Client> MakeRemoteClient(Channel& channel, const Setup& setup, ClientHost host) {
  return std::make_unique<RemoteClient>(channel, setup, std::move(host));
}

}  // namespace tiltproof::harness
