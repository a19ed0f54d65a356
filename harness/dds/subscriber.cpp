#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "harness/dds/bus_impl.h"
#include "harness/dds/lease.h"
#include "harness/dds/sequence_filter.h"
#include "link/check.h"

namespace tiltproof::dds {

template <class T>
struct Subscriber<T>::Impl {
  using Wire = typename WireOf<T>::Type;
  // Samples lent by DDS at a time: their memory is set aside at once, and some are large.
  static constexpr std::size_t kBatch = std::clamp<std::size_t>(262'144 / sizeof(Wire), 1, 64);

  // Beyond so many nodes, dead ones are forgotten, and beyond so many publishers those that left.
  static constexpr std::size_t kNodesCountMax = 1024, kWritersCountMax = 4096;

  // A publisher, from the match on. One that left may still have messages here.
  struct Writer {
    Participant participant;
    bool matched = false;
    Lease lease;
  };
  struct Node {
    NodeLife life;
    dds_instance_handle_t writer = 0;
  };

  std::function<void()> on_data;
  std::function<void()> on_liveliness;
  Callbacks callbacks;
  const Circle* circle = nullptr;
  bool onlooker = false;
  // Messages that wait for an onlooker: a quarter of a minute of a node's rows.
  static constexpr int kOnlookerDepth = 256;
  dds_entity_t topic = 0;
  dds_entity_t reader = 0;
  std::mutex mutex;
  SequenceFilter filter;              // logs
  std::map<Participant, Node> nodes;  // heartbeats
  // Heartbeats that Take() has not returned, by sender and node id.
  std::map<std::pair<Participant, std::string>, Heartbeat> fresh;
  // By DDS's handle. No call into DDS under this mutex: DDS calls IsAdmitted() under locks of its own.
  mutable std::mutex writers_mutex;
  std::map<dds_instance_handle_t, Writer> writers;

  ~Impl() {
    if (reader > 0) {
      dds_set_listener(reader, nullptr);  // waits for a callback that runs
      callbacks.AllEnded();
      dds_delete(reader);
    }
    if (topic > 0) dds_delete(topic);
  }

  // In threads of DDS

  void OnMatch(dds_entity_t self, const dds_subscription_matched_status_t& status) {
    const auto handle = status.last_publication_handle;
    if (status.current_count_change > 0) {
      Learn(self, handle);
    } else {
      const std::lock_guard lock(writers_mutex);
      if (const auto found = writers.find(handle); found != writers.end()) found->second.matched = false;
    }
    if (on_liveliness) on_liveliness();
  }
  void OnLiveliness(const dds_liveliness_changed_status_t& status) {
    {
      const std::lock_guard lock(writers_mutex);
      if (const auto found = writers.find(status.last_publication_handle); found != writers.end())
        found->second.lease.Say(status.alive_count_change > 0);
    }
    if (on_liveliness) on_liveliness();
  }
  // Before a message is kept: what comes from others must not take the place of what counts, nor memory. One that is
  // not known yet is judged when its message is taken.
  bool IsAdmitted(dds_instance_handle_t handle) const {
    const std::lock_guard lock(writers_mutex);
    const auto found = writers.find(handle);
    return found == writers.end() || circle->NodeId(found->second.participant).has_value();
  }

  // A publisher that is there.
  std::optional<Participant> Learn(dds_entity_t self, dds_instance_handle_t handle) {
    auto* endpoint = dds_get_matched_publication_data(self, handle);
    if (endpoint == nullptr) return std::nullopt;
    const Participant participant = ParticipantOf(*endpoint);
    dds_builtintopic_free_endpoint(endpoint);
    const std::lock_guard lock(writers_mutex);
    for (auto writer = writers.begin(); writers.size() >= kWritersCountMax && writer != writers.end();)
      writer = writer->second.matched ? std::next(writer) : writers.erase(writer);
    writers[handle] = {participant, true, {}};
    return participant;
  }
  std::optional<Participant> Sender(dds_instance_handle_t handle) {
    {
      const std::lock_guard lock(writers_mutex);
      if (const auto found = writers.find(handle); found != writers.end()) return found->second.participant;
    }
    return Learn(reader, handle);
  }
  bool IsAlive(dds_instance_handle_t handle, Lease::Clock::time_point now) const {
    const std::lock_guard lock(writers_mutex);
    const auto found = writers.find(handle);
    return found != writers.end() && found->second.matched && found->second.lease.IsKept(now);
  }
  void Hear(dds_instance_handle_t handle, Lease::Clock::time_point now) {
    const std::lock_guard lock(writers_mutex);
    if (const auto found = writers.find(handle); found != writers.end()) found->second.lease.Hear(now);
  }

  // Takes what the reader holds, but not much more than `count_max`. False when there may be more.
  template <class Visit>
  bool Drain(std::size_t count_max, const Visit& visit) {
    for (std::size_t taken = 0; taken < count_max;) {
      std::array<void*, kBatch> samples{};
      std::array<dds_sample_info_t, kBatch> infos;
      const auto count = dds_take(reader, samples.data(), infos.data(), kBatch, kBatch);
      if (count < 0) Fail("cannot receive", count);
      if (count == 0) return true;
      Check(static_cast<std::size_t>(count) <= kBatch, "DDS returns no more samples than were asked for");
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        // Changes of an instance's state come without data.
        if (infos[i].valid_data) visit(*static_cast<const Wire*>(samples[i]), infos[i]);
      }
      dds_return_loan(reader, samples.data(), count);
      taken += static_cast<std::size_t>(count);
    }
    return false;
  }

