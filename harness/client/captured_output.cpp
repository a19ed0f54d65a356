#include "harness/client/captured_output.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <utility>

// In a build with sanitizers, their reports are ours. In any other they are those of a library under test.
#ifdef TILTPROOF_SANITIZED
extern "C" __attribute__((weak)) void __sanitizer_set_report_fd(void* descriptor);  // NOLINT
#endif

namespace tiltproof::harness {
namespace {

constexpr int kBufferBytes = 1 << 20;

void SetReportDescriptor([[maybe_unused]] int descriptor) {
#ifdef TILTPROOF_SANITIZED
  if (__sanitizer_set_report_fd != nullptr)
    __sanitizer_set_report_fd(reinterpret_cast<void*>(static_cast<std::intptr_t>(descriptor)));
#endif
}

}  // namespace

CapturedOutput::CapturedOutput()
    : output_(fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3)), error_(fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3)) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0)
    throw std::runtime_error(std::string("no pipe for the firmware's output: ") + std::strerror(errno));
  pipe_ = link::OwnedDescriptor(ends[0]);
  const link::OwnedDescriptor write_end(ends[1]);
  // Where that is not permitted it holds less.
  fcntl(write_end.get(), F_SETPIPE_SZ, kBufferBytes);
  std::fflush(stdout);
  // A line that was printed before a crash is kept.
  setvbuf(stdout, nullptr, _IOLBF, 0);
  if (error_.get() >= 0) SetReportDescriptor(error_.get());
  dup2(write_end.get(), STDOUT_FILENO);
  dup2(write_end.get(), STDERR_FILENO);
}

CapturedOutput::~CapturedOutput() {
  std::fflush(stdout);
  for (const auto& [was, stream] :
       {std::pair{output_.get(), STDOUT_FILENO}, std::pair{error_.get(), STDERR_FILENO}}) {
    if (was >= 0) {
      dup2(was, stream);
    } else {
      close(stream);
    }
  }
  SetReportDescriptor(STDERR_FILENO);
}

void CapturedOutput::TakeLines(const OnLine& on_line) {
  std::array<char, 4096> buffer;
  for (ssize_t got; (got = read(pipe_.get(), buffer.data(), buffer.size())) > 0;)
    lines_.Add({buffer.data(), static_cast<std::size_t>(got)}, on_line);
}

void CapturedOutput::TakeAll(const OnLine& on_line) {
  std::fflush(stdout);
  TakeLines(on_line);
  lines_.End(on_line);
}

}  // namespace tiltproof::harness
