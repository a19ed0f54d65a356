#include "harness/node/board_reset.h"

#include <fmt/format.h>

#include <utility>

namespace tiltproof::harness {

BoardReset::BoardReset(NodeServices& services, const std::string& how, link::SerialPort& port,
                       std::function<void()> done, std::function<void(const std::string&)> failed)
    : services_(services),
      how_(how),
      done_(std::move(done)),
      failed_(std::move(failed)),
      timer_(services.loop()) {
  if (how != "dtr" && how != "rts") {
    Run(how);
    return;
  }
  const link::ModemLine line = how == "dtr" ? link::ModemLine::kDtr : link::ModemLine::kRts;
  port.SetModemLine(line, false);
  timer_.expires_after(kPulse);
  timer_.async_wait(
      [this, &port, line, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
        if (!error && !alive.expired()) Pulse(port, line, true);
      });
}

void BoardReset::Pulse(link::SerialPort& port, link::ModemLine line, bool on) {
  try {
    port.SetModemLine(line, on);
  } catch (const std::exception& error) {
    return Fail(error.what());
  }
  if (!on) return done_();
  timer_.expires_after(kPulse);
  timer_.async_wait(
      [this, &port, line, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
        if (!error && !alive.expired()) Pulse(port, line, false);
      });
}

void BoardReset::Run(const std::string& command) {
  ChildSpec spec;
  spec.command = {"/bin/sh", "-c", command};
  spec.guard_group = true;
  command_ = std::make_unique<FirmwareProcess>(services_, spec, [this](const std::string& how) {
    timer_.cancel();
    if (how == "exited with code 0") return done_();
    std::string said;
    for (const auto& line : command_->TakeLines()) said = line.text;
    Fail(fmt::format("{}{}{}", how, said.empty() ? "" : ": ", said));
  });
  timer_.expires_after(kCommandLimit);
  timer_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
    if (!error && !alive.expired()) Fail(fmt::format("has not ended within {} s", kCommandLimit.count()));
  });
}

void BoardReset::Fail(const std::string& why) {
  const auto failed = failed_;
  failed(fmt::format("the board is not reset: reset={}: {}", how_, why));
}

}  // namespace tiltproof::harness
