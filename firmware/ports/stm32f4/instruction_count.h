// Counts the instructions of a piece of work, by timer 2: main_budgets.cpp states its unit, and starts it.
//
//   const std::uint32_t instructions = Counted([&] { law.Step(sensors, reference); });
#pragma once

#include <cstdint>

#include "firmware/ports/stm32f4/stm32f4.h"

namespace tiltproof::stm32f4 {

template <class Work>
std::uint32_t CountAll(const Work& work) {
  const InterruptLock lock;
  asm volatile("" ::: "memory");
  const std::uint32_t begin = Tim2().CNT;
  work();
  asm volatile("" ::: "memory");
  return Tim2().CNT - begin;
}

// Without what counting takes.
template <class Work>
std::uint32_t Counted(const Work& work) {
  const std::uint32_t empty = CountAll([] {});
  return CountAll(work) - empty;
}

}  // namespace tiltproof::stm32f4
