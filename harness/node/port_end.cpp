#include "harness/node/port_end.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "link/serial_devices.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {
namespace {

// Period at which an emulator gets the bytes on their way: every ten or so at 921600 baud. The bytes of a frame
// arrive within kFrameTimeMax before its end.
constexpr TimeNs kHandOverPeriodNs = 100 * kNsPerUs;
constexpr TimeNs kFrameTimeMax = 2 * kNsPerMs;

}  // namespace

void PortEnd::Open(NodeServices& services, const Place& place, Ports& ports) {
  const std::string& device = place.device;
  if (link::IsSocketName(device)) {
    if (const auto trouble = link::SocketTrouble(device)) throw std::runtime_error(*trouble);
    socket_name = device;
    ports.push_back({place.name, device});
  } else if (!device.empty()) {
    serial = std::make_unique<link::SerialPort>(services.loop(), device, place.baud, place.character);
    line = serial.get();
    ports.push_back({place.name, device});
    const auto latency = serial->SetLowLatency();
    if (!latency.advice.empty())
      services.Note(0, "adapter", fmt::format("{}: {}", device, latency.advice), place.client);
  } else if (place.for_emulator) {
    socket = std::make_unique<link::SocketLine>(services.loop());
    line = socket.get();
    ports.push_back({place.name, socket->name()});
  } else {
    pty = std::make_unique<link::Pty>(services.loop());
    line = &pty->master();
    ports.push_back({place.name, pty->slave_path()});
  }
}

void PortEnd::ConnectSocket(boost::asio::io_context& loop) {
  if (socket_name.empty()) return;
  serial = std::make_unique<link::SerialPort>(loop, socket_name, LinkSpec::kDefaultBaud);
  line = serial.get();
}

BootTime NextHandOver(BootTime arrival, bool takes_bytes, BootTime now) {
  if (arrival == BootTime::Never() || !takes_bytes) return arrival;
  return std::min(arrival, std::max(now + kHandOverPeriodNs, arrival - kFrameTimeMax));
}

}  // namespace tiltproof::harness
