#include "harness/run/run_id.h"

#include <fmt/format.h>
#include <sys/random.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <stdexcept>

namespace tiltproof::harness {

std::string NewRunId() {
  std::array<std::uint64_t, 2> bits{};
  if (getrandom(bits.data(), sizeof bits, 0) != static_cast<ssize_t>(sizeof bits))
    throw std::runtime_error("the system gives no random number for the run's id");
  return fmt::format("{:016x}{:016x}", bits[0], bits[1]);
}

std::string HostName() {
  std::array<char, 128> name{};
  gethostname(name.data(), name.size() - 1);
  return name.data();
}

}  // namespace tiltproof::harness
