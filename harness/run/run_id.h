// A name for a run that no other run has, on this machine or another. It isolates the run's messages.
#pragma once

#include <string>

namespace tiltproof::harness {

// 32 hexadecimal digits from the system's random numbers. Nothing else depends on them. Throws
// std::runtime_error.
std::string NewRunId();

// The name that this host gives itself.
std::string HostName();

}  // namespace tiltproof::harness
