#include "harness/emulator/diagnosis/watched_variable.h"

#include <dwarf.h>
#include <elfutils/libdw.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "faults/nearest_name.h"
#include "harness/emulator/elf_file.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

struct CloseDwarf {
  void operator()(Dwarf* dwarf) const { dwarf_end(dwarf); }
};

struct Variable {
  std::string name, file;
  std::uint32_t address = 0;
  Dwarf_Die type{};
};

struct ImageName {
  const std::filesystem::path& file;
  std::string_view name;
  [[noreturn]] void Refuse(const std::string& why) const {
    RefuseImage(file, fmt::format("'{}': {}", name, why));
  }
};

std::string NameOf(Dwarf_Die& die) {
  const char* name = dwarf_diename(&die);
  return name == nullptr ? "" : name;
}

// Without typedef, const and volatile.
bool TypeOf(Dwarf_Die& die, Dwarf_Die& type) {
  Dwarf_Attribute attribute{};
  Dwarf_Die as_written{};
  if (dwarf_formref_die(dwarf_attr_integrate(&die, DW_AT_type, &attribute), &as_written) == nullptr)
    return false;
  return dwarf_peel_type(&as_written, &type) == 0;
}

// The address of a variable that stays at one; nullopt for any other.
std::optional<std::uint32_t> AddressOf(Dwarf_Die& die) {
  Dwarf_Attribute attribute{};
  Dwarf_Op* operations = nullptr;
  std::size_t count = 0;
  if (dwarf_getlocation(dwarf_attr_integrate(&die, DW_AT_location, &attribute), &operations, &count) != 0)
    return std::nullopt;
  if (count != 1 || operations[0].atom != DW_OP_addr) return std::nullopt;
  return static_cast<std::uint32_t>(operations[0].number);
}

// Those below a unit, a namespace or a function.
void Collect(Dwarf_Die& parent, const std::string& scope, const std::string& file,
             std::vector<Variable>& found) {
  Dwarf_Die die{};
  if (dwarf_child(&parent, &die) != 0) return;
  do {
    const int tag = dwarf_tag(&die);
    if (tag == DW_TAG_namespace) {
      const std::string name = NameOf(die);
      Collect(die, scope + (name.empty() ? "(anonymous namespace)" : name) + "::", file, found);
    } else if (tag == DW_TAG_subprogram || tag == DW_TAG_lexical_block) {
      Collect(die, scope, file, found);
    } else if (tag == DW_TAG_variable) {
      Variable variable{.name = scope + NameOf(die), .file = file};
      const auto address = AddressOf(die);
      if (!address || !TypeOf(die, variable.type)) continue;
      variable.address = *address;
      found.push_back(std::move(variable));
    }
  } while (dwarf_siblingof(&die, &die) == 0);
}

std::vector<Variable> CollectVariables(Dwarf* dwarf) {
  std::vector<Variable> found;
  Dwarf_CU* present = nullptr;
  Dwarf_Die unit{};
  while (dwarf_get_units(dwarf, present, &present, nullptr, nullptr, &unit, nullptr) == 0)
    Collect(unit, "", std::filesystem::path(NameOf(unit)).filename().string(), found);
  return found;
}

// True if a variable has this name, with or without its namespaces.
bool IsNamed(const Variable& variable, std::string_view name) {
  return variable.name == name || variable.name.ends_with("::" + std::string(name));
}

Variable FindByName(const ImageName& image, const std::vector<Variable>& all, std::string_view name) {
  std::string_view file;
  if (const std::size_t colon = name.find(':'); colon != name.npos && name.substr(colon, 2) != "::") {
    file = name.substr(0, colon);
    name.remove_prefix(colon + 1);
  }
  std::vector<const Variable*> found;
  for (const Variable& variable : all) {
    if (!IsNamed(variable, name) || (!file.empty() && variable.file != file)) continue;
    const auto same = [&](const Variable* other) { return other->address == variable.address; };
    if (std::none_of(found.begin(), found.end(), same)) found.push_back(&variable);
  }
  if (found.size() == 1) return *found.front();
  if (found.size() > 1) {
    std::vector<std::string> places;
    for (const Variable* variable : found)
      places.push_back(fmt::format("{}:{}", variable->file, variable->name));
    image.Refuse(
        fmt::format("there are {} variables of that name: {}", found.size(), fmt::join(places, ", ")));
  }
  std::vector<std::string_view> names;
  for (const Variable& variable : all) names.push_back(variable.name);
  const auto nearest = faults::NearestName(name, names);
  image.Refuse(nearest.empty() ? "there is no such variable"
                               : fmt::format("there is no such variable; did you mean '{}'?", nearest));
}

