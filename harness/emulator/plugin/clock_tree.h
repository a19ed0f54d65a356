// Reset and clock control, RCC (RM0090, section 7.3), and the clock tree that it sets (section 7.2).
//
// Oscillators and PLLs are ready at once. As on the chip, everything runs from the internal oscillator until the
// firmware says otherwise; the core's own clock, and with it SysTick, is QEMU's and follows.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/parts.h"

namespace tiltproof::qemu {

class ClockTree final : public RegisterBlock {
 public:
  static constexpr std::uint32_t kHsiHz = 16'000'000, kUsualHseHz = 8'000'000;
  // The buses of the blocks that it resets, and gives a clock, bit by bit: by their registers xxxRSTR (sections 7.3.5 to
  // 7.3.9). Their registers xxxENR (7.3.10 to 7.3.14) lie behind these, with the same bits.
  enum Bus : std::uint32_t { kAhb1 = 0x10, kApb1 = 0x20, kApb2 = 0x24 };

  struct Callbacks {
    std::function<void()> changing;  // the clocks are about to change: for who counts with them
    std::function<void()> changed;
    std::function<void(Bus bus, std::uint32_t bits)> reset;
    std::function<void(Bus bus, std::uint32_t bits)> enabled;  // these, and no others
  };

  // `hse_hz`: of the crystal; 0: there is none. `core_clock`: QEMU's, of the machine.
  void Init(std::uint32_t hse_hz, void* core_clock, const Callbacks& callbacks) {
    hse_hz_ = hse_hz;
    core_clock_ = core_clock;
    systick_ = sysbus_mmio_get_region(object_resolve_path("systick-reg-ns", nullptr), 0);
    callbacks_ = callbacks;
    Map("rcc", 0x40023800);
    Reset(harness::lockstep::ResetCause::kNone);
  }

  void Reset(harness::lockstep::ResetCause cause) {
    using harness::lockstep::ResetCause;
    flags_ |= kPinFlag;  // every reset pulls the pin
    if (cause == ResetCause::kSoftware) flags_ |= 1u << 28;
    if (cause == ResetCause::kWatchdog) flags_ |= 1u << 29;
    const std::uint32_t backup = Word(kBackup);  // of another domain (section 7.1.3)
    ClearWords();
    Word(kBackup) = backup;
    Word(kControl) = 0x83;
    Word(kPll) = 0x24003010;
    Word(kAhb1 + kToEnable) = 0x00100000;  // the core-coupled RAM
    Word(0x50) = 0x7E6791FF;               // AHB1LPENR and those that follow it
    Word(0x54) = 0x000000F1;
    Word(0x58) = 0x00000001;
    Word(0x60) = 0x36FEC9FF;
    Word(0x64) = 0x00075F33;
    Word(0x84) = 0x20003000;  // PLLI2SCFGR
    for (const Bus bus : {kAhb1, kApb1, kApb2}) callbacks_.enabled(bus, Word(bus + kToEnable));
    Update();
  }

  std::uint32_t hclk_hz() const { return hclk_hz_; }
  std::uint32_t pclk_hz(int bus) const { return hclk_hz_ >> ApbShift(bus); }
  // Clock of the timers on APB1 or APB2: twice the bus's clock where that is divided (section 7.2).
  std::uint32_t timer_hz(int bus) const { return hclk_hz_ >> (ApbShift(bus) == 0 ? 0 : ApbShift(bus) - 1); }

