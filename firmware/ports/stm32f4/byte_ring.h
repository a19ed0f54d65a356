// Bytes from one writer to one reader, one of them an interrupt: each side moves only its own index.
//
//   static constinit ByteRing<256> ring;
//   ring.Put(byte);                                                                   // writer
//   for (auto bytes = ring.Front(); !bytes.empty(); bytes = ring.Front()) {           // reader
//     Use(bytes);
//     ring.Drop(bytes.size());
//   }
//
// Indices are masked at every use, so a damaged one never leads elsewhere. The reader notices an impossible
// count, and starts again.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

namespace tiltproof::stm32f4 {

template <std::uint32_t size>
class ByteRing {
  static_assert((size & (size - 1)) == 0, "a power of two");

 public:
  std::uint32_t Count() const { return written_ - read_; }
  std::uint32_t Room() const { return Count() < size ? size - Count() : 0; }

  // Writer. False when it is full.
  bool Put(std::uint8_t byte) {
    if (Count() >= size) return false;
    bytes_[written_ % size] = byte;
    std::atomic_signal_fence(std::memory_order_release);
    written_ = written_ + 1;
    return true;
  }

  // Called by the reader, or while no other code uses the ring: forgets everything when the indices make no
  // sense.
  void MendIndices() {
    if (Count() > size) read_ = written_;
  }

  // Reader: the oldest contiguous bytes; Drop() releases them.
  std::span<const std::uint8_t> Front() {
    MendIndices();
    const std::uint32_t begin = read_ % size;
    const std::uint32_t count = Count();
    std::atomic_signal_fence(std::memory_order_acquire);
    return {bytes_.data() + begin, count < size - begin ? count : size - begin};
  }
  void Drop(std::size_t count) {
    std::atomic_signal_fence(std::memory_order_release);
    read_ = read_ + static_cast<std::uint32_t>(count);
  }

 private:
  volatile std::uint32_t written_ = 0;  // modulo 2^32
  volatile std::uint32_t read_ = 0;
  std::array<std::uint8_t, size> bytes_{};
};

}  // namespace tiltproof::stm32f4