bool IsRecord(int tag) {
  return tag == DW_TAG_structure_type || tag == DW_TAG_class_type || tag == DW_TAG_union_type;
}

std::uint64_t NumberOf(Dwarf_Die& die, unsigned name, std::uint64_t otherwise) {
  Dwarf_Attribute attribute{};
  Dwarf_Word value = 0;
  return dwarf_formudata(dwarf_attr_integrate(&die, name, &attribute), &value) == 0 ? value : otherwise;
}

std::uint32_t SizeOf(Dwarf_Die& type) {
  Dwarf_Word size = 0;
  return dwarf_aggregate_size(&type, &size) == 0 ? static_cast<std::uint32_t>(size) : 0;
}

std::vector<std::string> MemberNames(Dwarf_Die& record) {
  std::vector<std::string> names;
  Dwarf_Die die{};
  if (dwarf_child(&record, &die) != 0) return names;
  do {
    if (dwarf_tag(&die) == DW_TAG_member && !NameOf(die).empty()) names.push_back(NameOf(die));
  } while (dwarf_siblingof(&die, &die) == 0);
  return names;
}

// On to a member of a structure.
void EnterMember(const ImageName& image, Variable& at, std::string_view member) {
  Dwarf_Die die{};
  if (IsRecord(dwarf_tag(&at.type)) && dwarf_child(&at.type, &die) == 0) {
    do {
      if (dwarf_tag(&die) != DW_TAG_member || NameOf(die) != member) continue;
      if (dwarf_hasattr_integrate(&die, DW_AT_bit_size) != 0 ||
          dwarf_hasattr_integrate(&die, DW_AT_data_bit_offset) != 0)
        image.Refuse(fmt::format("'{}' is a bit field, which cannot be watched", member));
      at.address += static_cast<std::uint32_t>(NumberOf(die, DW_AT_data_member_location, 0));
      if (!TypeOf(die, at.type)) image.Refuse(fmt::format("the type of '{}' is unknown", member));
      return;
    } while (dwarf_siblingof(&die, &die) == 0);
    image.Refuse(
        fmt::format("there is no member '{}'; there are {}", member, fmt::join(MemberNames(at.type), ", ")));
  }
  image.Refuse(fmt::format("there is no member '{}': it is not a structure", member));
}

// On to an element of an array. The dimensions of an array of arrays are children of one type: `dimension` counts them.
void EnterElement(const ImageName& image, Variable& at, std::size_t dimension, std::size_t index, bool last) {
  if (dwarf_tag(&at.type) != DW_TAG_array_type) image.Refuse(fmt::format("[{}]: it is not an array", index));
  std::vector<std::uint64_t> counts;
  Dwarf_Die die{};
  if (dwarf_child(&at.type, &die) == 0) {
    do {
      if (dwarf_tag(&die) == DW_TAG_subrange_type)
        counts.push_back(NumberOf(die, DW_AT_count, NumberOf(die, DW_AT_upper_bound, ~std::uint64_t{0}) + 1));
    } while (dwarf_siblingof(&die, &die) == 0);
  }
  if (dimension >= counts.size())
    image.Refuse(fmt::format("[{}]: the array has {} dimension(s)", index, counts.size()));
  if (index >= counts[dimension])
    image.Refuse(fmt::format("[{}]: the array has {} elements", index, counts[dimension]));
  Dwarf_Die element{};
  if (!TypeOf(at.type, element)) image.Refuse("the type of the array's elements is unknown");
  std::uint64_t size = SizeOf(element);
  for (std::size_t i = dimension + 1; i < counts.size(); ++i) size *= counts[i];
  at.address += static_cast<std::uint32_t>(index * size);
  if (!last) return;
  if (dimension + 1 < counts.size())
    image.Refuse(fmt::format("the array has {} dimensions: name an element", counts.size()));
  at.type = element;
}

// Members and elements: ".gains[3]".
void Enter(const ImageName& image, Variable& at, std::string_view path) {
  for (std::size_t dimension = 0; !path.empty();) {
    const bool member = path.front() == '.';
    path.remove_prefix(1);
    if (member) {
      const std::size_t end = std::min(path.find_first_of(".["), path.size());
      EnterMember(image, at, path.substr(0, end));
      path.remove_prefix(end);
      dimension = 0;
      continue;
    }
    std::size_t index = 0;
    const auto [end, error] = std::from_chars(path.data(), path.data() + path.size(), index);
    path.remove_prefix(static_cast<std::size_t>(end - path.data()));
    if (error != std::errc() || !path.starts_with(']')) image.Refuse("an element is written as [3]");
    path.remove_prefix(1);
    if (!path.empty() && path.front() != '.' && path.front() != '[') image.Refuse("after ] comes . or [");
    const bool more = path.starts_with('[');
    EnterElement(image, at, dimension, index, !more);
    dimension = more ? dimension + 1 : 0;
  }
}