  // The first limit of the STM32F405 and F407, at a supply of 2.7 V or more, that these clocks break; empty: none. The
  // limits are of nominal frequencies, so that a crystal may be off by a thousandth.
  std::string BrokenLimit(std::uint32_t wait_states, bool is_scale_1) const {
    if ((Word(kControl) & kPllOn) != 0) {
      const std::uint32_t pll = Word(kPll), m = pll & 0x3F, n = pll >> 6 & 0x1FF;
      const std::uint32_t source_hz = (pll & kPllFromHse) != 0 ? hse_hz_ : kHsiHz;
      if (m >= 2 && source_hz != 0) {
        if (IsBelow(source_hz, std::int64_t{1'000'000} * m) ||
            IsAbove(source_hz, std::int64_t{2'000'000} * m))
          return "RCC_PLLCFGR: the input of the PLL's VCO is " + MHz(source_hz / m) +
                 ", and 1 to 2 MHz are allowed (RM0090, section 7.3.2)";
        const std::int64_t vco_hz = MulDiv(source_hz, n, m);
        if (IsBelow(vco_hz, 100'000'000) || IsAbove(vco_hz, 432'000'000))
          return "RCC_PLLCFGR: the PLL's VCO runs at " + MHz(vco_hz) +
                 ", and 100 to 432 MHz are allowed (RM0090, section 7.3.2)";
      }
    }
    if (IsAbove(hclk_hz_, 168'000'000))
      return "RCC_CFGR: the core runs at " + MHz(hclk_hz_) +
             ", and at most 168 MHz are allowed (RM0090, section 7.2)";
    if (IsAbove(pclk_hz(1), 42'000'000))
      return "RCC_CFGR: APB1 runs at " + MHz(pclk_hz(1)) +
             ", and at most 42 MHz are allowed (RM0090, section 7.3.3)";
    if (IsAbove(pclk_hz(2), 84'000'000))
      return "RCC_CFGR: APB2 runs at " + MHz(pclk_hz(2)) +
             ", and at most 84 MHz are allowed (RM0090, section 7.3.3)";
    if (!is_scale_1 && IsAbove(hclk_hz_, 144'000'000))
      return "PWR_CR: the core runs at " + MHz(hclk_hz_) +
             " with the regulator at scale 2, which allows 144 MHz (RM0090, section 5.1.3)";
    // One more for each 30 MHz, of which the first needs none.
    const std::int64_t needed = (hclk_hz_ - hclk_hz_ / kCrystalShare - 1) / 30'000'000;
    if (wait_states < needed)
      return "FLASH_ACR: " + std::to_string(wait_states) + " wait states at " + MHz(hclk_hz_) +
             ", which needs " + std::to_string(needed) + " (RM0090, section 3.5.1, at 2.7 to 3.6 V)";
    return {};
  }

