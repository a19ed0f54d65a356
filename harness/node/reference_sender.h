// Sends a reference to the firmware: framed on the second serial line when this node shares a host with the
// link node, otherwise over the bus to the link node, which has the cable.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "harness/node/node.h"
#include "harness/run/reference_frame.h"
#include "link/serial_port.h"

namespace tiltproof::harness {

class ReferenceSender {
 public:
  explicit ReferenceSender(NodeServices& services) : services_(services), references_(services.bus()) {}

  // One port for each link node, "base_station" or "base_station-<client>". Without any: over the bus.
  void Open(const Ports& ports, std::shared_ptr<const link::Protocol> protocol) {
    protocol_ = std::move(protocol);
    framer_.emplace(*protocol_);
    for (const dds::Port& port : ports) {
      if (!port.name.starts_with("base_station")) continue;
      auto& opened = ports_.emplace_back(
          std::make_unique<link::SerialPort>(services_.loop(), port.path, LinkSpec::kDefaultBaud));
      opened->Start([](std::span<const std::uint8_t>) {},
                    [this](const std::string& reason) {
                      services_.Fail(EndReason::kNodeLost, "the reference line is gone: " + reason);
                    });
    }
  }

  void Send(TimeNs time_ns, const ReferencePoint& reference) {
    if (!ports_.empty()) {
      if (const auto frame = framer_->Frame(reference, services_.clock().Now()); !frame.empty())
        for (const auto& port : ports_) port->Write(frame);
      return;
    }
    dds::Reference out;
    out.run_id = services_.run_id();
    out.node_id = "base_station";
    out.sequence = ++sequence_;
    out.time_ns = time_ns;
    out.values = ToRow(reference);
    references_.Write(out);
  }

  void Close() { ports_.clear(); }

 private:
  NodeServices& services_;
  dds::Publisher<dds::Reference> references_;
  std::shared_ptr<const link::Protocol> protocol_;
  std::optional<ReferenceFramer> framer_;  // of it
  std::vector<std::unique_ptr<link::SerialPort>> ports_;
  std::int64_t sequence_ = 0;
};

}  // namespace tiltproof::harness
