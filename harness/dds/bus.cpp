#include "harness/dds/bus.h"

#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include "harness/dds/bus_impl.h"
#include "harness/dds/library_log.h"

namespace tiltproof::dds {
namespace {

constexpr int kDomainMax = 230;  // above, ports would exceed 65535
constexpr int kParticipantIndexMax = 100;
constexpr std::size_t kTagBytesMax = 64;
constexpr std::size_t kPeersCountMax = 64;
constexpr std::string_view kLoopback = "lo";

bool IsPlain(std::string_view text, std::string_view also) {
  return std::ranges::all_of(text, [also](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           also.find(c) != std::string_view::npos;
  });
}

void CheckInterface(const std::string& name) {
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) throw std::runtime_error("cannot list the network interfaces of this machine");
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(list, freeifaddrs);
  bool exists = false;
  bool up = false;
  bool has_ipv4 = false;
  std::string usable;
  for (const auto* i = list; i != nullptr; i = i->ifa_next) {
    const bool ipv4 = i->ifa_addr != nullptr && i->ifa_addr->sa_family == AF_INET;
    const bool is_up = (i->ifa_flags & IFF_UP) != 0;
    if (ipv4 && is_up) usable += std::string(usable.empty() ? "" : ", ") + i->ifa_name;
    if (name != i->ifa_name) continue;
    exists = true;
    up = up || is_up;
    has_ipv4 = has_ipv4 || ipv4;
  }
  const auto choose = "; usable here: " + (usable.empty() ? "none" : usable);
  if (!exists) throw std::runtime_error("no network interface '" + name + "' on this machine" + choose);
  if (!up) {
    throw std::runtime_error("network interface '" + name + "' is down: ip link set " + name + " up" +
                             choose);
  }
  if (!has_ipv4) throw std::runtime_error("network interface '" + name + "' has no IPv4 address" + choose);
}

void CheckPeer(const std::string& peer) {
  if (peer.empty() || peer.size() > 253 || !IsPlain(peer, ".-_")) {
    throw std::runtime_error("'" + peer + "' is not a host name or IPv4 address of a peer");
  }
  addrinfo hints{};
  hints.ai_family = AF_INET;
  addrinfo* found = nullptr;
  const int code = getaddrinfo(peer.c_str(), nullptr, &hints, &found);
  if (code != 0) {
    throw std::runtime_error("cannot find the peer '" + peer + "': " + gai_strerror(code) +
                             "; check the name, or give its IPv4 address");
  }
  freeaddrinfo(found);
}

void CheckConfig(const BusConfig& config) {
  if (config.domain < 0 || config.domain > kDomainMax) {
    throw std::runtime_error("DDS domain " + std::to_string(config.domain) + " is out of range: 0 to " +
                             std::to_string(kDomainMax));
  }
  if (config.tag.size() > kTagBytesMax || !IsPlain(config.tag, "_.-")) {
    throw std::runtime_error("DDS tag '" + config.tag + "': at most " + std::to_string(kTagBytesMax) +
                             " letters, digits, and _ . -");
  }
  if (!(config.xmit_loss >= 0 && config.xmit_loss <= 1)) {
    throw std::runtime_error("DDS packet loss must be a share from 0 to 1");
  }
  if (config.interface.empty() && !config.peers.empty()) {
    throw std::runtime_error("peers on other hosts need a network interface: name the one that leads there");
  }
  if (config.peers.size() > kPeersCountMax) {
    throw std::runtime_error("at most " + std::to_string(kPeersCountMax) + " peers");
  }
  CheckInterface(config.interface.empty() ? std::string(kLoopback) : config.interface);
  for (const auto& peer : config.peers) CheckPeer(peer);
}

// Discovery and data of one machine go over loopback, by unicast to every participant index, since loopback
// does not pass multicast; between hosts multicast finds the others, and data goes by unicast, so that with
// peers named a network without multicast serves as well.
std::string Xml(const BusConfig& config) {
  const bool local = config.interface.empty();
  std::string peers = local ? R"(<Peer address="127.0.0.1"/>)" : "";
  for (const auto& peer : config.peers) peers += R"(<Peer address=")" + peer + R"("/>)";
  const auto interface = local ? std::string(kLoopback) : config.interface;
  const auto unacked_max = std::to_string(kUnackedBytesMax) + " B";
  return R"(<CycloneDDS><Domain id="any">)"
         "<General><Interfaces><NetworkInterface name=\"" +
         interface + "\"" + (local ? R"( multicast="false")" : "") + "/></Interfaces><AllowMulticast>" +
         (local ? "false" : "spdp") + "</AllowMulticast>" +
         // Loopback takes datagrams of 64 KB: hardly any message then needs fragments, which are slow to repair.
         (local ? "<MaxMessageSize>65000 B</MaxMessageSize><FragmentSize>60000 B</FragmentSize>" : "") +
         "</General>"
         "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>" +
         std::to_string(kParticipantIndexMax) + "</MaxAutoParticipantIndex>" +
         (peers.empty() ? "" : "<Peers>" + peers + "</Peers>") + "<Tag>" + config.tag +
         "</Tag><SPDPInterval>500 ms</SPDPInterval><LeaseDuration>" +
         std::to_string(config.lease_ns / kNsPerMs) +
         " ms</LeaseDuration></Discovery>"
         "<Internal><Watermarks><WhcAdaptive>false</WhcAdaptive><WhcHigh>" +
         unacked_max + "</WhcHigh><WhcHighInit>" + unacked_max +
         "</WhcHighInit></Watermarks>"
         // The defaults repeat a question about what is missing after 100 ms and more, and in lists of fragments
         // each repeats only a few: a backlog after a cut would take seconds.
         R"(<HeartbeatInterval min="5 ms" minsched="10 ms" max="100 ms">20 ms</HeartbeatInterval>)"
         "<NackDelay>10 ms</NackDelay><AutoReschedNackDelay>200 ms</AutoReschedNackDelay>"
         "<Test><XmitLossiness>" +
         std::to_string(std::lround(config.xmit_loss * 1000)) +
         "</XmitLossiness></Test></Internal>"
         "<SharedMemory><Enable>false</Enable></SharedMemory></Domain></CycloneDDS>";
}

void Create(const BusConfig& config, Bus::Impl& impl) {
  // The library says on its log why a domain cannot be created: that becomes part of the exception.
  const LibraryCapture log;
  const auto where = "DDS domain " + std::to_string(config.domain);
  impl.domain = dds_create_domain(static_cast<dds_domainid_t>(config.domain), Xml(config).c_str());
  if (impl.domain == DDS_RETCODE_PRECONDITION_NOT_MET) {
    throw std::runtime_error("this process is already on " + where +
                             ": share its Bus, or choose another domain");
  }
  if (impl.domain < 0) {
    throw std::runtime_error("cannot join " + where + " (at most " +
                             std::to_string(kParticipantIndexMax + 1) + " processes of one machine can)" +
                             log.text());
  }
  impl.participant = dds_create_participant(static_cast<dds_domainid_t>(config.domain), nullptr, nullptr);
  if (impl.participant < 0) {
    const auto code = impl.participant;
    dds_delete(impl.domain);
    throw std::runtime_error("cannot join " + where + ": " + dds_strretcode(code) + log.text());
  }
}

}  // namespace

