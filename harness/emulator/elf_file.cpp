#include "harness/emulator/elf_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "harness/emulator/stm32f405.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kGiveTheElf =
    "give the ELF file that the linker wrote, from which objcopy made this one (often the same name with "
    ".elf, .axf or "
    ".out)";

std::uint32_t Word(const std::string& bytes, std::size_t at) {
  std::uint32_t word = 0;
  if (at + sizeof word <= bytes.size()) std::memcpy(&word, bytes.data() + at, sizeof word);
  return word;
}

// Two record types of the Intel hexadecimal format and of Motorola's S-records begin every file of theirs.
bool IsText(const std::string& bytes, std::string_view first, std::size_t digits) {
  return bytes.starts_with(first) && bytes.size() >= first.size() + digits &&
         std::all_of(bytes.begin() + static_cast<std::ptrdiff_t>(first.size()),
                     bytes.begin() + static_cast<std::ptrdiff_t>(first.size() + digits),
                     [](unsigned char c) { return std::isxdigit(c) != 0; });
}

// Describes a file that is no ELF file, by its first bytes.
std::string WhatElse(const std::string& bytes) {
  constexpr std::size_t kDigits = 10;
  if (bytes.empty()) return "empty, not an ELF file: build it again";
  if (bytes.starts_with(ELFMAG)) return "truncated: it ends within its header; copy or build it again";
  if (IsText(bytes, ":", kDigits)) return fmt::format("an Intel HEX file, not an ELF file: {}", kGiveTheElf);
  if (IsText(bytes, "S0", kDigits))
    return fmt::format("a file of S-records, not an ELF file: {}", kGiveTheElf);
  if (IsStackPointer(Word(bytes, 0)) && (Word(bytes, 4) & 1) != 0 && Holds(kFlash, Word(bytes, 4) & ~1U))
    return fmt::format("a raw binary (it begins with a vector table), not an ELF file: {}", kGiveTheElf);
  return "not an ELF file: give the file that the linker wrote (.elf)";
}

std::string ProcessorName(int machine) {
  struct Named {
    int machine;
    const char* name;
  };
  constexpr std::array kNames = {Named{EM_386, "x86 (32 bits)"},
                                 Named{EM_X86_64, "x86-64"},
                                 Named{EM_AARCH64, "AArch64 (64-bit ARM)"},
                                 Named{EM_RISCV, "RISC-V"},
                                 Named{EM_XTENSA, "Xtensa"},
                                 Named{EM_AVR, "AVR"},
                                 Named{EM_MIPS, "MIPS"},
                                 Named{EM_PPC, "PowerPC"},
                                 Named{EM_MSP430, "MSP430"},
                                 Named{EM_ARM, "ARM, but big-endian or of 64 bits"}};
  for (const auto& [number, name] : kNames)
    if (number == machine) return name;
  return fmt::format("ELF machine {}", machine);
}

void CheckKind(const std::filesystem::path& file, int descriptor, Elf* elf) {
  GElf_Ehdr header{};
  if (elf == nullptr || elf_kind(elf) != ELF_K_ELF) {
    std::string begin(16, '\0');
    const ssize_t n = pread(descriptor, begin.data(), begin.size(), 0);
    begin.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
    RefuseImage(file, WhatElse(begin));
  }
  if (gelf_getehdr(elf, &header) == nullptr)
    RefuseImage(file, "truncated: it ends within its header; copy or build it again");
  if (header.e_machine != EM_ARM || header.e_ident[EI_CLASS] != ELFCLASS32 ||
      header.e_ident[EI_DATA] != ELFDATA2LSB)
    RefuseImage(
        file, fmt::format("an ELF file for another processor ({}); must be for ARM, 32 bits, little-endian: "
                          "build it with arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb",
                          ProcessorName(header.e_machine)));
  if (header.e_type != ET_EXEC)
    RefuseImage(file,
                "an ELF file that is not executable: was it linked? (an object file or a library is not)");
}

}  // namespace

void RefuseImage(const std::filesystem::path& file, const std::string& why) {
  throw std::runtime_error(fmt::format("firmware image {}: {}", file.string(), why));
}

ElfFile::ElfFile(const std::filesystem::path& file) : descriptor_(open(file.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (descriptor_.get() < 0) RefuseImage(file, fmt::format("cannot be read: {}", std::strerror(errno)));
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) RefuseImage(file, "not a file");
  size_bytes_ = std::filesystem::file_size(file, error);
  elf_version(EV_CURRENT);
  elf_.reset(elf_begin(descriptor_.get(), ELF_C_READ, nullptr));
  CheckKind(file, descriptor_.get(), elf_.get());
}

std::string ElfFile::SectionName(Elf_Scn* section) const {
  std::size_t names = 0;
  GElf_Shdr header{};
  if (elf_getshdrstrndx(elf(), &names) != 0 || gelf_getshdr(section, &header) == nullptr) return {};
  const char* name = elf_strptr(elf(), names, header.sh_name);
  return name == nullptr ? "" : name;
}

}  // namespace tiltproof::harness
