// The memory of a firmware image by name: where a device fault may act, without a debugger.
//
//   const ElfSymbols image("executive-paper.elf");
//   const MemoryRegion bss = image.Region("bss");              // throws, naming similar ones, when there is none
//   if (auto table = image.FindRegion("gain_table")) Flip(table->address, table->size_bytes);
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/emulator/stm32f405.h"

namespace tiltproof::harness {

class ElfFile;

// An image may have a TiltproofClientStatus of this name (firmware/tiltproof_client.h), which is read in flight.
inline constexpr std::string_view kStatusSymbol = "tiltproof_status";
// And one of this name with its role among several boards, of up to four bytes, the least significant first.
inline constexpr std::string_view kRoleSymbol = "tiltproof_role";
// And a constant of this name, a word in flash: the harness writes the board's place among several there.
inline constexpr std::string_view kPlaceSymbol = "tiltproof_place";

class ElfSymbols {
 public:
  // Reads the symbols of an executable for 32-bit ARM, little-endian; a stripped one has none. Throws
  // std::runtime_error that says what the file is instead.
  explicit ElfSymbols(const std::filesystem::path& file);

  // `ram`: the main SRAM of an STM32F405, 128 KiB from 0x20000000 (RM0090, section 2.3.1).
  // `data`, `bss`: from the symbol _sdata to _edata, _sbss to _ebss; without them the sections .data and .bss.
  // `stack`: from the symbol _sstack to _estack; without _sstack the _Min_Stack_Size bytes (STM32CubeMX) below
  // the initial stack pointer; without that all below it, down to the last variable.
  // Otherwise a variable in RAM: a symbol with a size, named as in the symbol table or as in the source (a C++
  // name with its namespaces). A static one also by its file, as `motor.c:state`.
  // Nullopt when there is none, or several of that name.
  std::optional<MemoryRegion> FindRegion(std::string_view name) const;
  // The constant in flash of that name, in the symbol table's or the source's spelling. Nullopt when there is none.
  std::optional<MemoryRegion> FindConstant(std::string_view name) const;
  // As FindRegion(), or std::runtime_error with similar names.
  MemoryRegion Region(std::string_view name) const;
  // The main stack, from the initial stack pointer down to one of the symbols that linker scripts have for its lowest address, or as many
  // bytes as _Min_Stack_Size (harness/emulator/image_stacks.h). Nullopt when the image has neither.
  std::optional<MemoryRegion> MainStack() const;
  // All variables in RAM, by address: each one once, named as in the source.
  std::vector<std::pair<std::string, MemoryRegion>> Variables() const;
  // The variable that holds an address: `tick_count`, or `rings + 0x108` for one inside it. "" when there is none.
  std::string NameAt(std::uint32_t address) const;

 private:
  struct Symbol {
    std::string name, file;  // file: of a static one, where the symbol table tells
    std::uint32_t address = 0, size_bytes = 0;
    bool is_variable = false;
  };
  void ReadSymbols(const ElfFile& image);
  void ReadSections(const ElfFile& image);
  void Add(Symbol symbol);
  const Symbol* Find(std::string_view name) const;
  // Variables of that name at different addresses.
  std::vector<const Symbol*> FindVariables(std::string_view name) const;
  std::optional<MemoryRegion> FindStack() const;

  std::filesystem::path file_;
  std::vector<Symbol> symbols_;                                // by name, mangled and demangled
  std::map<std::string, MemoryRegion, std::less<>> sections_;  // `data` and `bss`
  std::optional<std::uint32_t> stack_pointer_;                 // the initial one
  std::uint32_t variables_end_ = kRam.address;                 // of what the linker has placed in RAM
};

}  // namespace tiltproof::harness
