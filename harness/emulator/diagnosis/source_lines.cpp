#include "harness/emulator/diagnosis/source_lines.h"

#include <dwarf.h>
#include <elfutils/libdw.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "harness/emulator/elf_file.h"

namespace tiltproof::harness {
namespace {

struct Function {
  std::uint32_t address = 0, size_bytes = 0;
  std::string name;
};

// By address. Names stay as the linker has them; those of C++ functions come from the debug information.
std::vector<Function> ReadFunctions(const ElfFile& image) {
  std::vector<Function> functions;
  for (Elf_Scn* section = nullptr; (section = elf_nextscn(image.elf(), section)) != nullptr;) {
    GElf_Shdr header{};
    if (gelf_getshdr(section, &header) == nullptr || header.sh_type != SHT_SYMTAB) continue;
    Elf_Data* data = elf_getdata(section, nullptr);
    GElf_Sym symbol{};
    for (int i = 0; data != nullptr && gelf_getsym(data, i, &symbol) != nullptr; ++i) {
      const char* name = elf_strptr(image.elf(), header.sh_link, symbol.st_name);
      if (GELF_ST_TYPE(symbol.st_info) != STT_FUNC || symbol.st_shndx == SHN_UNDEF || name == nullptr)
        continue;
      // Bit 0 says that it is Thumb code.
      functions.push_back({static_cast<std::uint32_t>(symbol.st_value) & ~1U,
                           static_cast<std::uint32_t>(symbol.st_size), name});
    }
  }
  std::stable_sort(functions.begin(), functions.end(),
                   [](const Function& a, const Function& b) { return a.address < b.address; });
  return functions;
}

struct EndDwarf {
  void operator()(Dwarf* dwarf) const { dwarf_end(dwarf); }
};

// The compilation unit of an address. All are asked, since not every compiler writes an index.
bool FindUnit(Dwarf* dwarf, std::uint32_t address, Dwarf_Die& unit) {
  Dwarf_CU* present = nullptr;
  while (dwarf_get_units(dwarf, present, &present, nullptr, nullptr, &unit, nullptr) == 0)
    if (dwarf_haspc(&unit, address) > 0) return true;
  return false;
}

// The innermost function around an address, which may be an inlined one.
std::string FunctionName(Dwarf_Die& unit, std::uint32_t address) {
  Dwarf_Die* scopes = nullptr;
  const int count = dwarf_getscopes(&unit, address, &scopes);
  std::string name;
  for (int i = 0; i < count && name.empty(); ++i) {
    const int tag = dwarf_tag(&scopes[i]);
    if (tag != DW_TAG_subprogram && tag != DW_TAG_inlined_subroutine) continue;
    if (const char* text = dwarf_diename(&scopes[i])) name = text;
  }
  std::free(scopes);  // NOLINT: as dwarf_getscopes wants
  return name;
}

}  // namespace

struct SourceLines::Content {
  explicit Content(const std::filesystem::path& file)
      : image(file), functions(ReadFunctions(image)), dwarf(dwarf_begin(image.descriptor(), DWARF_C_READ)) {}

  const Function* FunctionAt(std::uint32_t address) const {
    const auto after =
        std::upper_bound(functions.begin(), functions.end(), address,
                         [](std::uint32_t a, const Function& function) { return a < function.address; });
    if (after == functions.begin()) return nullptr;
    const Function& function = *std::prev(after);
    // Functions in assembler often have no size: theirs is up to the next.
    if (function.size_bytes != 0 && address - function.address >= function.size_bytes) return nullptr;
    return &function;
  }

  ElfFile image;
  std::vector<Function> functions;
  std::unique_ptr<Dwarf, EndDwarf> dwarf;  // null without debug information
};

SourceLines::SourceLines(const std::filesystem::path& image) : content_(std::make_unique<Content>(image)) {}
SourceLines::~SourceLines() = default;

SourceLines::Place SourceLines::Find(std::uint32_t address) const {
  Place place;
  Dwarf_Die unit{};
  if (content_->dwarf != nullptr && FindUnit(content_->dwarf.get(), address, unit)) {
    place.function = FunctionName(unit, address);
    if (Dwarf_Line* line = dwarf_getsrc_die(&unit, address)) {
      const char* path = dwarf_linesrc(line, nullptr, nullptr);
      dwarf_lineno(line, &place.line);
      if (path != nullptr) place.file = std::filesystem::path(path).filename().string();
    }
  }
  if (place.function.empty())
    if (const Function* function = content_->FunctionAt(address)) place.function = function->name;
  return place;
}

std::string SourceLines::Describe(std::uint32_t address) const {
  address &= ~1U;
  const Place place = Find(address);
  if (!place.file.empty() && place.line > 0) {
    const std::string line = fmt::format("{}:{}", place.file, place.line);
    return place.function.empty() ? line : fmt::format("{} ({})", place.function, line);
  }
  const Function* function = content_->FunctionAt(address);
  if (function == nullptr) return fmt::format("0x{:08x}", address);
  return fmt::format("{} + 0x{:x}", function->name, address - function->address);
}

std::string SourceLines::DescribeCall(std::uint32_t return_address) const {
  // The call ends right before it.
  return Describe((return_address & ~1U) - 2);
}

}  // namespace tiltproof::harness
