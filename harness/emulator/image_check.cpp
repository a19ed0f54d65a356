#include "harness/emulator/image_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "harness/emulator/stm32f405.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr const char* kCompileFor = "compile it with -mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16";
constexpr const char* kLinkFor =
    "the linker script needs FLASH (rx) : ORIGIN = 0x08000000, LENGTH = 1024K and RAM (rwx) : ORIGIN = "
    "0x20000000, LENGTH = 128K";

struct Segment {
  std::uint64_t file_begin = 0, file_bytes = 0;
  std::uint32_t address = 0;       // where it is loaded
  std::uint32_t run_address = 0;   // where it is when it runs
  std::uint32_t memory_bytes = 0;  // there, file_bytes of them from the file
};

// Segments that the emulator loads, by address.
std::vector<Segment> Segments(const ElfFile& image) {
  std::vector<Segment> segments;
  std::size_t count = 0;
  elf_getphdrnum(image.elf(), &count);
  for (std::size_t i = 0; i < count; ++i) {
    GElf_Phdr header{};
    // A damaged file may say that it has four milliards of them.
    if (gelf_getphdr(image.elf(), static_cast<int>(i), &header) == nullptr) break;
    if (header.p_type != PT_LOAD || header.p_filesz == 0) continue;
    segments.push_back({.file_begin = header.p_offset,
                        .file_bytes = header.p_filesz,
                        .address = static_cast<std::uint32_t>(header.p_paddr),
                        .run_address = static_cast<std::uint32_t>(header.p_vaddr),
                        .memory_bytes = static_cast<std::uint32_t>(header.p_filesz)});
  }
  std::sort(segments.begin(), segments.end(),
            [](const Segment& a, const Segment& b) { return a.address < b.address; });
  return segments;
}

std::optional<std::uint32_t> LoadedWord(const ElfFile& image, std::uint32_t address) {
  for (const Segment& segment : Segments(image)) {
    const std::uint64_t offset = address - segment.address;
    if (address < segment.address || offset + sizeof(std::uint32_t) > segment.file_bytes) continue;
    std::size_t size = 0;
    const char* bytes = elf_rawfile(image.elf(), &size);
    if (bytes == nullptr || segment.file_begin + offset + sizeof(std::uint32_t) > size) return std::nullopt;
    CheckPart(segment.file_begin + offset, sizeof(std::uint32_t), size, "a loaded word is inside the file");
    std::uint32_t word = 0;
    std::memcpy(&word, bytes + segment.file_begin + offset, sizeof word);
    return word;
  }
  return std::nullopt;
}

void CheckWhole(const std::filesystem::path& file, const ElfFile& image) {
  GElf_Ehdr header{};
  gelf_getehdr(image.elf(), &header);
  std::uint64_t end = header.e_phoff + std::uint64_t{header.e_phnum} * header.e_phentsize;
  // The table of sections is usually the last thing in a file; with it go symbols and lines.
  if (header.e_shoff != 0)
    end = std::max(end, header.e_shoff + std::uint64_t{header.e_shnum} * header.e_shentsize);
  for (const Segment& segment : Segments(image)) end = std::max(end, segment.file_begin + segment.file_bytes);
  if (end > image.size_bytes())
    RefuseImage(
        file, fmt::format(
                  "truncated: by its header it ends at byte {}, the file at byte {}; copy or build it again",
                  end, image.size_bytes()));
}

// --- build attributes ---

class AttributeReader {
 public:
  explicit AttributeReader(std::span<const unsigned char> bytes) : bytes_(bytes) {}
  bool AtEnd() const { return bytes_.empty(); }
  unsigned char Byte() {
    if (bytes_.empty()) return 0;
    const unsigned char byte = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return byte;
  }
  std::uint32_t Word() {
    std::uint32_t word = 0;
    for (int shift = 0; shift < 32; shift += 8) word |= std::uint32_t{Byte()} << shift;
    return word;
  }
  // Unsigned LEB128.
  std::uint64_t Number() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; !AtEnd(); shift += 7) {
      const unsigned char byte = Byte();
      if (shift < 64) value |= std::uint64_t{byte & 0x7FU} << shift;
      if ((byte & 0x80U) == 0) break;
    }
    return value;
  }
  std::string Text() {
    std::string text;
    while (!AtEnd()) {
      const unsigned char byte = Byte();
      if (byte == 0) break;
      text += static_cast<char>(byte);
    }
    return text;
  }
  // The next `size` bytes, or what is left.
  AttributeReader Part(std::size_t size) {
    const auto part = bytes_.first(std::min(size, bytes_.size()));
    bytes_ = bytes_.subspan(part.size());
    return AttributeReader(part);
  }
  std::size_t size() const { return bytes_.size(); }

 private:
  std::span<const unsigned char> bytes_;
};

