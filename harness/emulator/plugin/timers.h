// The timers TIM1 to TIM14 as time bases (RM0090, sections 17 to 20): they count up, and each overflow is an update event.
// No capture, compare, repetition, or counting by other clocks.
#pragma once

#include <array>
#include <cstdint>

#include "harness/emulator/plugin/clock_tree.h"
#include "harness/emulator/plugin/parts.h"

namespace tiltproof::qemu {

class TimeBase final : public RegisterBlock {
 public:
  struct Place {
    std::uint32_t address;
    int bus;  // APB1 or APB2
    int interrupt;
    bool wide;  // 32 bits
  };

  // `source`: of the interrupt, which some timers share.
  void Init(const Place& place, const ClockTree& clocks, Interrupt& interrupt, unsigned source) {
    place_ = place;
    clocks_ = &clocks;
    interrupt_ = &interrupt;
    source_ = source;
    timer_.Init([](void* self) { static_cast<TimeBase*>(self)->Serve(); }, this);
    Map("tim", place.address);
    Reset();
  }
  void Reset() {
    ClearWords();
    Word(kReload) = period_ = place_.wide ? 0xFFFFFFFF : 0xFFFF;
    prescaler_ = 0;
    Restart(0);
    Serve();
  }
  // The clock is about to change, and has changed.
  void Hold() {
    Sync();
    held_clocks_ = Clocks();
  }
  void Resume() {
    Restart(held_clocks_);
    Serve();
  }

 private:
  static constexpr std::uint32_t kControl = 0x00, kInterrupts = 0x0C, kStatus = 0x10, kEvents = 0x14,
                                 kCounter = 0x24, kPrescaler = 0x28, kReload = 0x2C;
  // CR1 (section 20.4.1).
  static constexpr std::uint32_t kEnable = 1u << 0, kNoUpdate = 1u << 1, kOverflowOnly = 1u << 2,
                                 kOnePulse = 1u << 3, kReloadBuffered = 1u << 7;
  static constexpr std::uint32_t kUpdate = 1u << 0;  // in DIER, SR and EGR

  bool Runs() const { return (Word(kControl) & kEnable) != 0 && period_ != 0 && hz_ != 0; }
  std::int64_t ClocksPerCount() const { return std::int64_t{prescaler_} + 1; }
  std::int64_t ClocksPerPeriod() const { return ClocksPerCount() * (std::int64_t{period_} + 1); }

  // Since the counter was last 0.
  std::int64_t Clocks() const {
    return Runs() ? phase_ + MulDiv(Now() - begin_ns_, hz_, kNsPerSecond) : phase_;
  }
  void Restart(std::int64_t clocks) {
    begin_ns_ = Now();
    phase_ = clocks;
    hz_ = clocks_->timer_hz(place_.bus);
  }

  // Prescaler and reload value become those that were written; they are buffered until an update event (section 20.3.2).
  void LoadBuffers() {
    prescaler_ = Word(kPrescaler) & 0xFFFF;
    period_ = Word(kReload);
  }

  // Brings counter and flags up to the present.
  void Sync() {
    while (Runs() && Clocks() >= ClocksPerPeriod()) {
      // All periods that are over, unless the first is followed by others of another length.
      const bool alike =
          (Word(kControl) & kNoUpdate) != 0 || (prescaler_ == Word(kPrescaler) && period_ == Word(kReload));
      phase_ -= alike ? Clocks() / ClocksPerPeriod() * ClocksPerPeriod() : ClocksPerPeriod();
      if ((Word(kControl) & kNoUpdate) != 0) continue;
      LoadBuffers();
      Word(kStatus) |= kUpdate;
      if ((Word(kControl) & kOnePulse) != 0) {
        Word(kControl) &= ~kEnable;
        phase_ = 0;
      }
    }
  }

  void Serve() {
    Sync();
    const bool wanted = (Word(kInterrupts) & kUpdate) != 0, pending = (Word(kStatus) & kUpdate) != 0;
    interrupt_->Set(wanted && pending, source_);
    if (!wanted || pending || !Runs()) return timer_.Cancel();
    const std::int64_t clocks = ClocksPerPeriod() - phase_;
    std::int64_t after = MulDiv(clocks, kNsPerSecond, hz_);
    if (MulDiv(after, hz_, kNsPerSecond) < clocks) ++after;
    timer_.Set(begin_ns_ + after);
  }

