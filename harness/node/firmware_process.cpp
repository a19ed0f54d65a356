#include "harness/node/firmware_process.h"

#include <unistd.h>

#include <cerrno>
#include <span>
#include <utility>

namespace tiltproof::harness {
namespace {

using boost::asio::posix::stream_descriptor;

constexpr std::size_t kLineBytesMax = 1000;
// At a time: a program that prints without end must not keep this node from its heartbeat.
constexpr int kReadsMax = 16;

}  // namespace

FirmwareProcess::FirmwareProcess(NodeServices& services, ChildSpec spec, Ended ended)
    : services_(services), ended_(std::move(ended)) {
  spec.output = ChildSpec::kPipe;
  spec.error = ChildSpec::kPipe;
  child_ = std::make_unique<ChildProcess>(spec);
  streams_[kOutput].emplace(services_.loop(), child_->output());
  streams_[kError].emplace(services_.loop(), child_->error());
  end_.emplace(services_.loop(), child_->pidfd());
  for (std::size_t i = 0; i < streams_.size(); ++i) Read(i);
  end_->async_wait(stream_descriptor::wait_read,
                   [this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
                     if (error || alive.expired()) return;
                     ReadAll();
                     // It may destroy this.
                     const auto tell = ended_;
                     tell(child_->ExitText().value_or("has ended"));
                   });
}

// The descriptors are the child's own.
FirmwareProcess::~FirmwareProcess() {
  for (auto& stream : streams_) stream->release();
  end_->release();
}

void FirmwareProcess::Read(std::size_t i) {
  streams_[i]->async_wait(stream_descriptor::wait_read,
                          [this, i, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
                            if (error || alive.expired()) return;
                            if (Drain(i)) Read(i);
                          });
}

// False at the end of the stream.
bool FirmwareProcess::Drain(std::size_t i) {
  std::array<char, 4096> buffer;
  for (int reads = 0; reads < kReadsMax; ++reads) {
    const ssize_t got = read(streams_[i]->native_handle(), buffer.data(), buffer.size());
    if (got == 0) return false;
    if (got < 0) return errno == EAGAIN || errno == EINTR;
    for (const char c : std::span(buffer).first(static_cast<std::size_t>(got))) {
      if (c != '\n') partial_[i].push_back(c == '\0' ? '?' : c);
      if (c == '\n' || partial_[i].size() == kLineBytesMax) AddLine(i);
    }
  }
  return true;
}

void FirmwareProcess::ReadAll() {
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    Drain(i);
    if (!partial_[i].empty()) AddLine(i);
  }
}

void FirmwareProcess::AddLine(std::size_t i) {
  std::string text = std::exchange(partial_[i], {});
  // A firmware on a serial console ends its lines with "\r\n".
  if (text.ends_with('\r')) text.pop_back();
  if (printed_bytes_ > kFirmwareLogBytesMax) return;
  printed_bytes_ += text.size() + 1;
  lines_.push_back({services_.clock().Now(), std::move(text), i == kError});
}

}  // namespace tiltproof::harness
