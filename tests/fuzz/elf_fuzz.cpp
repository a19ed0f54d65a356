// The readers of firmware images: any file is an image or is refused with a reason, whatever is damaged in it.
//
// Input: the file.
#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include "harness/emulator/diagnosis/source_lines.h"
#include "harness/emulator/elf_symbols.h"
#include "harness/emulator/image_check.h"
#include "harness/emulator/image_stacks.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch.h"

// libelf 0.188 forgets the table of section names that it read from a stripped image.
extern "C" const char* __lsan_default_suppressions() { return "leak:libelf.so\n"; }

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tiltproof::harness;
  using tiltproof::testing::Tried;
  const auto file = tiltproof::testing::ScratchFile("fuzz.elf", {data, size});
  Tried<std::runtime_error>([&] {
    CheckImage(file);
    return true;
  });
  Tried<std::runtime_error>([&] {
    const ElfSymbols symbols(file);
    for (const char* name : {"ram", "data", "bss", "stack", "tiltproof_status", "motor.c:state"})
      Tried<std::runtime_error>([&] { return symbols.Region(name); });
    for (const std::uint32_t address : {0x2000'0000U, 0x2001'0000U, 0xFFFF'FFFFU}) symbols.NameAt(address);
    for (const ImageStack& stack : StacksOf(symbols))
      if (stack.region.size_bytes == 0 || stack.region.address % 4 != 0) __builtin_trap();
    return true;
  });
  Tried<std::runtime_error>([&] {
    const SourceLines source(file);
    for (const std::uint32_t address : {0U, 0x0800'0000U, 0x0800'0412U, 0xFFFF'FFFFU}) {
      source.Describe(address);
      source.DescribeCall(address);
    }
    return true;
  });
  return 0;
}
