#include "harness/run/remote/distributed_flight.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "harness/process/child_process.h"
#include "harness/run/flight.h"
#include "harness/run/introduction.h"
#include "harness/run/remote/remote_parts.h"

namespace tiltproof::harness {
namespace {

constexpr std::array kParts = {"link", "plant", "client"};

// The three processes and the channels to them, in the order of kParts.
class Parts {
 public:
  explicit Parts(const DistributedOptions& options) {
    if (options.transport == Transport::kSocket) {
      for (const char* part : kParts) StartOnSocket(options, part);
    } else {
      StartOnBus(options);
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

  Channel& link() { return *channels_[0]; }
  Channel& plant() { return *channels_[1]; }
  Channel& client() { return *channels_[2]; }

 private:
  void StartOnSocket(const DistributedOptions& options, const char* part) {
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
      throw std::runtime_error(fmt::format("cannot make a socket pair: {}", std::strerror(errno)));
    ChildSpec spec;
    spec.command = {options.program, "node", part, "--lockstep", "socket"};
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

  void StartOnBus(const DistributedOptions& options) {
    const std::string& run_id = options.place.run_id;
    bus_.emplace(LockstepBus(options.place.domain, options.place.tag));
    std::vector<Introduction> introductions(kParts.size());
    std::vector<DdsPeer> peers;
    for (const char* part : kParts) {
      ChildSpec spec;
      Introduction& introduction = introductions[peers.size()];
      spec.command = {options.program,
                      "node",
                      part,
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
      peers.push_back({part, processes_.back()->pid(), processes_.back()->pidfd(), {}});
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

RunLog FlyDistributed(const Scenario& scenario, const DistributedOptions& options) {
  Parts parts(options);
  const Setup setup{options.scenario_yaml, options.firmware};
  RemoteLine line(parts.link(), setup);
  RemotePlantServer plant(parts.plant(), setup);
  FlightOptions flight;
  flight.make_client = [&](ClientHost host) {
    return MakeRemoteClient(parts.client(), setup, std::move(host));
  };
  flight.progress_ns = options.progress_ns;
  flight.interrupted = options.interrupted;
  RunLog log = Conduct(scenario, line, plant, flight);
  if (options.transport == Transport::kDds) TellPlace(log, options.place);
  return log;
}

}  // namespace tiltproof::harness