 private:
  static constexpr std::int64_t kCrystalShare = 1000;
  static bool IsAbove(std::int64_t hz, std::int64_t limit_hz) {
    return hz > limit_hz + limit_hz / kCrystalShare;
  }
  static bool IsBelow(std::int64_t hz, std::int64_t limit_hz) {
    return hz < limit_hz - limit_hz / kCrystalShare;
  }
  static std::string MHz(std::int64_t hz) {
    std::string text = std::to_string(hz / 1'000'000);
    if (const std::int64_t tenths = hz % 1'000'000 / 100'000; tenths != 0)
      text += "." + std::to_string(tenths);
    return text + " MHz";
  }

  static constexpr std::uint32_t kControl = 0x00, kPll = 0x04, kConfiguration = 0x08, kInterrupts = 0x0C,
                                 kBackup = 0x70, kStatus = 0x74, kToEnable = 0x20;
  // CR: each ready flag is the bit above its enable bit.
  static constexpr std::uint32_t kHsiOn = 1u << 0, kHseOn = 1u << 16, kPllOn = 1u << 24, kPllI2sOn = 1u << 26;
  static constexpr std::uint32_t kOscillators = kHsiOn | kHseOn | kPllOn | kPllI2sOn;
  static constexpr std::uint32_t kPllFromHse = 1u << 22;
  static constexpr std::uint32_t kPinFlag = 1u << 26, kPowerFlag = 1u << 27, kBrownOutFlag = 1u << 25,
                                 kRemoveFlags = 1u << 24;
  enum Source : std::uint32_t { kHsi, kHse, kMainPll };

  std::uint32_t Read(std::uint32_t offset) override {
    return offset == kStatus ? flags_ | Word(kStatus) : Word(offset);
  }

  void Write(std::uint32_t offset, std::uint32_t value) override {
    switch (offset) {
      case kControl:
        Word(kControl) = value | InUse();
        break;
      case kPll:  // section 7.3.2: only while the PLL is off
        if ((Word(kControl) & kPllOn) == 0) Word(kPll) = value;
        break;
      case kInterrupts:
        Word(kInterrupts) = value & 0x3F00;  // enable bits; no flag is ever raised
        return;
      case kBackup:  // LSERDY follows LSEON
        Word(kBackup) = (value & ~2u) | (value & 1) << 1;
        return;
      case kStatus:  // LSIRDY follows LSION
        Word(kStatus) = (value & 1) | (value & 1) << 1;
        if ((value & kRemoveFlags) != 0) flags_ = 0;
        return;
      case kAhb1:
      case kApb1:
      case kApb2: {
        const std::uint32_t released = Word(offset) & ~value;
        Word(offset) = value;
        callbacks_.reset(static_cast<Bus>(offset), value | released);
        return;
      }
      case kAhb1 + kToEnable:
      case kApb1 + kToEnable:
      case kApb2 + kToEnable:
        Word(offset) = value;
        callbacks_.enabled(static_cast<Bus>(offset - kToEnable), value);
        return;
      default:
        Word(offset) = value;
        if (offset != kConfiguration) return;
    }
    Update();
  }

  Source Used() const { return static_cast<Source>(Word(kConfiguration) >> 2 & 3); }
  // The oscillators that make the system's clock cannot be switched off (section 7.3.1).
  std::uint32_t InUse() const {
    const std::uint32_t feeds_pll = (Word(kPll) & kPllFromHse) != 0 ? kHseOn : kHsiOn;
    return Used() == kHsi ? kHsiOn : Used() == kHse ? kHseOn : kPllOn | feeds_pll;
  }

  // 0: it does not run.
  std::uint32_t HzOf(Source source) const {
    const std::uint32_t control = Word(kControl);
    if (source == kHsi) return (control & kHsiOn) != 0 ? kHsiHz : 0;
    if (source == kHse) return (control & kHseOn) != 0 ? hse_hz_ : 0;
    const std::uint32_t pll = Word(kPll), m = pll & 0x3F, n = pll >> 6 & 0x1FF, p = 2 * ((pll >> 16 & 3) + 1);
    const bool allowed = m >= 2 && n >= 50 && n <= 432;  // section 7.3.2
    if ((control & kPllOn) == 0 || !allowed || source != kMainPll) return 0;
    return static_cast<std::uint32_t>(
        MulDiv(HzOf((pll & kPllFromHse) != 0 ? kHse : kHsi), n, std::int64_t{m} * p));
  }

  int ApbShift(int bus) const {
    const std::uint32_t prescaler = Word(kConfiguration) >> (bus == 1 ? 10 : 13) & 7;
    return prescaler < 4 ? 0 : static_cast<int>(prescaler) - 3;
  }

  void Update() {
    callbacks_.changing();
    std::uint32_t& control = Word(kControl);
    std::uint32_t ready = control & kOscillators;
    if (HzOf(kHse) == 0) ready &= ~kHseOn;
    if (HzOf(kMainPll) == 0) ready &= ~kPllOn;
    control = (control & ~(kOscillators << 1)) | ready << 1;
    // The switch waits until what it selects is ready.
    std::uint32_t& configuration = Word(kConfiguration);
    if (HzOf(static_cast<Source>(configuration & 3)) != 0)
      configuration = (configuration & ~(3u << 2)) | (configuration & 3) << 2;
    constexpr int kAhbShifts[16] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 6, 7, 8, 9};
    const std::uint32_t hclk_hz = HzOf(Used()) >> kAhbShifts[configuration >> 4 & 15];
    if (hclk_hz != hclk_hz_ && hclk_hz != 0) {
      hclk_hz_ = hclk_hz;
      constexpr std::uint64_t kPeriodOf1Hz = std::uint64_t{1'000'000'000} << 32;  // CLOCK_PERIOD_1SEC
      if (clock_set(core_clock_, kPeriodOf1Hz / hclk_hz)) clock_propagate(core_clock_);
      ChooseSysTickClock();
    }
    callbacks_.changed();
  }

  // QEMU 7.2's SysTick takes an eighth of the clock for its own whenever the clock changes, whatever CLKSOURCE says
  // (PM0214, section 4.5.1): until that bit changes.
  void ChooseSysTickClock() {
    constexpr std::uint64_t kSysTickControl = 0, kClockSource = 1u << 2;
    std::uint64_t control = 0;
    memory_region_dispatch_read(systick_, kSysTickControl, &control, kMemOp32LittleEndian, 0);
    for (const std::uint64_t value : {control ^ kClockSource, control})
      memory_region_dispatch_write(systick_, kSysTickControl, value & 7, kMemOp32LittleEndian, 0);
  }

  std::uint32_t hse_hz_ = 0, hclk_hz_ = 0;
  void* core_clock_ = nullptr;
  void* systick_ = nullptr;
  Callbacks callbacks_{};
  std::uint32_t flags_ = kPinFlag | kPowerFlag | kBrownOutFlag;  // why it was reset (section 7.3.21)
};

}  // namespace tiltproof::qemu
