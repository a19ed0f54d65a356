// The records of a real-time flight for programs of others: the topics serial_tap, fault_activation and run_event of
// harness/dds/tiltproof.idl. The harness makes them from the nodes' streams.
//
//   PublicLog log(bus, scenario, run_id);
//   log.Publish("link", records);
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>

#include "harness/dds/bus.h"
#include "harness/run/record.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

class PublicLog {
 public:
  // `scenario` must outlive it.
  PublicLog(dds::Bus& bus, const Scenario& scenario, std::string run_id);

  // The next records of a node, in order. A reader that has fallen too far behind misses them.
  void Publish(const std::string& node_id, std::span<const Record> records);

 private:
  // The sequence of the node's last message on each topic.
  struct Sequences {
    std::int64_t tap = 0, activation = 0, event = 0;
  };
  template <class T>
  T Begin(const std::string& node_id, std::int64_t& sequence) const;
  void PublishEvent(const std::string& node_id, TimeNs time_ns, const std::string& kind,
                    const std::string& text);
  void PublishActivation(const std::string& node_id, const faults::Activation& activation);
  void PublishTaps(const std::string& node_id, std::span<const Record> records);
  dds::Names FaultsOf(TimeNs begin_ns, const record::Bytes& bytes, std::span<const Record> records) const;

  const Scenario& scenario_;
  std::string run_id_;
  dds::Publisher<dds::SerialTap> taps_;
  dds::Publisher<dds::FaultActivation> activations_;
  dds::Publisher<dds::RunEvent> events_;
  std::map<std::string, Sequences> sequences_;
};

}  // namespace tiltproof::harness
