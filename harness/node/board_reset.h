// Resets a board before its flight, so that suites run unattended: by a command of the user's, or by a modem line of the
// board's serial adapter that is wired to the board's reset pin.
//
//   BoardReset reset(services, "st-flash reset", port, [&] { Listen(); }, [&](const std::string& why) { Fail(why); });
//
// A modem line goes off, on for kPulse, and off again, which resets both a board that is wired directly (held in reset
// while the line is on) and one behind a capacitor (reset by the change).
#pragma once

#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "harness/node/firmware_process.h"
#include "harness/node/node.h"
#include "link/serial_port.h"

namespace tiltproof::harness {

class BoardReset {
 public:
  static constexpr std::chrono::milliseconds kPulse{100};
  static constexpr std::chrono::seconds kCommandLimit{20};

  // `how`: "dtr", "rts", or a command for sh -c (harness/scenario/client_spec.h). The loop calls `done` when the modem line
  // is off again, or the command has ended; or `failed`, with the reason, which may destroy this. A modem line that the
  // device does not have throws std::runtime_error. `port` must outlive this.
  BoardReset(NodeServices& services, const std::string& how, link::SerialPort& port,
             std::function<void()> done, std::function<void(const std::string& why)> failed);

 private:
  void Pulse(link::SerialPort& port, link::ModemLine line, bool on);
  void Run(const std::string& command);
  void Fail(const std::string& why);

  NodeServices& services_;
  std::string how_;
  std::function<void()> done_;
  std::function<void(const std::string&)> failed_;
  boost::asio::steady_timer timer_;
  std::unique_ptr<FirmwareProcess> command_;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
};

}  // namespace tiltproof::harness
