#include "harness/run/remote/serve.h"

#include <optional>
#include <utility>

#include "harness/client/firmware_guard.h"
#include "harness/run/client_parameters.h"
#include "harness/run/flight.h"
#include "harness/run/remote/protocol.h"

namespace tiltproof::harness {
namespace {

// A harness may be at a debugger's breakpoint: the channel detects that it is gone.
constexpr TimeNs kHarnessSilentAfterNs = 3600 * kNsPerS;
// Records leave in batches of about 0.2 s of a flight, because a batch in each answer would cost more time.
constexpr std::size_t kBatchBytes = 16'384;

std::vector<std::uint8_t> TakeBatch(PackedRecords& records) {
  if (records.size_bytes() < kBatchBytes) return {};
  return records.TakeAll();
}

// Answers requests until kQuit: `handle(kind, request, answer)` puts what follows kDone.
template <class Handle>
void ServeRequests(Channel& channel, const Handle& handle) {
  try {
    for (;;) {
      const auto message = channel.Receive(kHarnessSilentAfterNs);
      Packer answer;
      try {
        Unpacker request(message);
        const auto kind = request.Next<Message>();
        if (kind == Message::kQuit) return;
        answer(Message::kDone);
        handle(kind, request, answer);
      } catch (const ChannelLost&) {
        throw;
      } catch (const FirmwareTrouble& trouble) {
        answer = {};
        answer(Message::kFirmwareFailed, trouble.hung, std::string(trouble.what()), trouble.end);
      } catch (const std::exception& error) {
        answer = {};
        answer(Message::kFailed, std::string(error.what()));
      }
      channel.Send(answer.bytes());
    }
  } catch (const ChannelLost&) {
    // The harness is gone: there is no one to report to.
  }
}

link::Direction NextDirection(Unpacker& request) {
  const auto direction = request.Next<link::Direction>();
  if (static_cast<std::size_t>(direction) >= link::kDirectionCount)
    throw std::runtime_error("a request with a direction that no line has");
  return direction;
}

[[noreturn]] void ThrowUnexpected() { throw std::runtime_error("a request that this process does not know"); }

}  // namespace

void ServeLine(Channel& channel, const ScenarioLoader& load) {
  PackedRecords records;
  std::optional<LocalLine> line;
  const auto view = [&](std::vector<std::uint8_t> batch) {
    LineView now;
    for (std::size_t d = 0; d < link::kDirectionCount; ++d)
      now.next_arrival_ns[d] = line->NextArrival(static_cast<link::Direction>(d));
    now.counts = line->counts();
    now.overfull = line->overfull();
    now.events = line->PollEvents();
    now.records = std::move(batch);
    return now;
  };
  ServeRequests(channel, [&](Message kind, Unpacker& request, Packer& answer) {
    if (kind == Message::kSetup) {
      const auto setup = request.Next<Setup>();
      line.emplace(load(setup.scenario_yaml).scenario, records, setup.place);
      return;
    }
    if (!line) ThrowUnexpected();
    switch (kind) {
      case Message::kTransmit: {
        const auto direction = NextDirection(request);
        const auto now = request.Next<BootTime>();
        const BootTime sent = line->Transmit(direction, now, request.Next<std::vector<std::uint8_t>>());
        answer(view(TakeBatch(records)), sent);
        return;
      }
      case Message::kTakePiece: {
        const auto direction = NextDirection(request);
        const auto piece = line->TakePiece(direction, request.Next<BootTime>());
        answer(view(TakeBatch(records)), piece.has_value());
        if (!piece) return;
        std::optional<PackedMessage> message;
        if (piece->message != nullptr) message = Packed(*piece->message);
        answer(piece->arrival_ns, std::vector<std::uint8_t>(piece->bytes.begin(), piece->bytes.end()),
               message, std::vector<std::uint8_t>(piece->parity_errors.begin(), piece->parity_errors.end()));
        return;
      }
      case Message::kSetOrigin:
        line->SetOrigin(request.Next<Origin>());
        return;
      case Message::kHear:
        line->Hear(request.Next<std::vector<faults::FaultEvent>>());
        return;
      case Message::kFinish:
        line->Finish(request.Next<BootTime>());
        answer(view(records.TakeAll()));
        return;
      default:
        ThrowUnexpected();
    }
  });
}

void ServePlant(Channel& channel, const ScenarioLoader& load) {
  std::optional<LoadedScenario> loaded;
  PackedRecords records;
  std::optional<LocalPlantServer> server;
  ServeRequests(channel, [&](Message kind, Unpacker& request, Packer& answer) {
    if (kind == Message::kSetup) {
      loaded = load(request.Next<Setup>().scenario_yaml);
      server.emplace(loaded->scenario, *loaded->model, records);
      return;
    }
    if (!server) ThrowUnexpected();
    switch (kind) {
      case Message::kAdvance:
      case Message::kFinish: {
        const auto time = request.Next<BootTime>();
        const auto counts = request.Next<AllCounts>();
        if (kind == Message::kAdvance) {
          server->Advance(time, counts);
        } else {
          server->Finish(time, counts);
        }
        answer(server->state(), server->PollEvents(), TakeBatch(records));
        return;
      }
      case Message::kServe: {
        const auto client = request.Next<std::size_t>();
        const auto arrival = request.Next<BootTime>();
        std::vector<std::vector<std::uint8_t>> frames;
        server->Receive(
            client, arrival, Unpacked(request.Next<PackedMessage>(), *loaded->scenario.link.protocol),
            [&](std::span<const std::uint8_t> frame) { frames.emplace_back(frame.begin(), frame.end()); });
        answer(server->state(), server->PollEvents(), TakeBatch(records), frames);
        return;
      }
      case Message::kSendOwn: {
        std::vector<FrameTo> frames;
        server->SendOwn(request.Next<BootTime>(),
                        [&](std::size_t client, std::span<const std::uint8_t> frame) {
                          frames.push_back({client, {frame.begin(), frame.end()}});
                        });
        answer(server->state(), server->PollEvents(), TakeBatch(records), frames);
        return;
      }
      case Message::kRole: {
        const auto client = request.Next<std::size_t>();
        server->NoteRole(client, request.Next<std::uint32_t>());
        return;
      }
      case Message::kHear:
        server->Hear(request.Next<std::vector<faults::FaultEvent>>());
        return;
      case Message::kWriteTotals:
        server->WriteTotals();
        answer(server->state(), server->PollEvents(), records.TakeAll());
        return;
      default:
        ThrowUnexpected();
    }
  });
}

namespace {

// Functions of a client whose harness is at the other end.
ClientHost HostOver(Channel& channel) {
  return {.transmit = [&channel](Uart uart, BootTime now, std::span<const std::uint8_t> bytes) -> BootTime {
            Packer upcall;
            upcall(Message::kClientTransmits, uart, now,
                   std::vector<std::uint8_t>(bytes.begin(), bytes.end()));
            channel.Send(upcall.bytes());
            const auto answer = channel.Receive(kHarnessSilentAfterNs);
            Unpacker unpacker(answer);
            unpacker.Next<Message>();
            return unpacker.Next<BootTime>();
          },
          .log =
              [&channel](BootTime now, std::string_view text) {
                Packer upcall;
                upcall(Message::kClientLogs, now, std::string(text));
                channel.Send(upcall.bytes());
              },
          .event =
              [&channel](const DeviceEvent& event) {
                Packer upcall;
                upcall(Message::kClientEvent, event);
                channel.Send(upcall.bytes());
              }};
}

}  // namespace

void ServeClient(Channel& channel, const ScenarioLoader& load) {
  FirmwareGuard::Install();
  std::unique_ptr<Client> client;
  const ClientHost host = HostOver(channel);
  ServeRequests(channel, [&](Message kind, Unpacker& request, Packer& answer) {
    if (kind == Message::kSetup) {
      const auto setup = request.Next<Setup>();
      const LoadedScenario loaded = load(setup.scenario_yaml);
      ClientSettings settings = SettingsOf(loaded.scenario, setup.place);
      settings.lines.faulty = settings.lines.faulty || setup.steered;
      settings.parameters = [&] { return ClientParameters(loaded.scenario, *loaded.model, setup.place); };
      client = MakeClient(ParseClient(setup.client), settings, host);
      answer(client->RunsOn());
      return;
    }
    if (!client) ThrowUnexpected();
    switch (kind) {
      case Message::kStart:
        answer(client->Start(request.Next<BootTime>()));
        return;
      case Message::kReceive: {
        const auto uart = request.Next<Uart>();
        const auto arrival = request.Next<BootTime>();
        const auto bytes = request.Next<std::vector<std::uint8_t>>();
        client->Receive(uart, arrival, bytes, request.Next<std::vector<faults::ReceiveMark>>());
        return;
      }
      case Message::kGrant: {
        const auto now = request.Next<BootTime>();
        answer(client->Grant(now, request.Next<BootTime>()));
        return;
      }
      case Message::kCommand: {
        const auto commands = request.Next<std::vector<faults::DeviceCommand>>();
        client->Command(commands, request.Next<Origin>());
        return;
      }
      case Message::kAddCommands:
        answer(client->Add(request.Next<std::vector<faults::DeviceCommand>>()));
        return;
      case Message::kStatus:
        answer(client->Status());
        return;
      case Message::kSample:
        answer(client->Sample());
        return;
      default:
        ThrowUnexpected();
    }
  });
}

}  // namespace tiltproof::harness
