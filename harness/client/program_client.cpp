#include "harness/client/program_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "firmware/tiltproof_program.h"
#include "harness/client/called_client.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

class ProgramClient final : public CalledClient {
 public:
  ProgramClient(const ProgramSpec& spec, const ProgramHello& hello, ClientHost host)
      : CalledClient(std::move(host)), spec_(spec), hello_(hello) {
    PowerOn();
  }

  ~ProgramClient() override {
    try {
      if (const auto trouble = End())
        Print(stderr, "tiltproof: warning: after the flight, which counts as it was, {}\n", trouble->what());
    } catch (...) {
      // Nothing is left to judge.
    }
  }

  std::optional<FirmwareTrouble> End() override {
    over_ = true;
    if (std::exchange(lost_, true)) return std::nullopt;
    try {
      out_.clear();
      AppendEnd(out_);
      process_->Send(out_, "end");
    } catch (const FirmwareTrouble&) {
      // It ended before: how shows below.
    }
    const auto trouble = process_->AwaitEnd();
    return trouble ? std::optional(Explained(*trouble)) : std::nullopt;
  }

 private:
  // Starts the program, and tells it who to be.
  void PowerOn() {
    lost_ = true;
    process_ = std::make_unique<ProgramProcess>(spec_, [this](const std::string& line) { OnLine(line); });
    lost_ = false;
    out_.clear();
    AppendHello(hello_, out_);
    Guarded([&] {
      SendExchange("hello");
      const ProgramMessage answer = process_->Next();
      if (answer.kind == ProgramMessage::Kind::kRefused) ThrowRefused(answer);
      if (answer.kind != ProgramMessage::Kind::kReady)
        throw FirmwareTrouble(
            false, "the firmware broke the protocol of docs/program.md: its first message is not `ready`");
      if (answer.version != TILTPROOF_PROGRAM_VERSION)
        throw std::runtime_error(
            fmt::format("{} speaks version {} of docs/program.md, this tiltproof version {}", spec_.name,
                        answer.version, TILTPROOF_PROGRAM_VERSION));
      tells_status_ = answer.tells_status;
      if (answer.tells_role) role_ = 0;
    });
  }

  [[noreturn]] void ThrowRefused(const ProgramMessage& message) const {
    if (spec_.clocked)
      throw std::runtime_error(
          fmt::format("{}: the virtual clock cannot hold this program: {}", spec_.name, message.text));
    throw std::runtime_error(fmt::format("{} cannot be firmware '{}' with dialect '{}': {}", spec_.name,
                                         hello_.firmware, hello_.dialect, message.text));
  }

  TimeNs StartFirmware(TimeNs shown) override { return RunFirmware(shown); }
  // They leave with the next grant, which follows at the same time.
  void ReceiveInFirmware(Uart uart, TimeNs shown, std::span<const std::uint8_t> bytes) override {
    has_used_line_ = true;
    AppendBytes(static_cast<int>(uart), shown, bytes, !clock().is_true(), out_);
  }
  TimeNs RunFirmware(TimeNs shown) override {
    AppendGrant(shown, !clock().is_true(), out_);
    return Exchange("grant");
  }
  TimeNs ResetFirmware(TimeNs shown) override {
    // Bytes that the receivers held are lost.
    out_.clear();
    if (spec_.clocked) {
      // The program knows no reset: it is as if the board's power came back.
      process_->TakeOutput(true);
      process_.reset();
      PowerOn();
      return RunFirmware(shown);
    }
    AppendReset(shown, !clock().is_true(), out_);
    return Exchange("reset");
  }
  std::optional<ClientStatus> AskStatus() override {
    return tells_status_ && !lost_ ? std::optional(status_) : std::nullopt;
  }
  std::optional<std::uint32_t> AskRole() override { return lost_ ? std::nullopt : role_; }
  void TakeOutput(bool all) override {
    if (process_) process_->TakeOutput(all);
  }
  void OnLine(const std::string& line) {
    if (!line.empty()) last_line_ = line;
    if (over_) {
      report().Look(line);
    } else {
      LogLine(line);
    }
  }

