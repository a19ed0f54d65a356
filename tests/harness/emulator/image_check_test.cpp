#include "harness/emulator/image_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "harness/emulator/stm32f405.h"
#include "tests/harness/emulator/elf_header.h"

namespace tiltproof::harness {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// An executable of one segment, byte by byte after the ELF specification: a vector table, code, and build attributes.
struct Image {
  std::uint32_t address = kFlash.address;
  std::uint32_t stack = 0x2002'0000, reset = 0x0800'0041;
  std::uint32_t code_bytes = 64;
  std::vector<unsigned char> attributes = {};  // tag, value, ...; empty: no section

  std::string Bytes() const {
    Elf32_Ehdr header = ArmExecutable();
    header.e_phoff = sizeof header;
    header.e_phnum = 1;

    std::string content(64 + code_bytes, '\0');
    std::memcpy(content.data(), &stack, 4);
    std::memcpy(content.data() + 4, &reset, 4);
    Elf32_Phdr segment{};
    segment.p_type = PT_LOAD;
    segment.p_offset = sizeof header + sizeof segment;
    segment.p_vaddr = segment.p_paddr = address;
    segment.p_filesz = segment.p_memsz = static_cast<Elf32_Word>(content.size());

    const std::string section = Attributes();
    Elf32_Shdr sections[2] = {};
    sections[1].sh_type = SHT_ARM_ATTRIBUTES;
    sections[1].sh_offset = static_cast<Elf32_Off>(segment.p_offset + content.size());
    sections[1].sh_size = static_cast<Elf32_Word>(section.size());
    sections[1].sh_addralign = 1;
    if (!attributes.empty()) {
      header.e_shoff = static_cast<Elf32_Off>(sections[1].sh_offset + section.size());
      header.e_shnum = 2;
    }
    std::string bytes;
    const auto append = [&](const void* data, std::size_t size) {
      bytes.append(static_cast<const char*>(data), size);
    };
    append(&header, sizeof header);
    append(&segment, sizeof segment);
    bytes += content;
    if (attributes.empty()) return bytes;
    bytes += section;
    append(sections, sizeof sections);
    return bytes;
  }

