#include "harness/dds/qos.h"

#include "harness/dds/topics.h"

namespace tiltproof::dds {
namespace {

template <class T>
constexpr TopicQos kQos{};
#define TILTPROOF_QOS(T, name, ...) \
  template <>                       \
  constexpr TopicQos kQos<T> = {.topic = "tiltproof/" name, .type = #T, __VA_ARGS__};
TILTPROOF_DDS_TOPICS(TILTPROOF_QOS)
#undef TILTPROOF_QOS

std::string InWords(const TopicQos& t) {
  std::string text = "RELIABLE";
  text += t.for_latecomers ? ", TRANSIENT_LOCAL" : ", VOLATILE";
  text += t.keep_all ? ", KEEP_ALL" : ", KEEP_LAST 1";
  if (t.deadline_ns != 0) text += ", DEADLINE " + std::to_string(t.deadline_ns / kNsPerMs) + " ms";
  if (t.lease_ns != 0) text += ", MANUAL_BY_TOPIC lease " + std::to_string(t.lease_ns / kNsPerMs) + " ms";
  if (t.log) text += "; each sequence once, gaps found";
  return text;
}

}  // namespace

template <class T>
const TopicQos& QosOf() {
  return kQos<T>;
}
#define TILTPROOF_INSTANTIATE(T, ...) template const TopicQos& QosOf<T>();
TILTPROOF_DDS_TOPICS(TILTPROOF_INSTANTIATE)
#undef TILTPROOF_INSTANTIATE

std::vector<TopicRow> TopicTable() {
  std::vector<TopicRow> rows;
  const auto add = [&rows](const TopicQos& t) {
    rows.push_back({std::string(t.topic), std::string(t.type), InWords(t), std::string(t.why)});
  };
#define TILTPROOF_ADD(T, ...) add(kQos<T>);
  TILTPROOF_DDS_TOPICS(TILTPROOF_ADD)
#undef TILTPROOF_ADD
  return rows;
}

}  // namespace tiltproof::dds