  std::uint32_t Read(std::uint32_t offset) override {
    if (offset == kStatus || offset == kControl) Sync();
    if (offset != kCounter) return offset == kEvents ? 0 : Word(offset);
    Sync();
    return static_cast<std::uint32_t>(Clocks() / ClocksPerCount());
  }

  void Write(std::uint32_t offset, std::uint32_t value) override {
    Sync();
    switch (offset) {
      case kControl: {
        const std::int64_t clocks = Clocks();
        Word(kControl) = value;
        Restart(clocks);
        break;
      }
      case kStatus:  // flags can only be cleared
        Word(kStatus) &= value;
        break;
      case kEvents:
        if ((value & kUpdate) == 0) break;
        if ((Word(kControl) & kNoUpdate) == 0) LoadBuffers();
        if ((Word(kControl) & (kNoUpdate | kOverflowOnly)) == 0) Word(kStatus) |= kUpdate;
        Restart(0);
        break;
      case kCounter:
        Restart((place_.wide ? value : value & 0xFFFF) * ClocksPerCount());
        break;
      case kReload:
        Word(kReload) = place_.wide ? value : value & 0xFFFF;
        if ((Word(kControl) & kReloadBuffered) == 0) {
          const std::int64_t clocks = Clocks();
          period_ = Word(kReload);
          Restart(clocks);
        }
        break;
      case kPrescaler:
        Word(kPrescaler) = value & 0xFFFF;
        break;
      default:
        Word(offset) = value;
    }
    Serve();
  }

  Place place_{};
  const ClockTree* clocks_ = nullptr;
  Interrupt* interrupt_ = nullptr;
  unsigned source_ = 0;
  Timer timer_;
  std::uint32_t prescaler_ = 0, period_ = 0;  // in force
  std::uint32_t hz_ = 0;
  std::int64_t begin_ns_ = 0,
               phase_ = 0;  // the counter was at `phase_` clocks then; less by each period that is over
  std::int64_t held_clocks_ = 0;
};

// All of them.
class Timers {
 public:
  void Init(const ClockTree& clocks) {
    for (std::size_t i = 0; i < kCount; ++i) {
      unsigned source = 0;
      std::size_t first = i;
      for (std::size_t j = 0; j < i; ++j)
        if (kPlaces[j].interrupt == kPlaces[i].interrupt) {
          if (source++ == 0) first = j;
        }
      if (first == i) interrupts_[i].Init(kPlaces[i].interrupt);
      timers_[i].Init(kPlaces[i], clocks, interrupts_[first], source);
    }
  }
  void Reset() {
    for (TimeBase& timer : timers_) timer.Reset();
  }
  // TIM1 is number 1.
  TimeBase& timer(int number) { return timers_[static_cast<std::size_t>(number - 1)]; }
  void Hold() {
    for (TimeBase& timer : timers_) timer.Hold();
  }
  void Resume() {
    for (TimeBase& timer : timers_) timer.Resume();
  }

 private:
  static constexpr std::size_t kCount = 14;
  // Sections 2.3 and 12.2 (table 62: the update interrupts).
  static constexpr std::array<TimeBase::Place, kCount> kPlaces = {{{0x40010000, 2, 25, false},
                                                                   {0x40000000, 1, 28, true},
                                                                   {0x40000400, 1, 29, false},
                                                                   {0x40000800, 1, 30, false},
                                                                   {0x40000C00, 1, 50, true},
                                                                   {0x40001000, 1, 54, false},
                                                                   {0x40001400, 1, 55, false},
                                                                   {0x40010400, 2, 44, false},
                                                                   {0x40014000, 2, 24, false},
                                                                   {0x40014400, 2, 25, false},
                                                                   {0x40014800, 2, 26, false},
                                                                   {0x40001800, 1, 43, false},
                                                                   {0x40001C00, 1, 44, false},
                                                                   {0x40002000, 1, 45, false}}};
  std::array<TimeBase, kCount> timers_;
  std::array<Interrupt, kCount> interrupts_;
};

}  // namespace tiltproof::qemu
