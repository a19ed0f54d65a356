// The header of an executable for the board, for images that tests make byte by byte (ELF for the ARM architecture).
#pragma once

#include <elf.h>

#include <cstring>

namespace tiltproof::harness {

// Without segments and sections.
inline Elf32_Ehdr ArmExecutable() {
  Elf32_Ehdr header{};
  std::memcpy(header.e_ident, ELFMAG, SELFMAG);
  header.e_ident[EI_CLASS] = ELFCLASS32;
  header.e_ident[EI_DATA] = ELFDATA2LSB;
  header.e_ident[EI_VERSION] = EV_CURRENT;
  header.e_type = ET_EXEC;
  header.e_machine = EM_ARM;
  header.e_version = EV_CURRENT;
  header.e_ehsize = sizeof(Elf32_Ehdr);
  header.e_phentsize = sizeof(Elf32_Phdr);
  header.e_shentsize = sizeof(Elf32_Shdr);
  return header;
}

}  // namespace tiltproof::harness
