// Content of a Bus, for publisher.cpp and subscriber.cpp. Internal to this folder.
#pragma once

#include <atomic>
#include <cstdint>

#include "harness/dds/bus.h"
#include "harness/dds/qos.h"
#include "harness/dds/wire.h"

namespace tiltproof::dds {

struct Bus::Impl {
  dds_entity_t domain = 0;
  dds_entity_t participant = 0;

  // A topic of this participant with the QoS of its row in the table. Throws std::runtime_error.
  dds_entity_t CreateTopic(const TopicQos& qos, const dds_topic_descriptor_t& descriptor) const;
};

// DDS waits for callbacks that run when an entity's listener is taken away, with locks that the thread sanitizer does
// not see. Counted here, what they have read happens before the entity is freed, for the sanitizer too.
class Callbacks {
 public:
  template <class Callback>
  void Run(const Callback& callback) {
    callback();
    ended_count_.fetch_add(1, std::memory_order_release);
  }
  // After dds_set_listener(entity, nullptr).
  void AllEnded() const { (void)ended_count_.load(std::memory_order_acquire); }

 private:
  std::atomic<std::int64_t> ended_count_ = 0;
};

// The participant of a publisher or subscriber, as DDS describes it.
Participant ParticipantOf(const dds_builtintopic_endpoint_t& endpoint);

// QoS of the writers and readers of a topic.
QosPtr MakeQos(const TopicQos& topic);

}  // namespace tiltproof::dds
