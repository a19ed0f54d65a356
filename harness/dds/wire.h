// Between the plain structs of messages.h and the C structs that idlc makes of tiltproof.idl. Internal to
// this folder; with bus_impl.h the only header that shows DDS.
#pragma once

#include <dds/dds.h>

#include <memory>
#include <vector>

#include "harness/dds/messages.h"
#include "harness/dds/tiltproof.h"
#include "harness/dds/topics.h"

namespace tiltproof::dds {

template <class T>
struct WireOf;
#define TILTPROOF_WIRE_OF(T, ...)                                                      \
  template <>                                                                          \
  struct WireOf<T> {                                                                   \
    using Type = tiltproof_##T;                                                        \
    static const dds_topic_descriptor_t& Descriptor() { return tiltproof_##T##_desc; } \
  };
TILTPROOF_DDS_TOPICS(TILTPROOF_WIRE_OF)
#undef TILTPROOF_WIRE_OF

// Memory for the lists of one message on its way out.
using Arena = std::vector<std::shared_ptr<void>>;

// Fills `to`, whose lists then point into `from` and `arena`. Throws std::invalid_argument that names the
// member which exceeds its limit or holds a NUL byte.
template <class T>
void Pack(const T& from, typename WireOf<T>::Type& to, Arena& arena);

// `from` is as DDS delivers it: checked against the type's bounds.
template <class T>
void Unpack(const typename WireOf<T>::Type& from, T& to);

// "what: reason" for people, of a negative DDS return code.
[[noreturn]] void Fail(const char* what, dds_return_t code);

struct QosDelete {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using QosPtr = std::unique_ptr<dds_qos_t, QosDelete>;
struct ListenerDelete {
  void operator()(dds_listener_t* listener) const { dds_delete_listener(listener); }
};
using ListenerPtr = std::unique_ptr<dds_listener_t, ListenerDelete>;

}  // namespace tiltproof::dds