enum Tag : std::uint64_t {
  kFile = 1,
  kRawName = 4,
  kName = 5,
  kArchitecture = 6,
  kProfile = 7,
  kFloatingPoint = 10,
  kHardFloatUse = 27,
  kCompatibility = 32
};
using Attributes = std::map<std::uint64_t, std::uint64_t>;

Attributes ReadFileAttributes(AttributeReader in) {
  Attributes found;
  while (!in.AtEnd()) {
    const std::uint64_t tag = in.Number();
    // Tags above 32 are numbers if even, texts if odd.
    if (tag == kRawName || tag == kName || (tag > kCompatibility && tag % 2 == 1)) {
      in.Text();
    } else {
      found[tag] = in.Number();
      if (tag == kCompatibility) in.Text();
    }
  }
  return found;
}

// Those of the whole file, given by the vendor "aeabi".
Attributes ReadAttributes(const ElfFile& image) {
  for (Elf_Scn* section = nullptr; (section = elf_nextscn(image.elf(), section)) != nullptr;) {
    GElf_Shdr header{};
    if (gelf_getshdr(section, &header) == nullptr || header.sh_type != SHT_ARM_ATTRIBUTES) continue;
    const Elf_Data* data = elf_rawdata(section, nullptr);
    if (data == nullptr || data->d_buf == nullptr) continue;
    AttributeReader in({static_cast<const unsigned char*>(data->d_buf), data->d_size});
    if (in.Byte() != 'A') continue;
    while (!in.AtEnd()) {
      const std::uint32_t size = in.Word();
      AttributeReader vendor = in.Part(size < sizeof size ? 0 : size - sizeof size);
      if (size < sizeof size || vendor.Text() != "aeabi") continue;
      while (!vendor.AtEnd()) {
        const std::size_t before = vendor.size();
        const std::uint64_t scope = vendor.Number();
        const std::uint32_t scope_size = vendor.Word();
        const std::size_t header_size = before - vendor.size();
        AttributeReader scoped = vendor.Part(scope_size < header_size ? 0 : scope_size - header_size);
        if (scope == kFile) return ReadFileAttributes(scoped);
      }
    }
  }
  return {};
}

std::uint64_t Get(const Attributes& attributes, std::uint64_t tag) {
  const auto found = attributes.find(tag);
  return found == attributes.end() ? 0 : found->second;
}

// Tag_CPU_arch.
std::string ArchitectureName(std::uint64_t value) {
  constexpr std::array<const char*, 23> kNames = {"ARM before v4",
                                                  "ARMv4",
                                                  "ARMv4T",
                                                  "ARMv5T",
                                                  "ARMv5TE",
                                                  "ARMv5TEJ",
                                                  "ARMv6",
                                                  "ARMv6KZ",
                                                  "ARMv6T2",
                                                  "ARMv6K",
                                                  "ARMv7",
                                                  "ARMv6-M",
                                                  "ARMv6-M",
                                                  "ARMv7E-M",
                                                  "ARMv8-A",
                                                  "ARMv8-R",
                                                  "ARMv8-M (a Cortex-M23)",
                                                  "ARMv8-M (a Cortex-M33 or later)",
                                                  "ARMv8.1-A",
                                                  "ARMv8.2-A",
                                                  "ARMv8.3-A",
                                                  "ARMv8.1-M (a Cortex-M55 or later)",
                                                  "ARMv9-A"};
  return value < kNames.size() ? kNames[value] : fmt::format("ARM architecture {}", value);
}

