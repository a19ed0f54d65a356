// Boards of the emulator: which byte stops them, so that their line can be answered.
#include "harness/client/firmware_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/support/tiny_framings.h"

namespace tiltproof::harness {
namespace {

using link::CobsFraming;
using link::LengthFraming;
using link::PaperOver;

TEST(BoardOf, TheBarrierIsTheFlagOfTheFraming) {
  const EmulatedImage image{.file = "mine.elf"};
  EXPECT_EQ(BoardOf(image, "paper", *link::FindProtocol("paper")).barrier, 0x7E);
  EXPECT_EQ(BoardOf(image, "paper", *PaperOver(std::make_shared<CobsFraming>())).barrier, 0);
}

TEST(BoardOf, AFramingWithoutFlagIsRefused) {
  try {
    BoardOf({.file = "mine.elf"}, "paper", *PaperOver(std::make_shared<LengthFraming>()));
    FAIL() << "no error";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("frames of the protocol 'paper' have none"));
  }
}

}  // namespace
}  // namespace tiltproof::harness
