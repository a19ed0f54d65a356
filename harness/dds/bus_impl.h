// What a Bus holds, for publisher.cpp and subscriber.cpp. Internal to this folder.
#pragma once

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

// Of a publisher or subscriber, as DDS describes it.
Participant ParticipantOf(const dds_builtintopic_endpoint_t& endpoint);

// QoS of the writers and readers of a topic.
QosPtr MakeQos(const TopicQos& topic);

}  // namespace tiltproof::dds
