#include "harness/emulator/elf_symbols.h"
#include "harness/emulator/image_stacks.h"
#include "tests/harness/emulator/elf_header.h"

#include <elf.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace tiltproof::harness {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// An image written byte by byte after the ELF specification, without the library under test.
class TinyImage {
 public:
  TinyImage& Add(const std::string& name, std::uint32_t address, std::uint32_t size, int type = STT_OBJECT,
                 std::uint16_t section = SHN_ABS, int binding = STB_GLOBAL) {
    Elf32_Sym symbol{};
    symbol.st_name = static_cast<Elf32_Word>(names_.size());
    symbol.st_value = address;
    symbol.st_size = size;
    symbol.st_info = static_cast<unsigned char>(ELF32_ST_INFO(binding, type));
    symbol.st_shndx = section;
    symbols_.push_back(symbol);
    names_ += name + '\0';
    return *this;
  }

  std::string Bytes() const {
    Elf32_Shdr sections[3] = {};
    const auto place = [&](std::size_t at) { return static_cast<Elf32_Off>(at); };
    const std::size_t symbols_size = symbols_.size() * sizeof(Elf32_Sym);
    sections[1].sh_type = SHT_SYMTAB;
    sections[1].sh_offset = place(sizeof header);
    sections[1].sh_size = place(symbols_size);
    sections[1].sh_link = 2;
    sections[1].sh_entsize = sizeof(Elf32_Sym);
    sections[1].sh_addralign = 4;
    sections[2].sh_type = SHT_STRTAB;
    sections[2].sh_offset = place(sizeof header + symbols_size);
    sections[2].sh_size = place(names_.size());
    sections[2].sh_addralign = 1;
    std::string padded_names = names_;
    padded_names.resize((names_.size() + 3) / 4 * 4);

    Elf32_Ehdr head = header;
    head.e_shoff = place(sizeof header + symbols_size + padded_names.size());
    head.e_shnum = symbols_.size() > 1 ? 3 : 0;
    std::string bytes;
    const auto append = [&](const void* data, std::size_t size) {
      bytes.append(static_cast<const char*>(data), size);
    };
    append(&head, sizeof head);
    append(symbols_.data(), symbols_size);
    bytes += padded_names;
    append(sections, sizeof sections);
    return bytes;
  }

  TinyImage& AddStatic(const std::string& file, const std::string& name, std::uint32_t address,
                       std::uint32_t size) {
    Add(file, 0, 0, STT_FILE, SHN_ABS, STB_LOCAL);
    return Add(name, address, size, STT_OBJECT, SHN_ABS, STB_LOCAL);
  }

  Elf32_Ehdr header = ArmExecutable();

 private:
  std::vector<Elf32_Sym> symbols_ = {Elf32_Sym{}};
  std::string names_ = std::string(1, '\0');
};

class ElfSymbolsTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& bytes) {
    std::ofstream(file_, std::ios::binary) << bytes;
    return file_;
  }
  std::string Refusal(const std::filesystem::path& file) {
    try {
      ElfSymbols symbols(file);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  static std::string NoRegion(const ElfSymbols& symbols, const std::string& name) {
    EXPECT_FALSE(symbols.FindRegion(name)) << name;
    try {
      symbols.Region(name);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  ~ElfSymbolsTest() override { std::filesystem::remove(file_); }

  std::filesystem::path file_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("image-") + testing::UnitTest::GetInstance()->current_test_info()->name() + ".elf");
};

TEST_F(ElfSymbolsTest, FindsVariablesByTheirNamesInTableAndSource) {
  const ElfSymbols symbols(Write(TinyImage()
                                     .Add("gain_table", 0x2000'0100, 320)
                                     .Add("_ZN9tiltproof8firmware5boardE", 0x2000'0400, 64)
                                     .Bytes()));
  EXPECT_EQ(symbols.FindRegion("gain_table"), (MemoryRegion{0x2000'0100, 320}));
  EXPECT_EQ(symbols.FindRegion("_ZN9tiltproof8firmware5boardE"), (MemoryRegion{0x2000'0400, 64}));
  EXPECT_EQ(symbols.Region("tiltproof::firmware::board"), (MemoryRegion{0x2000'0400, 64}));
}

TEST_F(ElfSymbolsTest, BoundsSectionsByTheLinkersSymbols) {
  const ElfSymbols symbols(Write(TinyImage()
                                     .Add("_sdata", 0x2000'0000, 0, STT_NOTYPE)
                                     .Add("_edata", 0x2000'0040, 0, STT_NOTYPE)
                                     .Add("_sbss", 0x2000'0040, 0, STT_NOTYPE)
                                     .Add("_ebss", 0x2000'1b00, 0, STT_NOTYPE)
                                     .Add("_sstack", 0x2001'f000, 0, STT_NOTYPE)
                                     .Add("_estack", 0x2002'0000, 0, STT_NOTYPE)
                                     .Bytes()));
  EXPECT_EQ(symbols.Region("data"), (MemoryRegion{0x2000'0000, 0x40}));
  EXPECT_EQ(symbols.Region("bss"), (MemoryRegion{0x2000'0040, 0x1ac0}));
  EXPECT_EQ(symbols.Region("stack"), (MemoryRegion{0x2001'f000, 0x1000}));
  EXPECT_EQ(symbols.Region("ram"), (MemoryRegion{0x2000'0000, 0x2'0000}));
}

TEST_F(ElfSymbolsTest, NamesWhatIsNear) {
  const ElfSymbols symbols(Write(TinyImage()
                                     .Add("gain_table", 0x2000'0100, 320)
                                     .Add("main", 0x0800'0100, 20, STT_FUNC)
                                     .Add("elsewhere", 0, 4, STT_OBJECT, SHN_UNDEF)
                                     .Add("_sdata", 0x2000'0000, 0, STT_NOTYPE)
                                     .Add("_edata", 0x2000'0000, 0, STT_NOTYPE)
                                     .Bytes()));
  EXPECT_THAT(NoRegion(symbols, "gain_tabel"),
              AllOf(HasSubstr(file_.string()), HasSubstr("did you mean 'gain_table'?")));
  EXPECT_THAT(NoRegion(symbols, "RAM"), HasSubstr("'RAM'"));
  EXPECT_THAT(NoRegion(symbols, "bss"), HasSubstr("_sbss and _ebss"));
  EXPECT_THAT(NoRegion(symbols, "data"), HasSubstr("or it is empty"));
  EXPECT_THAT(NoRegion(symbols, "something_else_altogether"), HasSubstr("ram, data, bss, stack"));
  // Code is no memory that changes, what is defined elsewhere is not here, and a label has no size.
  EXPECT_FALSE(symbols.FindRegion("main"));
  EXPECT_FALSE(symbols.FindRegion("elsewhere"));
  EXPECT_FALSE(symbols.FindRegion("_sdata"));
  EXPECT_THAT(NoRegion(symbols, std::string(100'000, 'x')), HasSubstr("no memory region"));
}

TEST_F(ElfSymbolsTest, StaticsOfOneNameAreToldApartByTheirFiles) {
  const ElfSymbols symbols(Write(TinyImage()
                                     .AddStatic("motor.c", "state", 0x2000'0100, 4)
                                     .AddStatic("sensor.c", "state", 0x2000'0200, 8)
                                     .Bytes()));
  EXPECT_THAT(NoRegion(symbols, "state"),
              AllOf(HasSubstr("ambiguous"), HasSubstr("0x20000100 (motor.c), 0x20000200 (sensor.c)"),
                    HasSubstr("'motor.c:state'")));
  EXPECT_EQ(symbols.Region("motor.c:state"), (MemoryRegion{0x2000'0100, 4}));
  EXPECT_EQ(symbols.Region("sensor.c:state"), (MemoryRegion{0x2000'0200, 8}));
  EXPECT_FALSE(symbols.FindRegion("pump.c:state"));
}

TEST_F(ElfSymbolsTest, ConstantsAreNotFlipped) {
  const ElfSymbols symbols(Write(TinyImage().Add("gain_table", 0x0800'1234, 320).Bytes()));
  EXPECT_THAT(
      NoRegion(symbols, "gain_table"),
      HasSubstr("'gain_table' is a constant in flash (320 bytes at 0x08001234), where nothing flips"));
}

TEST_F(ElfSymbolsTest, NamesTheVariableAtAnAddress) {
  const ElfSymbols symbols(
      Write(TinyImage().Add("_ZN5board5countE", 0x2000'0100, 4).Add("rings", 0x2000'0200, 64).Bytes()));
  EXPECT_EQ(symbols.NameAt(0x2000'0100), "board::count");
  EXPECT_EQ(symbols.NameAt(0x2000'0210), "rings + 0x10");
  EXPECT_EQ(symbols.NameAt(0x2000'0104), "");
}

TEST_F(ElfSymbolsTest, StacksAreVariablesInRamThatAreNamedSo) {
  const ElfSymbols symbols(Write(TinyImage()
                                     .Add("uxIdleTaskStack", 0x2000'0400, 512)
                                     .Add("_ZN3app11CONTROL_STKE", 0x2000'0600, 512)
                                     .Add("_ZN3app12controlStackE", 0x2000'0200, 384)
                                     .Add("z_main_stack", 0x1000'0001, 258)
                                     .Add("stack_in_flash", 0x0800'4000, 64)
                                     .Add("stack_top", 0x2000'0800, 0, STT_NOTYPE)
                                     .Add("tail_of_idle_stack", 0x2000'0500, 4)
                                     .Bytes()));
  std::vector<std::string> found;
  for (const auto& [name, region] : StacksOf(symbols))
    found.push_back(name + " " + std::to_string(region.address) + " " + std::to_string(region.size_bytes));
  const auto at = [](std::uint32_t address) { return std::to_string(address); };
  // Whole words, by address, and none within another one.
  EXPECT_THAT(found, testing::ElementsAre("z_main_stack " + at(0x1000'0004) + " 252",
                                          "app::controlStack " + at(0x2000'0200) + " 384",
                                          "uxIdleTaskStack " + at(0x2000'0400) + " 512"));
}

TEST_F(ElfSymbolsTest, SaysWhatAFileIsInstead) {
  EXPECT_THAT(Refusal("/nowhere/firmware.elf"),
              AllOf(HasSubstr("/nowhere/firmware.elf"), HasSubstr("No such file")));
  EXPECT_THAT(Refusal("/"), HasSubstr("not a file"));
  EXPECT_THAT(Refusal(Write("")), HasSubstr("not an ELF file"));
  EXPECT_THAT(Refusal(Write("#!/bin/sh\nexit 0\n")), HasSubstr("not an ELF file"));
  EXPECT_THAT(Refusal("/proc/self/exe"), HasSubstr("another processor"));
  TinyImage object;
  object.header.e_type = ET_REL;
  EXPECT_THAT(Refusal(Write(object.Bytes())), HasSubstr("was it linked?"));
}

// It can be flown; only its memory has no names.
TEST_F(ElfSymbolsTest, AStrippedImageHasRamAlone) {
  const ElfSymbols image(Write(TinyImage().Bytes()));
  EXPECT_TRUE(image.FindRegion("ram"));
  EXPECT_FALSE(image.FindRegion("gain_table"));
  try {
    image.Region("gain_table");
    FAIL() << "found";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("was it stripped?"));
  }
}

// Any prefix is refused or read, and never crashes.
TEST_F(ElfSymbolsTest, SurvivesCutFiles) {
  const std::string whole = TinyImage().Add("gain_table", 0x2000'0100, 320).Bytes();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    std::filesystem::remove(file_);
    try {
      const ElfSymbols symbols(Write(whole.substr(0, length)));
      symbols.FindRegion("gain_table");
    } catch (const std::runtime_error&) {
    }
  }
}

}  // namespace
}  // namespace tiltproof::harness
