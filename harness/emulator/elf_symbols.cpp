#include "harness/emulator/elf_symbols.h"

#include <cxxabi.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <utility>

#include "faults/nearest_name.h"
#include "harness/emulator/elf_file.h"
#include "harness/emulator/image_check.h"

namespace tiltproof::harness {
namespace {

struct Section {
  std::string_view name, begin, end, in_file;
};
// As the linker script bounds them, and the section of the file otherwise.
constexpr std::array kSections = {Section{"data", "_sdata", "_edata", ".data"},
                                  Section{"bss", "_sbss", "_ebss", ".bss"},
                                  Section{"stack", "_sstack", "_estack", ""}};
// STM32CubeMX's linker scripts define it.
constexpr std::string_view kStackSize = "_Min_Stack_Size";

// Nothing longer is a mistyped name; the search takes quadratic time.
constexpr std::size_t kNameLengthMax = 100;

struct Free {
  void operator()(char* text) const { std::free(text); }  // NOLINT: as __cxa_demangle wants
};

// "" for a name that is not mangled.
std::string SourceName(const std::string& name) {
  if (!name.starts_with("_Z")) return {};
  int status = 0;
  const std::unique_ptr<char, Free> source_name(abi::__cxa_demangle(name.c_str(), nullptr, nullptr, &status));
  return status == 0 && source_name ? source_name.get() : "";
}

}  // namespace

ElfSymbols::ElfSymbols(const std::filesystem::path& file) : file_(file) {
  const ElfFile image(file);
  ReadSymbols(image);
  ReadSections(image);
  if (const auto table = FindVectorTable(image)) stack_pointer_ = table->stack_pointer;
}

void ElfSymbols::ReadSymbols(const ElfFile& image) {
  for (Elf_Scn* section = nullptr; (section = elf_nextscn(image.elf(), section)) != nullptr;) {
    GElf_Shdr header{};
    if (gelf_getshdr(section, &header) == nullptr || header.sh_type != SHT_SYMTAB) continue;
    Elf_Data* data = elf_getdata(section, nullptr);
    std::string source_file;  // of the local symbols that follow (System V ABI, chapter 4, STT_FILE)
    GElf_Sym symbol{};
    for (int i = 0; data != nullptr && gelf_getsym(data, i, &symbol) != nullptr; ++i) {
      const int type = GELF_ST_TYPE(symbol.st_info);
      const char* name = elf_strptr(image.elf(), header.sh_link, symbol.st_name);
      if (type == STT_FILE) source_file = name == nullptr ? "" : name;
      if (symbol.st_shndx == SHN_UNDEF || (type != STT_OBJECT && type != STT_NOTYPE)) continue;
      // Names with a $ mark ARM code, Thumb code and data (ELF for the Arm architecture, section 5.5.5).
      if (name == nullptr || *name == '\0' || *name == '$') continue;
      const auto size_bytes = static_cast<std::uint32_t>(symbol.st_size);
      Add({.name = name,
           .file = GELF_ST_BIND(symbol.st_info) == STB_LOCAL ? source_file : "",
           .address = static_cast<std::uint32_t>(symbol.st_value),
           .size_bytes = size_bytes,
           .is_variable = type == STT_OBJECT && size_bytes > 0});
    }
  }
}

void ElfSymbols::Add(Symbol symbol) {
  std::string source_name = SourceName(symbol.name);
  symbols_.push_back(symbol);
  if (source_name.empty()) return;
  symbol.name = std::move(source_name);
  symbols_.push_back(std::move(symbol));
}

void ElfSymbols::ReadSections(const ElfFile& image) {
  for (Elf_Scn* section = nullptr; (section = elf_nextscn(image.elf(), section)) != nullptr;) {
    GElf_Shdr header{};
    if (gelf_getshdr(section, &header) == nullptr || (header.sh_flags & SHF_ALLOC) == 0) continue;
    if (!Holds(kRam, header.sh_addr, std::max<GElf_Xword>(header.sh_size, 1))) continue;
    const MemoryRegion region{static_cast<std::uint32_t>(header.sh_addr),
                              static_cast<std::uint32_t>(header.sh_size)};
    const std::string name = image.SectionName(section);
    for (const Section& known : kSections)
      if (!known.in_file.empty() && known.in_file == name && region.size_bytes > 0)
        sections_.emplace(known.name, region);
    // A section of its own for the stack is no variable.
    if (name.find("stack") == name.npos)
      variables_end_ = std::max(variables_end_, region.address + region.size_bytes);
  }
}

const ElfSymbols::Symbol* ElfSymbols::Find(std::string_view name) const {
  const auto found = std::find_if(symbols_.begin(), symbols_.end(),
                                  [&](const Symbol& symbol) { return symbol.name == name; });
  return found == symbols_.end() ? nullptr : &*found;
}

std::vector<const ElfSymbols::Symbol*> ElfSymbols::FindVariables(std::string_view name) const {
  std::string_view file;
  // A colon that is not one of two, as in C++.
  const std::size_t colon = name.find(':');
  if (colon != name.npos && name.substr(colon, 2) != "::") {
    file = name.substr(0, colon);
    name.remove_prefix(colon + 1);
  }
  std::vector<const Symbol*> found;
  for (const Symbol& symbol : symbols_) {
    if (!symbol.is_variable || symbol.name != name || (!file.empty() && symbol.file != file)) continue;
    const auto same = [&](const Symbol* other) { return other->address == symbol.address; };
    if (std::none_of(found.begin(), found.end(), same)) found.push_back(&symbol);
  }
  return found;
}

std::optional<MemoryRegion> ElfSymbols::FindStack() const {
  if (!stack_pointer_ || !Holds(kRam, std::uint64_t{*stack_pointer_} - 1)) return std::nullopt;
  // The value of a symbol that is a size is its address.
  const Symbol* size = Find(kStackSize);
  const std::uint32_t room = *stack_pointer_ - kRam.address;
  if (size != nullptr && size->address > 0 && size->address <= room)
    return MemoryRegion{*stack_pointer_ - size->address, size->address};
  if (*stack_pointer_ <= variables_end_) return std::nullopt;
  return MemoryRegion{variables_end_, *stack_pointer_ - variables_end_};
}

std::optional<MemoryRegion> ElfSymbols::MainStack() const {
  if (!stack_pointer_ || !IsStackPointer(*stack_pointer_)) return std::nullopt;
  const std::uint32_t end = *stack_pointer_;
  const MemoryRegion& memory = Holds(kRam, std::uint64_t{end} - 4, 4) ? kRam : kCoreCoupledRam;
  const auto down_to = [&](std::uint32_t begin) -> std::optional<MemoryRegion> {
    if (begin % 4 != 0 || begin < memory.address || begin >= end) return std::nullopt;
    return MemoryRegion{begin, end - begin};
  };
  for (const char* lowest : {"_sstack", "__StackLimit", "__stack_limit", "__main_stack_base__"})
    if (const Symbol* begin = Find(lowest))
      if (const auto stack = down_to(begin->address)) return stack;
  // The value of a symbol that is a size is its address.
  const Symbol* size = Find(kStackSize);
  return size == nullptr ? std::nullopt : down_to(end - size->address);
}

std::vector<std::pair<std::string, MemoryRegion>> ElfSymbols::Variables() const {
  std::map<std::uint32_t, std::pair<std::string, MemoryRegion>> by_address;
  for (const Symbol& symbol : symbols_) {
    const MemoryRegion region{symbol.address, symbol.size_bytes};
    const bool in_ram = Holds(kRam, region.address, region.size_bytes) ||
                        Holds(kCoreCoupledRam, region.address, region.size_bytes);
    // The last one is the demangled name.
    if (symbol.is_variable && in_ram) by_address[symbol.address] = {symbol.name, region};
  }
  std::vector<std::pair<std::string, MemoryRegion>> variables;
  for (auto& [address, variable] : by_address) variables.push_back(std::move(variable));
  return variables;
}

std::optional<MemoryRegion> ElfSymbols::FindRegion(std::string_view name) const {
  if (name == "ram") return kRam;
  for (const Section& section : kSections) {
    if (section.name != name) continue;
    const Symbol* begin = Find(section.begin);
    const Symbol* end = Find(section.end);
    if (begin != nullptr && end != nullptr) {
      if (end->address <= begin->address) return std::nullopt;
      return MemoryRegion{begin->address, end->address - begin->address};
    }
    if (section.in_file.empty()) return FindStack();
    const auto found = sections_.find(name);
    return found == sections_.end() ? std::nullopt : std::optional(found->second);
  }
  const auto variables = FindVariables(name);
  if (variables.size() != 1) return std::nullopt;
  const Symbol& variable = *variables.front();
  // Constants lie in flash, where nothing flips.
  if (!Holds(kRam, variable.address, variable.size_bytes)) return std::nullopt;
  return MemoryRegion{variable.address, variable.size_bytes};
}

std::optional<MemoryRegion> ElfSymbols::FindConstant(std::string_view name) const {
  const auto variables = FindVariables(name);
  if (variables.size() != 1) return std::nullopt;
  const MemoryRegion region{variables.front()->address, variables.front()->size_bytes};
  return Holds(kFlash, region.address, region.size_bytes) ? std::optional(region) : std::nullopt;
}

std::string ElfSymbols::NameAt(std::uint32_t address) const {
  const Symbol* found = nullptr;
  for (const Symbol& symbol : symbols_)
    // The last one is the demangled name.
    if (symbol.is_variable && address - symbol.address < symbol.size_bytes) found = &symbol;
  if (found == nullptr) return {};
  return address == found->address ? found->name
                                   : fmt::format("{} + 0x{:x}", found->name, address - found->address);
}

MemoryRegion ElfSymbols::Region(std::string_view name) const {
  if (const auto region = FindRegion(name)) return *region;
  if (symbols_.empty() && sections_.find(name) == sections_.end())
    RefuseImage(file_,
                fmt::format("no region '{}': it has no symbols; was it stripped? Only `ram` is known", name));
  for (const Section& section : kSections)
    if (section.name == name)
      RefuseImage(
          file_,
          fmt::format("no region '{}': its linker script does not bound it by the symbols {} and {}, "
                      "and {}, or it is empty",
                      name, section.begin, section.end,
                      section.in_file.empty() ? std::string("its initial stack pointer leaves no room")
                                              : fmt::format("it has no section {} in RAM", section.in_file)));

  const auto variables = FindVariables(name);
  if (variables.size() > 1) {
    std::vector<std::string> places;
    for (const Symbol* variable : variables)
      places.push_back(fmt::format("0x{:08x} ({})", variable->address,
                                   variable->file.empty() ? "global" : variable->file));
    const auto in_file = std::find_if(variables.begin(), variables.end(),
                                      [](const Symbol* variable) { return !variable->file.empty(); });
    RefuseImage(file_, fmt::format("'{}' is ambiguous, there are {} variables of that name: {}{}", name,
                                   variables.size(), fmt::join(places, ", "),
                                   in_file == variables.end()
                                       ? ""
                                       : fmt::format("; name one as '{}:{}'", (*in_file)->file, name)));
  }
  if (!variables.empty()) {
    const Symbol& variable = *variables.front();
    const std::string place = PlaceName(variable.address);
    RefuseImage(file_, fmt::format("'{}' is {} ({} bytes at 0x{:08x}), where nothing flips; only RAM does",
                                   name, place == "flash" ? "a constant in flash" : "in " + place,
                                   variable.size_bytes, variable.address));
  }

  std::vector<std::string_view> names = {"ram"};
  for (const Section& section : kSections) names.push_back(section.name);
  for (const Symbol& symbol : symbols_)
    if (symbol.is_variable && symbol.name.size() <= kNameLengthMax) names.push_back(symbol.name);
  const auto nearest = name.size() > kNameLengthMax ? std::string_view() : faults::NearestName(name, names);
  RefuseImage(file_, fmt::format("no memory region or variable '{}'{}", name,
                                 nearest.empty()
                                     ? std::string("; there are ram, data, bss, stack and the variables that "
                                                   "`arm-none-eabi-nm -S` lists with a size")
                                     : fmt::format("; did you mean '{}'?", nearest)));
}

}  // namespace tiltproof::harness
