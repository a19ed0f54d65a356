#include "harness/run/remote/distributed_flight.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "harness/process/child_process.h"
#include "harness/run/introduction.h"
#include "harness/run/remote/remote_parts.h"

namespace tiltproof::harness {
namespace {

// One part of a flight in a process of its own: what it is (`tiltproof node KIND`), and its name among the others.
struct Part {
  std::string kind, name;
};

// The link and the client of each of the scenario's clients: "link" and "client", or of several "link-a", "client-a".
Part PartOf(const Scenario& scenario, const std::string& kind, std::size_t client) {
  Part part{kind, kind};
  if (scenario.has_several_clients()) part.name.append("-").append(scenario.client_id(client));
  return part;
}

// The processes and the channels to them.
class Parts {
 public:
  Parts(const DistributedOptions& options, const std::vector<Part>& parts) {
    if (options.transport == Transport::kSocket) {
      for (const Part& part : parts) StartOnSocket(options, part);
    } else {
      StartOnBus(options, parts);
    }
  }
  ~Parts() {
    for (const auto& channel : channels_) {
      try {
        channel->Send(RemotePart::Request(Message::kQuit).bytes());
      } catch (const std::exception&) {
        // It is gone, as it should be.
      }
    }
  }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  // In the order of the parts.
  Channel& operator[](std::size_t part) { return *channels_.at(part); }

 private:
  void StartOnSocket(const DistributedOptions& options, const Part& part) {
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
      throw std::runtime_error(fmt::format("cannot make a socket pair: {}", std::strerror(errno)));
    ChildSpec spec;
    spec.command = {options.program, "node", part.kind, "--lockstep", "socket"};
    spec.descriptors = {ends[1]};
    try {
      processes_.push_back(std::make_unique<ChildProcess>(spec));
    } catch (...) {
      for (const int end : ends) close(end);
      throw;
    }
    close(ends[1]);
    channels_.push_back(MakeUnixChannel(ends[0], processes_.back()->pid()));
  }

  void StartOnBus(const DistributedOptions& options, const std::vector<Part>& parts) {
    const std::string& run_id = options.place.run_id;
    bus_.emplace(LockstepBus(options.place.domain, options.place.tag));
    std::vector<Introduction> introductions(parts.size());
    std::vector<DdsPeer> peers;
    for (const Part& part : parts) {
      ChildSpec spec;
      Introduction& introduction = introductions[peers.size()];
      spec.command = {options.program,
                      "node",
                      part.kind,
                      "--name",
                      part.name,
                      "--lockstep",
                      "dds",
                      "--domain",
                      std::to_string(options.place.domain),
                      "--tag",
                      options.place.tag,
                      "--child",
                      ToText(bus_->participant())};
      spec.descriptors = {introduction.child_end()};
      processes_.push_back(std::make_unique<ChildProcess>(spec));
      introduction.Started();
      peers.push_back({part.name, processes_.back()->pid(), processes_.back()->pidfd(), {}});
    }
    for (std::size_t i = 0; i < peers.size(); ++i)
      peers[i].participant = introductions[i].Await(peers[i].pid, peers[i].pidfd);
    channels_ = MakeDdsChannels(*bus_, run_id, peers);
  }

  std::vector<std::unique_ptr<ChildProcess>> processes_;
  std::optional<dds::Bus> bus_;
  std::vector<std::unique_ptr<Channel>> channels_;
};

}  // namespace

RunLog FlyDistributed(const Scenario& scenario, const VehicleSignals& vehicle,
                      const DistributedOptions& options) {
  std::vector<Part> all = {{"plant", "plant"}};
  for (std::size_t i = 0; i < scenario.client_count(); ++i)
    for (const char* kind : {"link", "client"}) all.push_back(PartOf(scenario, kind, i));
  Parts parts(options, all);
  const auto setup = [&](std::size_t client) {
    return Setup{options.scenario_yaml, ToText(options.clients.at(client)), client, false};
  };
  LogBuilder records(scenario, vehicle);
  RemotePlantServer plant(parts[0], setup(0), records);
  std::deque<RemoteLine> remote_lines;
  std::vector<Line*> lines;
  for (std::size_t i = 0; i < scenario.client_count(); ++i)
    lines.push_back(&remote_lines.emplace_back(parts[1 + 2 * i], setup(i), *scenario.link.protocol, records));
  FlightOptions flight;
  flight.make_client = [&](std::size_t client, ClientHost host) {
    return MakeRemoteClient(parts[2 + 2 * client], setup(client), std::move(host));
  };
  flight.progress_ns = options.progress_ns;
  flight.interrupted = options.interrupted;
  RunLog log = Conduct(scenario, lines, plant, records, flight);
  if (options.transport == Transport::kDds) TellPlace(log, options.place);
  return log;
}

RunLog FlyClientsApart(const Scenario& scenario, const plant::VehicleModel& model,
                       const DistributedOptions& options, FlightOptions flight) {
  std::vector<Part> all;
  for (std::size_t i = 0; i < scenario.client_count(); ++i) all.push_back(PartOf(scenario, "client", i));
  Parts parts(options, all);
  const bool steered = static_cast<bool>(flight.steer);
  flight.make_client = [&](std::size_t client, ClientHost host) {
    return MakeRemoteClient(parts[client],
                            Setup{options.scenario_yaml, ToText(options.clients.at(client)), client, steered},
                            std::move(host));
  };
  return Fly(scenario, model, flight);
}

}  // namespace tiltproof::harness
