#include "harness/run/introduction.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#include "harness/process/own_time.h"

namespace tiltproof::harness {
namespace {

constexpr int kDescriptor = 3;
constexpr TimeNs kLimitNs = 10 * kNsPerS;

}  // namespace

Introduction::Introduction() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0)
    throw std::runtime_error(std::string("cannot make a pipe: ") + std::strerror(errno));
  our_end_ = ends[0];
  child_end_ = ends[1];
}

Introduction::~Introduction() {
  Started();
  close(our_end_);
}

void Introduction::Started() {
  if (child_end_ >= 0) close(std::exchange(child_end_, -1));
}

std::optional<dds::Participant> Introduction::Participant() {
  auto& guid = participant_.guid;
  while (read_bytes_ < guid.size()) {
    const ssize_t got = read(our_end_, guid.data() + read_bytes_, guid.size() - read_bytes_);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return std::nullopt;
    read_bytes_ += static_cast<std::size_t>(got);
  }
  return participant_;
}

dds::Participant Introduction::Await(pid_t pid, int pidfd) {
  std::array<pollfd, 2> polled{{{our_end_, POLLIN, 0}, {pidfd, POLLIN, 0}}};
  OwnTime own(pid);
  for (;;) {
    const TimeNs waited_ns = own.Look(OwnTime::SteadyClock::now());
    if (const auto participant = Participant()) return *participant;
    if (polled[1].revents != 0) throw std::runtime_error("a process ended before it was on the bus");
    if (waited_ns >= kLimitNs) throw std::runtime_error("a process was not on the bus within 10 s");
    poll(polled.data(), polled.size(), static_cast<int>(OwnTime::kLook.count()));
  }
}

void Introduce(const dds::Participant& participant) {
  // So few bytes go into an empty pipe at once.
  const ssize_t written = write(kDescriptor, participant.guid.data(), participant.guid.size());
  if (written != static_cast<ssize_t>(participant.guid.size()))
    throw std::runtime_error("the harness that started this process does not hear who it is");
  close(kDescriptor);
}

}  // namespace tiltproof::harness