void CheckProcessor(const std::filesystem::path& file, const Attributes& attributes) {
  if (attributes.empty()) return;
  constexpr std::uint64_t kV7 = 10, kV6M = 11, kV6SM = 12, kV7EM = 13;
  constexpr std::uint64_t kVfpV4D16 = 6, kSinglePrecisionOnly = 1;
  const std::uint64_t architecture = Get(attributes, kArchitecture), profile = Get(attributes, kProfile);
  const std::uint64_t floating_point = Get(attributes, kFloatingPoint);
  const auto refuse = [&](const std::string& what) {
    RefuseImage(
        file,
        fmt::format(
            "built for {}; the board has a Cortex-M4 (ARMv7E-M with the single-precision FPU FPv4-SP): {}",
            what, kCompileFor));
  };
  const bool fits = architecture == kV6M || architecture == kV6SM || architecture == kV7EM ||
                    (architecture == kV7 && profile == 'M');
  if (!fits)
    refuse(ArchitectureName(architecture) + (profile == 'A'   ? ", profile A (a Cortex-A, runs Linux)"
                                             : profile == 'R' ? ", profile R (a Cortex-R)"
                                                              : ""));
  if (floating_point > kVfpV4D16) refuse("the floating-point unit FPv5 (a Cortex-M7)");
  if (floating_point != 0 && floating_point != kVfpV4D16)
    refuse("a floating-point unit that no Cortex-M4 has");
  if (floating_point == kVfpV4D16 && Get(attributes, kHardFloatUse) != kSinglePrecisionOnly)
    refuse("a floating-point unit with double precision");
}

// --- addresses ---

// Flash is seen at 0 as well.
std::uint32_t InFlash(std::uint32_t address) {
  return Holds(kFlashAtZero, address) ? address + kFlash.address : address;
}

bool IsLoaded(const std::vector<Segment>& segments, std::uint32_t address) {
  return std::any_of(segments.begin(), segments.end(), [&](const Segment& segment) {
    return InFlash(address) - InFlash(segment.address) < segment.memory_bytes ||
           InFlash(address) - InFlash(segment.run_address) < segment.memory_bytes;
  });
}

void CheckAddresses(const std::filesystem::path& file, const std::vector<Segment>& segments) {
  for (const Segment& segment : segments) {
    const auto fits = [&](const MemoryRegion& memory) {
      return Holds(memory, segment.address, segment.file_bytes);
    };
    if (!fits(kFlash) && !fits(kFlashAtZero) && !fits(kRam) && !fits(kCoreCoupledRam))
      RefuseImage(
          file,
          fmt::format(
              "linked at a wrong address: {} bytes at 0x{:08x} lie outside the board's flash (1 MB from "
              "0x08000000) and RAM (128 KB from 0x20000000): {}",
              segment.file_bytes, segment.address, kLinkFor));
  }
}

void CheckVectors(const std::filesystem::path& file, const ElfFile& image,
                  const std::vector<Segment>& segments) {
  Check(!segments.empty(), "an image without a segment was refused before");
  const auto table = FindVectorTable(image);
  if (!table)
    RefuseImage(
        file,
        fmt::format(
            "linked at a wrong address: it begins at 0x{:08x}, but the processor starts from the vector "
            "table at 0x08000000, and nothing is there (an image behind a boot loader?): {}",
            segments.front().address, kLinkFor));
  const std::string where = fmt::format("at 0x{:08x}, where the vector table must be,", table->address);
  const std::string keep = "is the section of vectors the first in the linker script, and kept with KEEP()?";
  if (!IsStackPointer(table->stack_pointer))
    RefuseImage(
        file,
        fmt::format("no vector table: the first word {} is 0x{:08x}; the initial stack pointer must lie "
                    "in RAM (to 0x20020000): {}",
                    where, table->stack_pointer, keep));
  const std::uint32_t entry = table->reset & ~1U;
  if ((table->reset & 1) == 0)
    RefuseImage(
        file,
        fmt::format("the reset vector is 0x{:08x}: it must be odd, for Thumb code (is Reset_Handler declared "
                    "as a function, `.type Reset_Handler, %function` or .thumb_func?)",
                    table->reset));
  if (!IsLoaded(segments, entry))
    RefuseImage(file, fmt::format("the reset vector points to 0x{:08x}, where the image has no code: {}",
                                  entry, keep));
}

}  // namespace

std::optional<VectorTable> FindVectorTable(const ElfFile& image) {
  for (const std::uint32_t address : {kFlash.address, kFlashAtZero.address}) {
    const auto stack = LoadedWord(image, address), reset = LoadedWord(image, address + 4);
    if (stack && reset) return VectorTable{address, *stack, *reset};
  }
  return std::nullopt;
}

void CheckImage(const std::filesystem::path& file) {
  const ElfFile image(file);
  CheckWhole(file, image);
  const std::vector<Segment> segments = Segments(image);
  if (segments.empty()) RefuseImage(file, "it holds nothing to load: was it linked with the right script?");
  CheckProcessor(file, ReadAttributes(image));
  CheckAddresses(file, segments);
  CheckVectors(file, image, segments);
}

}  // namespace tiltproof::harness