// The meaning of a type's bytes.
WatchedVariable::Kind KindOf(const ImageName& image, Dwarf_Die& type) {
  using Kind = WatchedVariable::Kind;
  const int tag = dwarf_tag(&type);
  if (tag == DW_TAG_pointer_type || tag == DW_TAG_reference_type) return Kind::kUnsigned;
  if (tag == DW_TAG_enumeration_type) {
    Dwarf_Die underlying{};
    return TypeOf(type, underlying) ? KindOf(image, underlying) : Kind::kUnsigned;
  }
  if (tag == DW_TAG_array_type) image.Refuse("an array: name an element, as [0]");
  if (IsRecord(tag))
    image.Refuse(fmt::format("a structure: name a member, one of {}", fmt::join(MemberNames(type), ", ")));
  switch (NumberOf(type, DW_AT_encoding, 0)) {
    case DW_ATE_boolean:
      return Kind::kBool;
    case DW_ATE_float:
      return Kind::kFloat;
    case DW_ATE_signed:
    case DW_ATE_signed_char:
      return Kind::kSigned;
    case DW_ATE_unsigned:
    case DW_ATE_unsigned_char:
    case DW_ATE_UTF:
      return Kind::kUnsigned;
    default:
      image.Refuse(
          "a type that cannot be watched; integers, floating-point numbers, booleans, enumerations and "
          "pointers can");
  }
}

template <class Number>
double As(std::span<const std::uint8_t> bytes) {
  CheckPart(0, sizeof(Number), bytes.size(), "a variable is read with all its bytes");
  Number number{};
  std::memcpy(&number, bytes.data(), sizeof number);
  return static_cast<double>(number);
}

}  // namespace

double WatchedVariable::Value(std::span<const std::uint8_t> bytes) const {
  if (bytes.size() < size_bytes) return std::numeric_limits<double>::quiet_NaN();
  if (kind == Kind::kFloat) return size_bytes == 4 ? As<float>(bytes) : As<double>(bytes);
  if (kind == Kind::kBool) return bytes[0] != 0 ? 1.0 : 0.0;
  const bool with_sign = kind == Kind::kSigned;
  switch (size_bytes) {
    case 1:
      return with_sign ? As<std::int8_t>(bytes) : As<std::uint8_t>(bytes);
    case 2:
      return with_sign ? As<std::int16_t>(bytes) : As<std::uint16_t>(bytes);
    case 4:
      return with_sign ? As<std::int32_t>(bytes) : As<std::uint32_t>(bytes);
    default:
      return with_sign ? As<std::int64_t>(bytes) : As<std::uint64_t>(bytes);
  }
}

WatchedVariable FindVariable(const std::filesystem::path& file, std::string_view name) {
  const ImageName image{file, name};
  const ElfFile elf(file);
  const std::unique_ptr<Dwarf, CloseDwarf> dwarf(dwarf_begin(elf.descriptor(), DWARF_C_READ));
  const std::vector<Variable> all =
      dwarf == nullptr ? std::vector<Variable>() : CollectVariables(dwarf.get());
  if (all.empty())
    image.Refuse(
        "the image has no debug information about variables: compile it with -g, and do not strip it");
  // After the file's name and its dot, if there is one, members and elements begin.
  const std::size_t colon = name.find(':');
  const bool with_file = colon != name.npos && name.substr(colon, 2) != "::";
  const std::size_t end = std::min(name.find_first_of(".[", with_file ? colon : 0), name.size());
  Variable at = FindByName(image, all, name.substr(0, end));
  Enter(image, at, name.substr(end));

  WatchedVariable found{.address = at.address, .size_bytes = 0, .kind = KindOf(image, at.type)};
  found.size_bytes = SizeOf(at.type);
  const bool is_number =
      found.size_bytes == 1 || found.size_bytes == 2 || found.size_bytes == 4 || found.size_bytes == 8;
  if (!is_number || (found.kind == WatchedVariable::Kind::kFloat && found.size_bytes < 4))
    image.Refuse(fmt::format("a number of {} bytes, which cannot be watched", found.size_bytes));
  return found;
}

}  // namespace tiltproof::harness