void Fail(const char* what, dds_return_t code) {
  throw std::runtime_error(std::string("DDS: ") + what + ": " + dds_strretcode(code));
}

Bus::Bus(const BusConfig& config) : impl_(std::make_unique<Impl>()) {
  CheckConfig(config);
  Create(config, *impl_);
}

Bus::~Bus() {
  dds_delete(impl_->domain);
  PrintLibraryTotal();
}

Participant Bus::participant() const {
  dds_guid_t guid;
  if (const auto code = dds_get_guid(impl_->participant, &guid); code < 0)
    Fail("cannot tell who we are", code);
  Participant participant;
  std::copy(std::begin(guid.v), std::end(guid.v), participant.guid.begin());
  return participant;
}

Participant ParticipantOf(const dds_builtintopic_endpoint_t& endpoint) {
  Participant participant;
  const auto& guid = endpoint.participant_key.v;
  std::copy(std::begin(guid), std::end(guid), participant.guid.begin());
  return participant;
}

void Bus::Partition(bool deaf, bool mute, std::int64_t duration_ns) {
  if (const auto code =
          dds_domain_set_deafmute(impl_->participant, deaf, mute, std::max<std::int64_t>(0, duration_ns));
      code < 0) {
    Fail("cannot cut the network", code);
  }
}

dds_entity_t Bus::Impl::CreateTopic(const TopicQos& qos, const dds_topic_descriptor_t& descriptor) const {
  const auto settings = MakeQos(qos);
  const auto topic =
      dds_create_topic(participant, &descriptor, std::string(qos.topic).c_str(), settings.get(), nullptr);
  if (topic < 0) Fail("cannot create a topic", topic);
  return topic;
}

QosPtr MakeQos(const TopicQos& topic) {
  QosPtr qos(dds_create_qos());
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos.get(),
                      topic.for_latecomers ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  const auto history = topic.keep_all ? DDS_HISTORY_KEEP_ALL : DDS_HISTORY_KEEP_LAST;
  dds_qset_history(qos.get(), history, 1);
  dds_qset_durability_service(qos.get(), 0, history, 1, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED,
                              DDS_LENGTH_UNLIMITED);
  dds_qset_resource_limits(qos.get(), DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  if (topic.deadline_ns != 0) dds_qset_deadline(qos.get(), topic.deadline_ns);
  if (topic.lease_ns != 0) dds_qset_liveliness(qos.get(), DDS_LIVELINESS_MANUAL_BY_TOPIC, topic.lease_ns);
  return qos;
}

}  // namespace tiltproof::dds
