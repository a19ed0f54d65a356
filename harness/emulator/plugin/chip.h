// The parts that QEMU's STM32F405 lacks, as one: every block in front of the machine's own.
//
//   chip.Init(options, core_clock);                     // before the first instruction
//   chip.Reset(harness::lockstep::ResetCause::kPin);   // with every reset of the machine
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/clock_tree.h"
#include "harness/emulator/plugin/core_registers.h"
#include "harness/emulator/plugin/dma.h"
#include "harness/emulator/plugin/gpio.h"
#include "harness/emulator/plugin/power_and_flash.h"
#include "harness/emulator/plugin/timers.h"
#include "harness/emulator/plugin/usart.h"
#include "harness/emulator/plugin/watchdog.h"

namespace tiltproof::qemu {

class Chip {
 public:
  struct Options {
    std::uint32_t hse_hz = ClockTree::kUsualHseHz;
    UsartUnit::Callbacks usart;
    void (*watchdog)() = nullptr;                             // has bitten
    void (*clocks_changed)() = nullptr;                       // rates, or which blocks have one
    void (*broken_limit)(const std::string& what) = nullptr;  // as ClockTree::BrokenLimit() says
  };

  // `core_clock`: QEMU's clock object of the machine.
  void Init(const Options& options, void* core_clock) {
    options_ = options;
    // The clock tree's callbacks reach the others only when they are there.
    clocks_.Init(options.hse_hz, core_clock,
                 {.changing =
                      [this] {
                        if (complete_) timers_.Hold();
                      },
                  .changed =
                      [this] {
                        cycles_.Follow(clocks_.hclk_hz());
                        if (complete_) timers_.Resume();
                        TellClocks();
                        CheckLimits();
                      },
                  .reset =
                      [this](ClockTree::Bus bus, std::uint32_t bits) {
                        ForEachBlock(bus, [bits](int bit, auto& block) {
                          if (IsSet(bits, bit)) block.Reset();
                        });
                      },
                  .enabled =
                      [this](ClockTree::Bus bus, std::uint32_t bits) {
                        ForEachBlock(bus, [bits](int bit, auto& block) { block.SetClock(IsSet(bits, bit)); });
                        TellClocks();
                      }});
    // An image may also take away what its clock needs.
    pwr_.Init([this] { CheckLimits(); });
    flash_.Init([this] { CheckLimits(); });
    for (int port = 0; port < Gpio::kCount; ++port) gpios_[static_cast<std::size_t>(port)].Init(port);
    dma_.Init([this] {
      for (UsartUnit& usart : usarts_) usart.Serve();
    });
    for (int number = 1; number <= UsartUnit::kCount; ++number)
      usart(number).Init(number, clocks_, dma_, options.usart);
    timers_.Init(clocks_);
    watchdog_.Init(options.watchdog);
    cycles_.Init();
    timer_and_interrupts_.Init(0xE000E000);
    priorities_.Init(0xE000E400);
    control_.Init(0xE000EC00, &cycles_);
    debug_unit_.Init();
    signature_.Init();
    ccm_.Init();
    complete_ = true;
  }

  void Reset(harness::lockstep::ResetCause cause) {
    // Its limits are those of the others as they are after the reset.
    pwr_.Reset();
    flash_.Reset();
    clocks_.Reset(cause);
    for (Gpio& gpio : gpios_) gpio.Reset();
    for (const int number : {1, 2}) dma_.controller(number).Reset();
    for (UsartUnit& usart : usarts_) usart.Reset();
    timers_.Reset();
    watchdog_.Reset();
    cycles_.Reset();
    control_.Reset();
  }

  // `number`: 1 to UsartUnit::kCount.
  UsartUnit& usart(int number) { return usarts_[static_cast<std::size_t>(number - 1)]; }

 private:
  // The blocks of a bus, with their bits in the clock tree's registers.
  template <class Act>
  void ForEachBlock(ClockTree::Bus bus, const Act& act) {
    if (bus == ClockTree::kAhb1) {
      for (int port = 0; port < Gpio::kCount; ++port) act(port, gpios_[static_cast<std::size_t>(port)]);
      for (const int number : {1, 2}) act(20 + number, dma_.controller(number));
    } else if (bus == ClockTree::kApb1) {
      constexpr std::array<int, 9> kTimers = {2, 3, 4, 5, 6, 7, 12, 13, 14};
      for (std::size_t i = 0; i < kTimers.size(); ++i) act(static_cast<int>(i), timers_.timer(kTimers[i]));
      for (const int number : {2, 3, 4, 5}) act(15 + number, usart(number));
      act(28, pwr_);
    } else {
      constexpr std::array<std::array<int, 2>, 5> kTimers = {{{0, 1}, {1, 8}, {16, 9}, {17, 10}, {18, 11}}};
      for (const auto& [bit, number] : kTimers) act(bit, timers_.timer(number));
      act(4, usart(1));
      act(5, usart(6));
    }
  }
  void TellClocks() const {
    if (complete_ && options_.clocks_changed != nullptr) options_.clocks_changed();
  }
  void CheckLimits() const {
    if (!complete_ || options_.broken_limit == nullptr) return;
    const std::string what = clocks_.BrokenLimit(flash_.wait_states(), pwr_.is_scale_1());
    if (!what.empty()) options_.broken_limit(what);
  }
  static constexpr bool IsSet(std::uint32_t bits, int bit) { return (bits >> bit & 1) != 0; }

  Options options_;
  ClockTree clocks_;
  Pwr pwr_;
  FlashInterface flash_;
  std::array<Gpio, Gpio::kCount> gpios_;
  Dma dma_;
  std::array<UsartUnit, UsartUnit::kCount> usarts_;
  Timers timers_;
  Watchdog watchdog_;
  CycleCounter cycles_;
  SystemControl timer_and_interrupts_, priorities_, control_;
  DebugUnit debug_unit_;
  Signature signature_;
  CoupledRam ccm_;
  bool complete_ = false;
};

}  // namespace tiltproof::qemu
