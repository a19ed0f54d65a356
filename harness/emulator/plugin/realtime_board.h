// Notes the hidden state of a board that runs by the clock on the wall: the harness cannot see it from outside. The
// notes go to memory that the harness has mapped, too (harness::lockstep::RealtimeBoard).
#pragma once

#include <sys/mman.h>
#include <time.h>

#include <cstdint>
#include <cstring>
#include <string>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/command.h"
#include "harness/emulator/plugin/processor.h"

namespace tiltproof::qemu {

inline std::int64_t TimeOf(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

// Without memory it notes nothing.
class RealtimeNotes {
 public:
  void Use(int descriptor) {
    void* memory = mmap(nullptr, sizeof(*board_), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
    if (memory == MAP_FAILED) Die("the memory that it shares with the harness cannot be mapped");
    board_ = static_cast<harness::lockstep::RealtimeBoard*>(memory);
  }
  // USARTs by their numbers.
  void Clock(int number, std::uint32_t hz) {
    if (board_ != nullptr) board_->clock_hz[number - 1] = hz;
  }
  void Sent(int number) {
    if (board_ == nullptr) return;
    ++board_->sent_count[number - 1];
    board_->sent_at_ns[number - 1] = TimeOf(CLOCK_MONOTONIC);
  }
  void LostTick(std::int64_t before_ns, std::int64_t at_ns) {
    if (board_ == nullptr) return;
    using Board = harness::lockstep::RealtimeBoard;
    const std::uint64_t count = board_->lost_tick_count;
    Board::LostTick& tick = board_->lost_ticks[count % Board::kLostTicksKept];
    tick.before_ns = before_ns;
    tick.at_ns = at_ns;
    board_->lost_tick_count = count + 1;
  }
  void LockedUp(void* cpu) {
    if (board_ == nullptr) return;
    const std::string words = LastWordsOf(cpu);
    std::memcpy(&board_->last_words, words.data(), sizeof(board_->last_words));
    board_->locked_up = true;
  }
  void Unmodelled(std::uint32_t address, std::uint32_t pc, bool is_write) {
    if (board_ == nullptr || board_->unmodelled_count >= harness::lockstep::RealtimeBoard::kUnmodelledKept)
      return;
    board_->unmodelled[board_->unmodelled_count] = {TimeOf(CLOCK_MONOTONIC), address, pc, is_write};
    ++board_->unmodelled_count;
  }
  void BrokenLimit(const std::string& text) {
    if (board_ == nullptr || board_->broken_limit) return;
    const std::size_t size = text.copy(board_->limit_text, sizeof(board_->limit_text) - 1);
    board_->limit_text[size] = '\0';
    board_->broken_limit = true;
  }

 private:
  harness::lockstep::RealtimeBoard* board_ = nullptr;
};

}  // namespace tiltproof::qemu
