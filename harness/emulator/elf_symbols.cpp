#include "harness/emulator/elf_symbols.h"

#include <cxxabi.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <gelf.h>
#include <libelf.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <system_error>

#include "faults/nearest_name.h"

namespace tiltproof::harness {
namespace {

constexpr MemoryRegion kRam = {.address = 0x2000'0000, .size_bytes = 128 * 1024};

struct Section {
  std::string_view name, begin, end;
};
// As the linker script bounds them.
constexpr std::array kSections = {Section{"data", "_sdata", "_edata"}, Section{"bss", "_sbss", "_ebss"},
                                  Section{"stack", "_sstack", "_estack"}};

// Nothing longer is a mistyped name; the search takes quadratic time.
constexpr std::size_t kNameLengthMax = 100;

class OpenFile {
 public:
  explicit OpenFile(const std::filesystem::path& file)
      : descriptor_(open(file.c_str(), O_RDONLY | O_CLOEXEC)) {}
  ~OpenFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

struct EndElf {
  void operator()(Elf* elf) const { elf_end(elf); }
};

struct Free {
  void operator()(char* text) const { std::free(text); }  // NOLINT: as __cxa_demangle wants
};

[[noreturn]] void Refuse(const std::filesystem::path& file, const std::string& why) {
  throw std::runtime_error(fmt::format("firmware image {}: {}", file.string(), why));
}

void CheckKind(const std::filesystem::path& file, Elf* elf) {
  GElf_Ehdr header{};
  if (elf == nullptr || elf_kind(elf) != ELF_K_ELF || gelf_getehdr(elf, &header) == nullptr)
    Refuse(file, "not an ELF file");
  if (header.e_machine != EM_ARM || header.e_ident[EI_CLASS] != ELFCLASS32 ||
      header.e_ident[EI_DATA] != ELFDATA2LSB)
    Refuse(file, "an ELF file for another processor; must be for ARM, 32 bits, little-endian");
  if (header.e_type != ET_EXEC)
    Refuse(file, "an ELF file that is no executable: was it linked? (an object file or a library is none)");
}

}  // namespace

ElfSymbols::ElfSymbols(const std::filesystem::path& file) : file_(file) {
  const OpenFile opened(file);
  if (opened.descriptor() < 0) Refuse(file, fmt::format("cannot be read: {}", std::strerror(errno)));
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) Refuse(file, "not a file");
  elf_version(EV_CURRENT);
  const std::unique_ptr<Elf, EndElf> elf(elf_begin(opened.descriptor(), ELF_C_READ, nullptr));
  CheckKind(file, elf.get());

  for (Elf_Scn* section = nullptr; (section = elf_nextscn(elf.get(), section)) != nullptr;) {
    GElf_Shdr header{};
    if (gelf_getshdr(section, &header) == nullptr || header.sh_type != SHT_SYMTAB) continue;
    Elf_Data* data = elf_getdata(section, nullptr);
    GElf_Sym symbol{};
    for (int i = 0; data != nullptr && gelf_getsym(data, i, &symbol) != nullptr; ++i) {
      const int type = GELF_ST_TYPE(symbol.st_info);
      if (symbol.st_shndx == SHN_UNDEF || (type != STT_OBJECT && type != STT_NOTYPE)) continue;
      const char* name = elf_strptr(elf.get(), header.sh_link, symbol.st_name);
      // Names with a $ mark ARM code, Thumb code and data (ELF for the Arm architecture, section 5.5.5).
      if (name == nullptr || *name == '\0' || *name == '$') continue;
      Symbol& kept = symbols_.emplace_back();
      kept.name = name;
      kept.address = static_cast<std::uint32_t>(symbol.st_value);
      kept.size_bytes = static_cast<std::uint32_t>(symbol.st_size);
      kept.is_variable = type == STT_OBJECT && kept.size_bytes > 0;
      int status = 0;
      const std::unique_ptr<char, Free> source_name(abi::__cxa_demangle(name, nullptr, nullptr, &status));
      if (kept.name.starts_with("_Z") && status == 0 && source_name) {
        Symbol named = kept;
        named.name = source_name.get();
        symbols_.push_back(std::move(named));
      }
    }
  }
}

const ElfSymbols::Symbol* ElfSymbols::Find(std::string_view name) const {
  const auto found = std::find_if(symbols_.begin(), symbols_.end(),
                                  [&](const Symbol& symbol) { return symbol.name == name; });
  return found == symbols_.end() ? nullptr : &*found;
}

std::optional<MemoryRegion> ElfSymbols::FindRegion(std::string_view name) const {
  if (name == "ram") return kRam;
  for (const Section& section : kSections) {
    if (section.name != name) continue;
    const Symbol* begin = Find(section.begin);
    const Symbol* end = Find(section.end);
    if (begin == nullptr || end == nullptr || end->address <= begin->address) return std::nullopt;
    return MemoryRegion{begin->address, end->address - begin->address};
  }
  const Symbol* symbol = Find(name);
  if (symbol == nullptr || !symbol->is_variable) return std::nullopt;
  // Constants lie in flash, where nothing flips.
  if (symbol->address < kRam.address || symbol->address - kRam.address > kRam.size_bytes - symbol->size_bytes)
    return std::nullopt;
  return MemoryRegion{symbol->address, symbol->size_bytes};
}

MemoryRegion ElfSymbols::Region(std::string_view name) const {
  if (const auto region = FindRegion(name)) return *region;
  if (symbols_.empty())
    Refuse(file_,
           fmt::format("no region '{}': it has no symbols; was it stripped? Only `ram` is known", name));
  for (const Section& section : kSections)
    if (section.name == name)
      Refuse(file_,
             fmt::format("no region '{}': its linker script does not bound it by the symbols {} and {}, "
                         "or it is empty",
                         name, section.begin, section.end));
  std::vector<std::string_view> names = {"ram"};
  for (const Section& section : kSections) names.push_back(section.name);
  for (const Symbol& symbol : symbols_)
    if (symbol.is_variable && symbol.name.size() <= kNameLengthMax) names.push_back(symbol.name);
  const auto nearest = name.size() > kNameLengthMax ? std::string_view() : faults::NearestName(name, names);
  Refuse(file_,
         fmt::format("no memory region or variable '{}'{}", name,
                     nearest.empty() ? std::string("; there are ram, data, bss, stack and the variables that "
                                                   "`arm-none-eabi-nm -S` lists with a size")
                                     : fmt::format("; did you mean '{}'?", nearest)));
}

}  // namespace tiltproof::harness
