#include <algorithm>
#include <array>
#include <mutex>

#include "harness/dds/bus_impl.h"

namespace tiltproof::dds {
namespace {

// Largest number of subscribers of one topic that are looked at.
constexpr std::size_t kSubscribersCountMax = 1024;

}  // namespace

template <class T>
struct Publisher<T>::Impl {
  std::function<void()> on_match;
  Callbacks callbacks;
  dds_entity_t topic = 0;
  dds_entity_t writer = 0;
  // Outgoing messages are assembled here, without a new allocation each time.
  std::mutex mutex;
  std::unique_ptr<typename WireOf<T>::Type> wire = std::make_unique<typename WireOf<T>::Type>();
  Arena arena;

  ~Impl() {
    if (writer > 0) {
      dds_set_listener(writer, nullptr);  // waits for a callback that runs
      callbacks.AllEnded();
      dds_delete(writer);
    }
    if (topic > 0) dds_delete(topic);
  }

  const void* Assemble(const T& message) {
    arena.clear();
    try {
      Pack(message, *wire, arena);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(std::string(QosOf<T>().type) + "." + error.what());
    }
    return wire.get();
  }
};

template <class T>
Publisher<T>::Publisher(Bus& bus, const std::function<void()>& on_match) : impl_(std::make_unique<Impl>()) {
  impl_->on_match = on_match;
  impl_->topic = bus.impl().CreateTopic(QosOf<T>(), WireOf<T>::Descriptor());
  const ListenerPtr listener(dds_create_listener(impl_.get()));
  if (impl_->on_match) {
    dds_lset_publication_matched(listener.get(),
                                 [](dds_entity_t, const dds_publication_matched_status_t, void* argument) {
                                   auto* impl = static_cast<Impl*>(argument);
                                   impl->callbacks.Run([&] { impl->on_match(); });
                                 });
  }
  const auto qos = MakeQos(QosOf<T>());
  impl_->writer = dds_create_writer(bus.impl().participant, impl_->topic, qos.get(), listener.get());
  if (impl_->writer < 0) Fail("cannot create a publisher", impl_->writer);
}

template <class T>
Publisher<T>::~Publisher() = default;

template <class T>
bool Publisher<T>::Write(const T& message) {
  const std::lock_guard lock(impl_->mutex);
  const auto code = dds_write(impl_->writer, impl_->Assemble(message));
  if (code == DDS_RETCODE_TIMEOUT) return false;
  if (code < 0) Fail("cannot publish", code);
  return true;
}

template <class T>
int Publisher<T>::MatchedCount() const {
  dds_publication_matched_status_t status{};
  if (const auto code = dds_get_publication_matched_status(impl_->writer, &status); code < 0) {
    Fail("cannot count subscribers", code);
  }
  return static_cast<int>(status.current_count);
}

template <class T>
bool Publisher<T>::IsHeardBy(const Participant& participant) const {
  std::array<dds_instance_handle_t, kSubscribersCountMax> handles{};
  const auto count = dds_get_matched_subscriptions(impl_->writer, handles.data(), handles.size());
  if (count < 0) Fail("cannot list subscribers", count);
  for (std::size_t i = 0; i < std::min(static_cast<std::size_t>(count), handles.size()); ++i) {
    auto* endpoint = dds_get_matched_subscription_data(impl_->writer, handles[i]);
    if (endpoint == nullptr) continue;  // it has just left
    const bool is_it = ParticipantOf(*endpoint) == participant;
    dds_builtintopic_free_endpoint(endpoint);
    if (is_it) return true;
  }
  return false;
}

template <class T>
bool Publisher<T>::WaitForAcks(std::int64_t limit_ns) {
  const auto code = dds_wait_for_acks(impl_->writer, std::max<std::int64_t>(0, limit_ns));
  if (code == DDS_RETCODE_TIMEOUT) return false;
  if (code < 0) Fail("cannot wait for subscribers", code);
  return true;
}

template <class T>
void Publisher<T>::Retire(const T& message) {
  const std::lock_guard lock(impl_->mutex);
  const void* instance = impl_->Assemble(message);
  auto code = dds_dispose(impl_->writer, instance);
  if (code >= 0) code = dds_unregister_instance(impl_->writer, instance);
  if (code < 0 && code != DDS_RETCODE_PRECONDITION_NOT_MET && code != DDS_RETCODE_TIMEOUT) {
    Fail("cannot retire an instance", code);
  }
}

#define TILTPROOF_INSTANTIATE(T, ...) template class Publisher<T>;
TILTPROOF_DDS_TOPICS(TILTPROOF_INSTANTIATE)
#undef TILTPROOF_INSTANTIATE

}  // namespace tiltproof::dds
