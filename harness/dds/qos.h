// The one table of topics: name, type and quality of service of each, for the code and for the documentation.
//
// Publisher and Subscriber take their QoS from here, so both sides always agree, and so does the page that
// TopicTable() generates.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "harness/dds/messages.h"
#include "link/time.h"

namespace tiltproof::dds {

// All topics are RELIABLE, with destination order by reception, shared ownership and no autodispose: a node
// that leaves does not take back what it said.
struct TopicQos {
  std::string_view topic;
  std::string_view type;
  bool for_latecomers = false;  // TRANSIENT_LOCAL, else VOLATILE
  bool keep_all = false;        // KEEP_ALL, else KEEP_LAST 1 of each instance
  bool log = false;             // subscribers drop repeats and find gaps by the sequence
  // Messages of an instance with KEEP_LAST that a subscriber that hears everybody holds. So the messages of two
  // publishers under one name do not displace each other.
  int heard_depth = 1;
  TimeNs deadline_ns = 0;  // 0 = none
  TimeNs lease_ns = 0;     // MANUAL_BY_TOPIC liveliness with this lease; 0 = AUTOMATIC without end
  std::string_view why;
};

// QoS of the topic of one of the messages in messages.h.
template <class T>
const TopicQos& QosOf();

// One row a topic, in words.
struct TopicRow {
  std::string topic{};
  std::string type{};
  std::string qos{};
  std::string why{};
};
std::vector<TopicRow> TopicTable();

// A writer never waits for a slow reader: beyond this much unacknowledged data of one topic it refuses.
inline constexpr std::int64_t kUnackedBytesMax = 67'108'864;
// Who is silent for so long is taken off the list of participants. Longer than any cut of the network that
// volatile logs must survive.
inline constexpr TimeNs kParticipantLeaseNs = 10 * kNsPerS;
inline constexpr TimeNs kHeartbeatLeaseNs = 200 * kNsPerMs;
inline constexpr TimeNs kHeartbeatPeriodNs = 50 * kNsPerMs;

}  // namespace tiltproof::dds
