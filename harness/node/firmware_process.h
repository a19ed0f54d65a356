// A program of the firmware's - a user's command, or an emulator - as a child of this node: it is watched,
// its output is kept, and it ends with this object.
//
//   FirmwareProcess process(services, spec, [&](const std::string& how) { Fail(how); });   // "exited with code 3"
//   for (auto& line : process.TakeLines()) ...
#pragma once

#include <array>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harness/node/node.h"
#include "harness/process/child_process.h"

namespace tiltproof::harness {

class FirmwareProcess {
 public:
  struct OutputLine {
    BootTime time_ns;
    std::string text;
    bool error = false;  // on standard error
  };
  using Ended = std::function<void(const std::string& how)>;

  // Starts the program and reads its output and error. Throws std::runtime_error. When the program ends by
  // itself, the loop calls `ended` after its last output has been read; `ended` may destroy this object.
  FirmwareProcess(NodeServices& services, ChildSpec spec, Ended ended);
  ~FirmwareProcess();
  FirmwareProcess(const FirmwareProcess&) = delete;
  FirmwareProcess& operator=(const FirmwareProcess&) = delete;

  ChildProcess& child() { return *child_; }
  // The lines since the last call; in all, the first kFirmwareLogBytesMax.
  std::vector<OutputLine> TakeLines() { return std::exchange(lines_, {}); }
  // Reads what it has printed and what is still unread, to the last byte.
  void ReadAll();

 private:
  // The pipes that this object reads: output and errors.
  static constexpr std::size_t kOutput = 0, kError = 1;
  void Read(std::size_t i);
  bool Drain(std::size_t i);
  void AddLine(std::size_t i);

  NodeServices& services_;
  Ended ended_;
  std::unique_ptr<ChildProcess> child_;
  std::array<std::optional<boost::asio::posix::stream_descriptor>, 2> streams_;
  std::optional<boost::asio::posix::stream_descriptor> end_;
  std::array<std::string, 2> partial_;
  std::vector<OutputLine> lines_;
  std::size_t printed_bytes_ = 0;
  std::shared_ptr<char> alive_ = std::make_shared<char>();
};

}  // namespace tiltproof::harness