 private:
  // 'A', then of the vendor "aeabi" those of the file.
  std::string Attributes() const {
    const std::string vendor("aeabi\0", 6);
    const auto size_of = [](std::size_t size) {
      const auto word = static_cast<std::uint32_t>(size);
      std::string bytes(4, '\0');
      std::memcpy(bytes.data(), &word, 4);
      return bytes;
    };
    const std::string file =
        "\1" + size_of(5 + attributes.size()) + std::string(attributes.begin(), attributes.end());
    return "A" + size_of(4 + vendor.size() + file.size()) + vendor + file;
  }
};

class ImageCheck : public testing::Test {
 protected:
  std::string Refusal(const std::string& bytes) {
    std::ofstream(file_, std::ios::binary) << bytes;
    try {
      CheckImage(file_);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  std::string Refusal(const Image& image) { return Refusal(image.Bytes()); }
  ~ImageCheck() override { std::filesystem::remove(file_); }

  std::filesystem::path file_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("check-") + testing::UnitTest::GetInstance()->current_test_info()->name() + ".elf");
};

TEST_F(ImageCheck, AcceptsWhatRuns) {
  EXPECT_EQ(Refusal(Image{}), "");
  // At 0, flash is seen as well.
  EXPECT_EQ(Refusal(Image{.address = 0, .reset = 0x41}), "");
  EXPECT_EQ(Refusal(Image{.address = 0, .reset = 0x0800'0041}), "");
  EXPECT_EQ(Refusal(Image{.stack = 0x1001'0000}), "") << "core-coupled RAM";
}

TEST_F(ImageCheck, TheVectorTableMustBeOne) {
  EXPECT_THAT(Refusal(Image{.stack = 0x2002'0004}),
              HasSubstr("0x20020004; the initial stack pointer must lie in RAM"));
  EXPECT_THAT(Refusal(Image{.stack = 0x2000'0000}), HasSubstr("no vector table"));
  EXPECT_THAT(Refusal(Image{.stack = 0xFFFF'FFFF}), HasSubstr("no vector table"));
  EXPECT_THAT(Refusal(Image{.reset = 0x0800'0040}), HasSubstr("must be odd"));
  EXPECT_THAT(Refusal(Image{.reset = 0x0800'1001}),
              HasSubstr("points to 0x08001000, where the image has no code"));
}

TEST_F(ImageCheck, TheAddressMustBeTheBoards) {
  EXPECT_THAT(Refusal(Image{.address = 0x0800'4000, .reset = 0x0800'4041}),
              AllOf(HasSubstr("linked at a wrong address"), HasSubstr("begins at 0x08004000"),
                    HasSubstr("boot loader")));
  EXPECT_THAT(Refusal(Image{.address = 0x0810'0000}), HasSubstr("outside the board's flash"));
  EXPECT_THAT(Refusal(Image{.code_bytes = 1 << 20}), HasSubstr("outside the board's flash")) << "too large";
}

// Values of Tag_CPU_arch (6), Tag_CPU_arch_profile (7), Tag_FP_arch (10), Tag_ABI_HardFP_use (27) by the ABI's addenda,
// sections 3.3.5.2 and 3.3.6.1; behind a Tag_CPU_name (5), which is a text.
TEST_F(ImageCheck, TheProcessorMustBeTheBoards) {
  EXPECT_EQ(Refusal(Image{.attributes = {5, '7', 'E', '-', 'M', 0, 6, 13, 7, 'M', 10, 6, 27, 1}}), "");
  EXPECT_EQ(Refusal(Image{.attributes = {6, 13, 7, 'M'}}), "") << "without floating point";
  EXPECT_EQ(Refusal(Image{.attributes = {6, 10, 7, 'M'}}), "") << "Cortex-M3";
  EXPECT_EQ(Refusal(Image{.attributes = {6, 12, 7, 'M'}}), "") << "Cortex-M0";
  EXPECT_THAT(Refusal(Image{.attributes = {6, 13, 7, 'M', 10, 8}}), HasSubstr("FPv5 (a Cortex-M7)"));
  EXPECT_THAT(Refusal(Image{.attributes = {6, 13, 7, 'M', 10, 6}}), HasSubstr("double precision"));
  EXPECT_THAT(Refusal(Image{.attributes = {6, 17, 7, 'M'}}), HasSubstr("Cortex-M33"));
  EXPECT_THAT(Refusal(Image{.attributes = {6, 10, 7, 'A'}}),
              AllOf(HasSubstr("Cortex-A"), HasSubstr("-mcpu=cortex-m4")));
  EXPECT_THAT(Refusal(Image{.attributes = {6, 14, 7, 'A'}}), HasSubstr("ARMv8-A"));
}

// Any part of a file is refused, and no damage makes the check crash.
TEST_F(ImageCheck, SurvivesCutAndDamagedFiles) {
  const std::string whole =
      Image{.attributes = {5, '7', 'E', '-', 'M', 0, 6, 13, 7, 'M', 10, 6, 27, 1}}.Bytes();
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_NE(Refusal(whole.substr(0, length)), "") << length;
  EXPECT_THAT(Refusal(whole.substr(0, whole.size() - 1)), HasSubstr("truncated"));
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(0xFF);
    Refusal(damaged);
  }
}

TEST_F(ImageCheck, SaysWhatAFileIsInstead) {
  EXPECT_THAT(Refusal(std::string("\0\0\2\x20\x41\0\0\x08....", 12)), HasSubstr("a raw binary"));
  EXPECT_THAT(Refusal(std::string(":020000040800F2\n")), HasSubstr("an Intel HEX file"));
  EXPECT_THAT(Refusal(std::string("S00E0000696D6167652E\n")), HasSubstr("S-records"));
  EXPECT_THAT(Refusal(std::string()), HasSubstr("empty"));
  EXPECT_THAT(Refusal(std::string("\x7f"
                                  "ELF")),
              HasSubstr("truncated"));
}

}  // namespace
}  // namespace tiltproof::harness
