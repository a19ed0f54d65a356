#include "harness/emulator/qmp_client.h"

#include <fmt/format.h>

#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

namespace tiltproof::harness {
namespace {

using nlohmann::json;

// No answer to what we ask comes near this.
constexpr std::size_t kLineBytesMax = std::size_t{1} << 20;

}  // namespace

QmpClient::QmpClient(boost::asio::io_context& loop, int socket, Callbacks callbacks)
    : port_(loop, socket, "the emulator's control socket"), callbacks_(std::move(callbacks)) {
  Execute("qmp_capabilities");
  port_.Start([this](std::span<const std::uint8_t> bytes) { OnBytes(bytes); },
              [this](const std::string& reason) { Lose(reason); });
}

void QmpClient::Execute(std::string_view command, std::string_view arguments, Done done) {
  commands_.push_back(
      {fmt::format("{{\"execute\": \"{}\", \"arguments\": {}}}\n", command, arguments), std::move(done)});
  SendNext();
}

std::chrono::nanoseconds QmpClient::Waiting() const {
  if (!sent_at_) return std::chrono::nanoseconds(0);
  return std::chrono::steady_clock::now() - *sent_at_;
}

// One at a time, and none before QEMU has said hello.
void QmpClient::SendNext() {
  if (!greeted_ || lost_ || sent_at_ || commands_.empty()) return;
  const std::string& line = commands_.front().line;
  sent_at_ = std::chrono::steady_clock::now();
  port_.Write({reinterpret_cast<const std::uint8_t*>(line.data()), line.size()});
}

void QmpClient::OnBytes(std::span<const std::uint8_t> bytes) {
  const std::weak_ptr<char> alive = alive_;
  for (const std::uint8_t byte : bytes) {
    if (byte != '\n') {
      partial_.push_back(static_cast<char>(byte));
      if (partial_.size() > kLineBytesMax)
        return Lose("the emulator's control socket sends a line that is too long");
      continue;
    }
    OnLine(std::exchange(partial_, {}));
    if (alive.expired() || lost_) return;
  }
}

void QmpClient::OnLine(const std::string& line) {
  const json message = json::parse(line, nullptr, false);
  if (!message.is_object())
    return Lose("the emulator's control socket speaks no QMP: " + line.substr(0, 100));
  if (message.contains("QMP")) {
    greeted_ = true;
    return SendNext();
  }
  if (const auto event = message.find("event"); event != message.end()) {
    if (callbacks_.event && event->is_string())
      callbacks_.event(event->get<std::string>(), message.value("data", json::object()).dump());
    return;
  }
  if (!sent_at_) return;
  const Done done = std::move(commands_.front().done);
  commands_.pop_front();
  sent_at_.reset();
  SendNext();
  if (!done) return;
  if (const auto error = message.find("error"); error != message.end())
    return done(error->is_object() ? error->value("desc", "refused without a reason") : error->dump(), "");
  done("", message.value("return", json::object()).dump());
}

void QmpClient::Lose(const std::string& why) {
  if (std::exchange(lost_, true)) return;
  if (callbacks_.lost) callbacks_.lost(why);
}

}  // namespace tiltproof::harness
