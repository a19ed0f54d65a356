// The peripherals of the chip that neither QEMU nor this plug-in models: accesses are noted, and answered as before.
// QEMU's place holders read 0 and keep nothing; where nothing is, an access is a bus fault.
//
//   unmodelled.Init([](std::uint32_t address, bool is_write) { ... });  // the first access to each page
//
// The region lies in front of QEMU's place holders and behind everything that is modelled.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/readers.h"

namespace tiltproof::qemu {

class Unmodelled {
 public:
  using Note = void (*)(std::uint32_t address, bool is_write);
  // A firmware that scans the address space is noted as often as this.
  static constexpr std::uint32_t kNotesMax = harness::lockstep::RealtimeBoard::kUnmodelledKept;

  // Before any block is mapped.
  void Init(Note note) {
    note_ = note;
    for (std::uint32_t page = 0; page < kPages; ++page) holder_[page] = Answers(kAddress + page * kPageBytes);
    ops_ = {.read = nullptr,
            .write = nullptr,
            .read_with_attrs = Read,
            .write_with_attrs = Write,
            .valid = {},
            .impl = {}};
    memory_region_init_io(region_.data(), nullptr, &ops_, this, "unmodelled",
                          std::uint64_t{kPages} * kPageBytes);
    memory_region_add_subregion_overlap(get_system_memory(), kAddress, region_.data(), kPriority);
  }

  // While the harness looks at memory, nothing is noted.
  void SetQuiet(bool quiet) { quiet_ = quiet; }

 private:
  // RM0090, section 2.3: APB1 to AHB2.
  static constexpr std::uint32_t kAddress = 0x4000'0000, kPageBytes = 0x400,
                                 kPages = 0x1006'1000 / kPageBytes;
  // create_unimplemented_device() maps at -1000, everything else at 0 and above.
  static constexpr int kPriority = -500;
  static constexpr std::uint32_t kOk = 0, kDecodeError = 2;  // MEMTX_OK, MEMTX_DECODE_ERROR

  // True if QEMU has something at an address.
  static bool Answers(std::uint32_t address) {
    // AHB1 ends below, and AHB2 begins above: the space between them is empty.
    constexpr std::uint32_t kAhb1End = 0x4008'0000, kAhb2 = 0x5000'0000;
    if (address >= kAhb1End && address < kAhb2) return false;
    std::uint32_t word = 0;
    return address_space_rw(cpu_get_address_space(qemu_get_cpu(0), 0), address, 0, &word, sizeof word,
                            false) == kOk;
  }

  std::uint32_t Take(std::uint64_t offset, bool is_write) {
    const auto page = static_cast<std::uint32_t>(offset / kPageBytes);
    if (!quiet_ && !noted_[page] && notes_count_ < kNotesMax) {
      noted_[page] = true;
      ++notes_count_;
      note_(kAddress + static_cast<std::uint32_t>(offset), is_write);
    }
    return holder_[page] ? kOk : kDecodeError;
  }
  static std::uint32_t Read(void* self, std::uint64_t offset, std::uint64_t* value, unsigned /*size*/,
                            std::uint32_t /*attributes*/) {
    *value = 0;
    return static_cast<Unmodelled*>(self)->Take(offset, false);
  }
  static std::uint32_t Write(void* self, std::uint64_t offset, std::uint64_t /*value*/, unsigned /*size*/,
                             std::uint32_t /*attributes*/) {
    return static_cast<Unmodelled*>(self)->Take(offset, true);
  }

  Note note_ = nullptr;
  std::bitset<kPages> holder_;  // QEMU has a place holder there, or a block
  std::bitset<kPages> noted_;
  std::uint32_t notes_count_ = 0;
  bool quiet_ = false;
  MemoryRegionOps ops_{};
  alignas(16) std::array<std::uint8_t, kMemoryRegionBytes> region_{};
};

inline Unmodelled& unmodelled = *new Unmodelled;

}  // namespace tiltproof::qemu