  std::vector<From<T>> Take() {
    std::vector<From<T>> messages;
    const bool all = Drain(kTakeCountMax, [&](const Wire& wire, const dds_sample_info_t& info) {
      const auto sender = Sender(info.publication_handle);
      if (!sender) return;  // it left before we could learn who it was
      const auto node_id = circle != nullptr ? circle->NodeId(*sender) : std::nullopt;
      if (circle != nullptr && !node_id) return;
      T message;
      Unpack(wire, message);
      if constexpr (OfSpeaker<T>) {
        if (node_id && !node_id->empty() && message.node_id != *node_id) return;
      }
      if constexpr (Log<T>) {
        if (!filter.Pass(message.run_id, message.node_id, message.sequence)) return;
      }
      messages.push_back({*sender, std::move(message)});
    });
    if (!all && on_data) on_data();
    return messages;
  }

  // Judges each writer by its own heartbeats, not by the instance, which any process can write to and dispose of.
  void DrainHeartbeats() {
    if constexpr (std::same_as<T, Heartbeat>) {
      const auto now = Lease::Clock::now();
      Drain(kTakeCountMax, [&](const Wire& wire, const dds_sample_info_t& info) {
        const auto sender = Sender(info.publication_handle);
        if (!sender) return;
        Hear(info.publication_handle, now);
        Heartbeat message;
        Unpack(wire, message);
        if (fresh.size() < kNodesCountMax) fresh[{*sender, message.node_id}] = message;
        nodes[*sender] = {{std::move(message), true, *sender}, info.publication_handle};
      });
      for (auto& [participant, node] : nodes) node.life.alive = IsAlive(node.writer, now);
      for (auto node = nodes.begin(); nodes.size() > kNodesCountMax && node != nodes.end();) {
        node = node->second.life.alive ? std::next(node) : nodes.erase(node);
      }
    }
  }

