#include <algorithm>
#include <array>
#include <map>
#include <mutex>

#include "harness/dds/bus_impl.h"
#include "harness/dds/sequence_filter.h"

namespace tiltproof::dds {

template <class T>
struct Subscriber<T>::Impl {
  using Wire = typename WireOf<T>::Type;
  // Samples lent by DDS at a time: their memory is set aside at once, and some are large.
  static constexpr std::size_t kBatch = std::clamp<std::size_t>(262'144 / sizeof(Wire), 1, 64);

  // Beyond so many nodes, dead ones are forgotten.
  static constexpr std::size_t kNodesCountMax = 1024;

  std::function<void()> on_data;
  std::function<void()> on_liveliness;
  dds_entity_t topic = 0;
  dds_entity_t reader = 0;
  std::mutex mutex;
  SequenceFilter filter;                   // logs
  std::map<std::string, NodeLife> nodes;   // heartbeats, by node id
  std::map<std::string, Heartbeat> fresh;  // heartbeats that Take() has not returned, by node id

  ~Impl() {
    if (reader > 0) {
      dds_set_listener(reader, nullptr);  // waits for a callback that runs
      dds_delete(reader);
    }
    if (topic > 0) dds_delete(topic);
  }

  // Takes all that the reader holds, changes of an instance's state (without data) included.
  template <class Visit>
  void Drain(const Visit& visit) {
    for (;;) {
      std::array<void*, kBatch> samples{};
      std::array<dds_sample_info_t, kBatch> infos;
      const auto count = dds_take(reader, samples.data(), infos.data(), kBatch, kBatch);
      if (count < 0) Fail("cannot receive", count);
      if (count == 0) return;
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        visit(*static_cast<const Wire*>(samples[i]), infos[i]);
      }
      dds_return_loan(reader, samples.data(), count);
    }
  }

  std::vector<T> Take() {
    std::vector<T> messages;
    Drain([&](const Wire& wire, const dds_sample_info_t& info) {
      if (!info.valid_data) return;
      T message;
      Unpack(wire, message);
      if constexpr (Log<T>) {
        if (!filter.Pass(message.run_id, message.node_id, message.sequence)) return;
      }
      messages.push_back(std::move(message));
    });
    return messages;
  }

  // A writer whose lease ran out leaves its instance without writers; a message brings it back.
  void DrainHeartbeats() {
    if constexpr (std::same_as<T, Heartbeat>) {
      Drain([&](const Wire& wire, const dds_sample_info_t& info) {
        Heartbeat message;
        if (info.valid_data) {
          Unpack(wire, message);
          fresh[message.node_id] = message;
        } else {
          message.node_id = wire.node_id;  // only the key is there
        }
        auto& node = nodes[message.node_id];
        node.alive = info.instance_state == DDS_IST_ALIVE;
        if (info.valid_data || node.last.node_id.empty()) node.last = std::move(message);
      });
      for (auto node = nodes.begin(); nodes.size() > kNodesCountMax && node != nodes.end();) {
        node = node->second.alive ? std::next(node) : nodes.erase(node);
      }
    }
  }
};

template <class T>
Subscriber<T>::Subscriber(Bus& bus, const std::function<void()>& on_data,
                          const std::function<void()>& on_liveliness)
    : impl_(std::make_unique<Impl>()) {
  impl_->on_data = on_data;
  impl_->on_liveliness = on_liveliness;
  impl_->topic = bus.impl().CreateTopic(QosOf<T>(), WireOf<T>::Descriptor());
  const ListenerPtr listener(dds_create_listener(impl_.get()));
  if (impl_->on_data) {
    dds_lset_data_available(listener.get(),
                            [](dds_entity_t, void* impl) { static_cast<Impl*>(impl)->on_data(); });
  }
  if (impl_->on_liveliness) {
    dds_lset_subscription_matched(listener.get(),
                                  [](dds_entity_t, const dds_subscription_matched_status_t, void* impl) {
                                    static_cast<Impl*>(impl)->on_liveliness();
                                  });
    dds_lset_liveliness_changed(listener.get(),
                                [](dds_entity_t, const dds_liveliness_changed_status_t, void* impl) {
                                  static_cast<Impl*>(impl)->on_liveliness();
                                });
  }
  const auto qos = MakeQos(QosOf<T>());
  impl_->reader = dds_create_reader(bus.impl().participant, impl_->topic, qos.get(), listener.get());
  if (impl_->reader < 0) Fail("cannot create a subscriber", impl_->reader);
}

template <class T>
Subscriber<T>::~Subscriber() = default;

template <class T>
std::vector<T> Subscriber<T>::Take() {
  const std::lock_guard lock(impl_->mutex);
  if constexpr (std::same_as<T, Heartbeat>) {
    impl_->DrainHeartbeats();
    std::vector<T> messages;
    for (auto& [node_id, heartbeat] : impl_->fresh) messages.push_back(std::move(heartbeat));
    impl_->fresh.clear();
    return messages;
  } else {
    return impl_->Take();
  }
}

template <class T>
int Subscriber<T>::MatchedCount() const {
  dds_subscription_matched_status_t status{};
  if (const auto code = dds_get_subscription_matched_status(impl_->reader, &status); code < 0) {
    Fail("cannot count publishers", code);
  }
  return static_cast<int>(status.current_count);
}

template <class T>
std::vector<NodeLife> Subscriber<T>::Nodes() const requires std::same_as<T, Heartbeat> {
  const std::lock_guard lock(impl_->mutex);
  impl_->DrainHeartbeats();
  std::vector<NodeLife> nodes;
  for (const auto& [node_id, node] : impl_->nodes) nodes.push_back(node);
  return nodes;
}

template <class T>
std::vector<SequenceGap> Subscriber<T>::Gaps() const requires Log<T> {
  const std::lock_guard lock(impl_->mutex);
  return impl_->filter.Gaps();
}

template <class T>
std::int64_t Subscriber<T>::CompleteUpTo(const std::string& run_id,
                                         const std::string& node_id) const requires Log<T> {
  const std::lock_guard lock(impl_->mutex);
  return impl_->filter.CompleteUpTo(run_id, node_id);
}

template <class T>
std::int64_t Subscriber<T>::MissedDeadlinesCount() const requires RealTime<T> {
  dds_requested_deadline_missed_status_t status{};
  if (const auto code = dds_get_requested_deadline_missed_status(impl_->reader, &status); code < 0) {
    Fail("cannot count missed deadlines", code);
  }
  return status.total_count;
}

#define TILTPROOF_INSTANTIATE(T) template class Subscriber<T>;
TILTPROOF_DDS_TOPICS(TILTPROOF_INSTANTIATE)
#undef TILTPROOF_INSTANTIATE

}  // namespace tiltproof::dds
