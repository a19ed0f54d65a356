// The processor's registers and the memory that it sees, for messages.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "harness/emulator/lockstep_protocol.h"
#include "harness/emulator/plugin/qemu_internals.h"
#include "harness/emulator/plugin/unmodelled.h"

namespace tiltproof::qemu {

inline std::string DumpState(void* cpu) {
  char* text = nullptr;
  std::size_t size = 0;
  std::FILE* file = open_memstream(&text, &size);
  cpu_dump_state(cpu, file, 0);
  std::fclose(file);
  const std::string dump(text, size);
  std::free(text);
  return dump;
}

// With the processor's own peripherals. Zeros where nothing is.
inline void ReadAsProcessor(void* cpu, std::uint32_t address, void* buffer, std::size_t size) {
  unmodelled.SetQuiet(true);
  address_space_rw(cpu_get_address_space(cpu, 0), address, 0, buffer, size, false);
  unmodelled.SetQuiet(false);
}

// The value of a register in a dump: "R13" for instance; 0 when it is not there.
inline std::uint32_t RegisterIn(const std::string& dump, const char* name) {
  const std::size_t at = dump.find(std::string(name) + "=");
  if (at == dump.npos) return 0;
  return static_cast<std::uint32_t>(std::strtoul(dump.c_str() + dump.find('=', at) + 1, nullptr, 16));
}

// The body of a message kLastWords.
inline std::string LastWordsOf(void* cpu) {
  constexpr std::uint32_t kFaultRegisters = 0xE000'ED28;
  harness::lockstep::LastWords words{};
  const std::string dump = DumpState(cpu);
  ReadAsProcessor(cpu, kFaultRegisters, words.faults, sizeof(words.faults));
  ReadAsProcessor(cpu, RegisterIn(dump, "R13"), words.stack, sizeof(words.stack));
  return std::string(reinterpret_cast<const char*>(&words), sizeof(words)) + dump;
}

}  // namespace tiltproof::qemu
