// A firmware image as libelf reads it, open for as long as this exists.
//
//   const ElfFile image("firmware.elf");           // throws std::runtime_error that says what the file is instead
//   for (Elf_Scn* section = nullptr; (section = elf_nextscn(image.elf(), section)) != nullptr;) { ... }
#pragma once

#include <gelf.h>
#include <libelf.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "link/unix_socket.h"

namespace tiltproof::harness {

class ElfFile {
 public:
  // An executable for 32-bit ARM, little-endian. Its contents may still be damaged.
  explicit ElfFile(const std::filesystem::path& file);

  Elf* elf() const { return elf_.get(); }
  int descriptor() const { return descriptor_.get(); }
  std::uint64_t size_bytes() const { return size_bytes_; }
  // "" when it has none.
  std::string SectionName(Elf_Scn* section) const;

 private:
  struct End {
    void operator()(Elf* elf) const { elf_end(elf); }
  };

  link::OwnedDescriptor descriptor_;
  std::uint64_t size_bytes_ = 0;
  std::unique_ptr<Elf, End> elf_;
};

// Throws std::runtime_error: "firmware image FILE: ...".
[[noreturn]] void RefuseImage(const std::filesystem::path& file, const std::string& why);

}  // namespace tiltproof::harness
