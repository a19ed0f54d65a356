// Messages with random content, the same for the same seed in every process; and the largest that can be sent.
#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "harness/dds/messages.h"

namespace tiltproof::dds {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  std::uint64_t Below(std::uint64_t limit) { return engine_() % limit; }
  std::int64_t Integer() { return static_cast<std::int64_t>(engine_()); }
  // Any number but NaN, which equals nothing.
  double Number();
  // Empty, as long as possible, or between; any bytes but NUL.
  std::string Text(std::size_t bytes_max);
  std::vector<std::uint8_t> Bytes(std::size_t count_max);
  std::vector<std::string> Names();
  // 0, 1, or a few; sometimes the limit.
  std::size_t Count(std::size_t limit);

 private:
  std::mt19937_64 engine_;
};

// Keys differ for different `index`, so that no message replaces another one.
template <class T>
T RandomMessage(Random& random, int index);

// Every string and list of it as long as it can be, as far as that is less than some megabytes.
template <class T>
T LargestMessage();

// Calls X(T) for each message type.
#define TILTPROOF_EVERY_MESSAGE(X) \
  X(Heartbeat)                     \
  X(RunScenario)                   \
  X(RunCommand)                    \
  X(RunAck)                        \
  X(RunState)                      \
  X(PlantState)                    \
  X(Reference)                     \
  X(SerialTap)                     \
  X(FaultCommand)                  \
  X(FaultActivation)               \
  X(RunEvent)                      \
  X(TraceRows)                     \
  X(NodeReport)                    \
  X(Score)                         \
  X(StepRequest)                   \
  X(StepResponse)

#define TILTPROOF_DECLARE(T)        \
  template <>                       \
  T RandomMessage<T>(Random&, int); \
  template <>                       \
  T LargestMessage<T>();
TILTPROOF_EVERY_MESSAGE(TILTPROOF_DECLARE)
#undef TILTPROOF_DECLARE

}  // namespace tiltproof::dds
