#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <optional>
#include <utility>

#include "harness/node/roles.h"
#include "harness/run/child_process.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kLineBytesMax = 1000;
// At a time: a program that prints without end must not keep this node from its heartbeat.
constexpr int kReadsMax = 16;

// Replaces every `{name}`.
std::string Filled(std::string command, const std::vector<std::pair<std::string, std::string>>& values) {
  for (const auto& [name, value] : values) {
    const std::string place = "{" + name + "}";
    for (std::size_t at = 0; (at = command.find(place, at)) != std::string::npos; at += value.size())
      command.replace(at, place.size(), value);
  }
  return command;
}

// A user's program as the firmware, its serial lines on pseudo-terminals. This node starts it, keeps what it
// prints, and says how it ended.
class CommandRole final : public Role {
 public:
  CommandRole(NodeServices& services, const NodeOptions& options)
      : services_(services), command_(options.firmware_command) {}

  Ports Prepare(const LoadedScenario& loaded, const Ports& /*given*/) override {
    scenario_ = loaded.scenario;
    return {};
  }

  void Arm(const Ports& ports) override {
    port_ = FindPort(ports, "client");
    reference_port_ = FindPort(ports, "client_reference");
  }

  void Start() override {
    power_on_ns_ = services_.clock().Now();
    const std::string baud = std::to_string(scenario_.link.port_baud());
    ChildSpec spec;
    spec.command = {"/bin/sh", "-c",
                    Filled(command_, {{"port", port_}, {"reference_port", reference_port_}, {"baud", baud}})};
    spec.environment = {{"TILTPROOF_PORT", port_},
                        {"TILTPROOF_REFERENCE_PORT", reference_port_},
                        {"TILTPROOF_BAUD", baud},
                        {"TILTPROOF_FIRMWARE", scenario_.firmware},
                        {"TILTPROOF_DIALECT", std::string(Name(scenario_.link.dialect))}};
    spec.output = ChildSpec::kPipe;
    spec.error = ChildSpec::kPipe;
    spec.guard_group = true;
    child_ = std::make_unique<ChildProcess>(spec);
    streams_[0].emplace(services_.loop(), child_->output());
    streams_[1].emplace(services_.loop(), child_->error());
    ends_.emplace(services_.loop(), child_->pidfd());
    for (std::size_t i = 0; i < streams_.size(); ++i) Read(i);
    ends_->async_wait(boost::asio::posix::stream_descriptor::wait_read,
                      [this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
                        if (error || alive.expired() || stopped_) return;
                        ReadAll();
                        services_.Fail(EndReason::kFirmwareLost,
                                       fmt::format("the firmware's process {} (command: {})",
                                                   child_->ExitText().value_or("has ended"), command_));
                      });
  }

  void Flush() override {
    for (auto& event : std::exchange(lines_, {})) services_.log().Write(event);
  }

  NodeTotals Stop() override {
    stopped_ = true;
    ReadAll();
    Close();
    Flush();
    return {};
  }

  ~CommandRole() override { Close(); }

 private:
  // The descriptors are the child's own.
  void Close() {
    for (auto& stream : streams_)
      if (stream) stream->release();
    if (ends_) ends_->release();
    for (auto& stream : streams_) stream.reset();
    ends_.reset();
    child_.reset();
  }

  void Read(std::size_t i) {
    streams_[i]->async_wait(boost::asio::posix::stream_descriptor::wait_read,
                            [this, i, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
                              if (error || alive.expired() || stopped_) return;
                              if (Drain(i)) Read(i);
                            });
  }

  // False at the end of the stream.
  bool Drain(std::size_t i) {
    std::array<char, 4096> buffer;
    for (int reads = 0; reads < kReadsMax; ++reads) {
      const ssize_t got = read(streams_[i]->native_handle(), buffer.data(), buffer.size());
      if (got == 0) return false;
      if (got < 0) return errno == EAGAIN || errno == EINTR;
      for (const char c : std::span(buffer).first(static_cast<std::size_t>(got))) {
        std::string& text = partial_[i];
        if (c != '\n') text.push_back(c == '\0' ? '?' : c);
        if (c == '\n' || text.size() == kLineBytesMax) AddLine(std::exchange(text, {}));
      }
    }
    return true;
  }

  void ReadAll() {
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      if (!streams_[i]) continue;
      Drain(i);
      if (!partial_[i].empty()) AddLine(std::exchange(partial_[i], {}));
    }
    Flush();
  }

  void AddLine(std::string text) {
    if (printed_bytes_ > kFirmwareLogBytesMax) return;
    printed_bytes_ += text.size() + 1;
    lines_.push_back({services_.clock().Now() - power_on_ns_, "firmware_log", std::move(text)});
  }

  NodeServices& services_;
  std::string command_;
  Scenario scenario_;
  std::string port_, reference_port_;
  std::unique_ptr<ChildProcess> child_;
  std::array<std::optional<boost::asio::posix::stream_descriptor>, 2> streams_;
  std::optional<boost::asio::posix::stream_descriptor> ends_;
  std::array<std::string, 2> partial_;
  std::vector<RunEvent> lines_;
  std::size_t printed_bytes_ = 0;
  TimeNs power_on_ns_ = 0;
  bool stopped_ = false;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
};

}  // namespace

std::unique_ptr<Role> MakeCommandRole(NodeServices& services, const NodeOptions& options) {
  return std::make_unique<CommandRole>(services, options);
}

}  // namespace tiltproof::harness