  void Begin(Bus& bus) {
    topic = bus.impl().CreateTopic(QosOf<T>(), WireOf<T>::Descriptor());
    if (circle != nullptr) {
      dds_topic_filter filter_by_sender{};
      filter_by_sender.mode = DDS_TOPIC_FILTER_SAMPLEINFO_ARG;
      filter_by_sender.f.sampleinfo_arg = [](const dds_sample_info_t* info, void* impl) {
        return static_cast<Impl*>(impl)->IsAdmitted(info->publication_handle);
      };
      filter_by_sender.arg = this;
      if (const auto code = dds_set_topic_filter_extended(topic, &filter_by_sender); code < 0)
        Fail("cannot choose whom to hear", code);
    }
    const ListenerPtr listener(dds_create_listener(this));
    if (on_data) {
      dds_lset_data_available(listener.get(), [](dds_entity_t, void* argument) {
        auto* impl = static_cast<Impl*>(argument);
        impl->callbacks.Run([&] { impl->on_data(); });
      });
    }
    dds_lset_subscription_matched(
        listener.get(),
        [](dds_entity_t self, const dds_subscription_matched_status_t status, void* argument) {
          auto* impl = static_cast<Impl*>(argument);
          impl->callbacks.Run([&] { impl->OnMatch(self, status); });
        });
    dds_lset_liveliness_changed(
        listener.get(), [](dds_entity_t, const dds_liveliness_changed_status_t status, void* argument) {
          auto* impl = static_cast<Impl*>(argument);
          impl->callbacks.Run([&] { impl->OnLiveliness(status); });
        });
    const auto qos = MakeQos(QosOf<T>());
    if (!QosOf<T>().keep_all) dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, QosOf<T>().heard_depth);
    if (onlooker) {
      dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
      dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
      dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kOnlookerDepth);
    }
    reader = dds_create_reader(bus.impl().participant, topic, qos.get(), listener.get());
    if (reader < 0) Fail("cannot create a subscriber", reader);
  }
};

template <class T>
Subscriber<T>::Subscriber(Bus& bus, const std::function<void()>& on_data,
                          const std::function<void()>& on_liveliness)
    : impl_(std::make_unique<Impl>()) {
  impl_->on_data = on_data;
  impl_->on_liveliness = on_liveliness;
  impl_->Begin(bus);
}

template <class T>
Subscriber<T>::Subscriber(Bus& bus, const Circle& circle, const std::function<void()>& on_data,
                          const std::function<void()>& on_liveliness)
    : impl_(std::make_unique<Impl>()) {
  impl_->on_data = on_data;
  impl_->on_liveliness = on_liveliness;
  impl_->circle = &circle;
  impl_->Begin(bus);
}

template <class T>
Subscriber<T>::Subscriber(Bus& bus, Onlooker, const std::function<void()>& on_data)
    : impl_(std::make_unique<Impl>()) {
  impl_->on_data = on_data;
  impl_->onlooker = true;
  impl_->Begin(bus);
}

template <class T>
Subscriber<T>::~Subscriber() = default;

template <class T>
std::vector<T> Subscriber<T>::Take() {
  const std::lock_guard lock(impl_->mutex);
  std::vector<T> messages;
  if constexpr (std::same_as<T, Heartbeat>) {
    impl_->DrainHeartbeats();
    for (auto& [sender, heartbeat] : impl_->fresh) messages.push_back(std::move(heartbeat));
    impl_->fresh.clear();
  } else {
    for (auto& [sender, message] : impl_->Take()) messages.push_back(std::move(message));
  }
  return messages;
}

template <class T>
std::vector<From<T>> Subscriber<T>::TakeWithSenders() requires(!std::same_as<T, Heartbeat>) {
  const std::lock_guard lock(impl_->mutex);
  return impl_->Take();
}

template <class T>
bool Subscriber<T>::Hears(const Participant& participant) const {
  const std::lock_guard lock(impl_->writers_mutex);
  return std::any_of(impl_->writers.begin(), impl_->writers.end(), [&](const auto& writer) {
    return writer.second.matched && writer.second.participant == participant;
  });
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
  for (const auto& [participant, node] : impl_->nodes) nodes.push_back(node.life);
  std::stable_sort(nodes.begin(), nodes.end(),
                   [](const NodeLife& a, const NodeLife& b) { return a.last.node_id < b.last.node_id; });
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

#define TILTPROOF_INSTANTIATE(T, ...) template class Subscriber<T>;
TILTPROOF_DDS_TOPICS(TILTPROOF_INSTANTIATE)
#undef TILTPROOF_INSTANTIATE

}  // namespace tiltproof::dds