  void SendExchange(const char* what) {
    process_->Send(out_, what);
    out_.clear();
  }

  TimeNs Exchange(const char* what) {
    return Guarded([&] {
      SendExchange(what);
      for (;;) {
        const ProgramMessage message = process_->Next();
        if (message.kind != ProgramMessage::Kind::kWaiting) {
          Take(message, what);
          continue;
        }
        process_->EndAnswer();
        return std::max<TimeNs>(message.time_ns, 0);
      }
    });
  }

  void Take(const ProgramMessage& message, const char* what) {
    const BootTime when = clock().When(std::max<TimeNs>(message.time_ns, 0));
    switch (message.kind) {
      case ProgramMessage::Kind::kTransmit: {
        has_used_line_ = true;
        const BootTime sent = host().transmit(static_cast<Uart>(message.number), when, message.bytes);
        if (!message.ask) return;
        std::vector<std::uint8_t> answer;
        AppendSent(message.number, clock().At(sent), answer);
        process_->Answer(answer);
        return;
      }
      case ProgramMessage::Kind::kStatus:
        status_ = {message.supervisor_state, message.failsafe_count};
        return;
      case ProgramMessage::Kind::kRole:
        if (role_) role_ = static_cast<std::uint32_t>(message.number);
        return;
      case ProgramMessage::Kind::kCompute: {
        std::vector<std::uint8_t> answer;
        AppendComputed(Compute(message.time_ns, message.length_ns, message.deadline_ns), answer);
        process_->Answer(answer);
        return;
      }
      case ProgramMessage::Kind::kLog:
        // Earlier output comes first.
        LogOutput(when);
        host().log(when, message.text);
        return;
      case ProgramMessage::Kind::kRefused:
        if (spec_.clocked) ThrowRefused(message);
        [[fallthrough]];
      default:
        throw FirmwareTrouble(
            false, fmt::format(
                       "the firmware broke the protocol of docs/program.md in {}: kind {} has no place there",
                       what, static_cast<int>(message.kind)));
    }
  }

  // After a failure the program's state is unknown: it hears nothing more.
  template <class Function>
  std::invoke_result_t<const Function&> Guarded(const Function& function) {
    try {
      return function();
    } catch (const FirmwareTrouble& trouble) {
      lost_ = true;
      LogAllOutput();
      // A refusal by the virtual clock may end the program in the middle of anything.
      if (spec_.clocked)
        if (const auto refusal = process_->FindRefusal()) ThrowRefused(*refusal);
      // A wrong option or a missing module: there was no firmware to judge.
      if (spec_.clocked && !has_used_line_ && process_->has_exited())
        throw std::runtime_error(
            fmt::format("{}: before a byte was on its lines, {}", spec_.name, Explained(trouble).what()));
      throw trouble.hung ? trouble : Explained(trouble);
    } catch (...) {
      lost_ = true;
      throw;
    }
  }

  // Adds what it printed about its end, and the place that this names.
  FirmwareTrouble Explained(const FirmwareTrouble& trouble) const {
    FirmwareEnd end = trouble.end;
    if (report().names_place()) end.place = report().place();
    std::string text = trouble.what();
    if (!report().text().empty())
      text += ": " + report().text();
    else if (!last_line_.empty() && !trouble.hung)
      text += "; it printed last: " + last_line_;
    return {trouble.hung, text, end};
  }

  ProgramSpec spec_;
  ProgramHello hello_;
  std::vector<std::uint8_t> out_;  // of the next exchange
  std::string last_line_;          // that it has printed
  bool tells_status_ = false;
  ClientStatus status_;
  std::optional<std::uint32_t> role_;  // as told last; standby before. None: it tells none
  bool has_used_line_ = false;         // it has sent a byte or was sent one, in this flight
  bool lost_ = false;
  bool over_ = false;
  std::unique_ptr<ProgramProcess> process_;
};

}  // namespace

std::unique_ptr<Client> StartProgramClient(const ProgramSpec& spec, const ProgramHello& hello,
                                           ClientHost host) {
  return std::make_unique<ProgramClient>(spec, hello, std::move(host));
}

}  // namespace tiltproof::harness
