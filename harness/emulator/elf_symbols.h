// The memory of a firmware image by name: where a device fault may act, without a debugger.
//
//   const ElfSymbols image("executive-paper.elf");
//   const MemoryRegion bss = image.Region("bss");              // throws, naming similar ones, when there is none
//   if (auto table = image.FindRegion("gain_table")) Flip(table->address, table->size_bytes);
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tiltproof::harness {

struct MemoryRegion {
  std::uint32_t address = 0;
  std::uint32_t size_bytes = 0;  // at least 1
  friend bool operator==(const MemoryRegion&, const MemoryRegion&) = default;
};

class ElfSymbols {
 public:
  // Reads the symbols of an executable for 32-bit ARM, little-endian; a stripped one has none. Throws
  // std::runtime_error that says what the file is instead.
  explicit ElfSymbols(const std::filesystem::path& file);

  // `ram`: the main SRAM of an STM32F405, 128 KiB from 0x20000000 (RM0090, section 2.3.1). `data`, `bss`,
  // `stack`: from the symbol _sdata to _edata, _sbss to _ebss, _sstack to _estack. Otherwise a variable: a
  // symbol with a size, named as in the symbol table or as in the source (a C++ name with its namespaces).
  // Nullopt when there is none.
  std::optional<MemoryRegion> FindRegion(std::string_view name) const;
  // The same, or std::runtime_error with similar names.
  MemoryRegion Region(std::string_view name) const;

 private:
  struct Symbol {
    std::string name;
    std::uint32_t address = 0, size_bytes = 0;
    bool is_variable = false;
  };
  const Symbol* Find(std::string_view name) const;

  std::filesystem::path file_;
  std::vector<Symbol> symbols_;  // by name, mangled and demangled
};

}  // namespace tiltproof::harness
