// Messages between nodes: whatever bytes come over the bus are refused by DDS or become a message, which keeps all its
// limits and is the same after it was sent again.
//
// Input: the topic, the byte order (bit 0: the other one), and the sample as it is on the wire.
#include <dds/ddsi/ddsi_cdrstream.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "harness/dds/wire.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using tiltproof::testing::Require;
namespace dds = tiltproof::dds;

// A sample whose memory is DDS's.
template <class T>
class Received {
 public:
  Received() = default;
  ~Received() { dds_stream_free_sample(&wire_, Ops()); }
  Received(const Received&) = delete;
  Received& operator=(const Received&) = delete;

  static const std::uint32_t* Ops() { return dds::WireOf<T>::Descriptor().m_ops; }
  // False when DDS would drop it.
  bool Read(std::vector<std::uint8_t> bytes, bool other_order, std::uint32_t version) {
    const auto size = static_cast<std::uint32_t>(bytes.size());
    std::uint32_t used = 0;
    if (dds_stream_normalize_data(reinterpret_cast<char*>(bytes.data()), &used, size, other_order, version,
                                  Ops()) == nullptr)
      return false;
    dds_istream_t stream;
    dds_istream_init(&stream, used, bytes.data(), version);
    dds_stream_read(&stream, reinterpret_cast<char*>(&wire_), Ops());
    dds_istream_fini(&stream);
    return true;
  }
  const typename dds::WireOf<T>::Type& wire() const { return wire_; }

 private:
  typename dds::WireOf<T>::Type wire_{};
};

template <class T>
void Check(std::vector<std::uint8_t> bytes, std::uint8_t order) {
  // As publishers of this program write the type.
  const std::uint32_t version = dds_stream_minimum_xcdr_version(Received<T>::Ops());
  const auto received = std::make_unique<Received<T>>();
  if (bytes.empty() || !received->Read(std::move(bytes), (order & 1) != 0, version)) return;
  T message;
  dds::Unpack(received->wire(), message);
  typename dds::WireOf<T>::Type sent{};
  dds::Arena arena;
  dds::Pack(message, sent, arena);  // throws when a limit does not hold
  T again;
  dds::Unpack(sent, again);
  Require(again == message || !(message == message), "a message is the same after it was sent again");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::vector<std::uint8_t> bytes(data + 2, data + size);
  int topic = 0;
  const int topics_count = static_cast<int>(dds::TopicTable().size());
#define TILTPROOF_CHECK(T, ...) \
  if (topic++ == data[0] % topics_count) Check<dds::T>(bytes, data[1]);
  TILTPROOF_DDS_TOPICS(TILTPROOF_CHECK)
#undef TILTPROOF_CHECK
  return 0;
}
