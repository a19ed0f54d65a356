// Controls a running QEMU: stop, continue, reset (QEMU Machine Protocol, docs/interop/qmp-spec of QEMU).
//
//   QmpClient qmp(loop, socket, {.event = on_event, .lost = on_lost});
//   qmp.Execute("system_reset", "{}", [](const std::string& error, const std::string& value) { ... });
//
// Nothing blocks, and nothing is timed here: the owner checks Waiting() periodically, and knows when the
// emulator may be silent for good reason.
#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "link/serial_port.h"

namespace tiltproof::harness {

class QmpClient {
 public:
  // `error` is empty when it was done; `value`: what the command returns, as JSON.
  using Done = std::function<void(const std::string& error, const std::string& value)>;
  struct Callbacks {
    // An event that QEMU reports by itself: "RESET", with its data as JSON.
    std::function<void(const std::string& name, const std::string& data)> event;
    // No more answers will come. Called once; `done` of waiting commands is not called.
    std::function<void(const std::string& why)> lost;
  };

  // Takes over a connected socket and greets QEMU. The loop calls the callbacks, and they may destroy this
  // object.
  QmpClient(boost::asio::io_context& loop, int socket, Callbacks callbacks);
  QmpClient(const QmpClient&) = delete;
  QmpClient& operator=(const QmpClient&) = delete;

  // After the commands before it. `arguments`: a JSON object.
  void Execute(std::string_view command, std::string_view arguments = "{}", Done done = {});

  // The time for which the oldest command has been waiting for its answer; zero when none is.
  std::chrono::nanoseconds Waiting() const;

 private:
  struct Command {
    std::string line;
    Done done;
  };
  void SendNext();
  void OnBytes(std::span<const std::uint8_t> bytes);
  void OnLine(const std::string& line);
  void Lose(const std::string& why);

  link::SerialPort port_;
  Callbacks callbacks_;
  std::string partial_;
  bool greeted_ = false, lost_ = false;
  std::deque<Command> commands_;  // the first has been sent when sent_at_ has a value
  std::optional<std::chrono::steady_clock::time_point> sent_at_;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
};

}  // namespace tiltproof::harness
