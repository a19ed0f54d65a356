#include "harness/emulator/frame_end_text.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <cstdint>
#include <string>
#include <variant>

namespace tiltproof::harness {
namespace {

using link::FrameEnd;
using link::LengthHeader;

TEST(FrameEndText, IsShort) {
  EXPECT_EQ(FrameEndText(std::uint8_t{0x7E}), "126");
  EXPECT_EQ(FrameEndText(LengthHeader{.sync = {0xAA, 0x05},
                                      .sync_count = 2,
                                      .length_bytes = 1,
                                      .payload_bytes_max = 255,
                                      .check_bytes = 2}),
            "aa05:1:255:2");
}

TEST(FrameEndText, EveryFlagComesBack) {
  for (int flag = 0; flag <= 255; ++flag) {
    const auto end = ParseFrameEnd(std::to_string(flag));
    ASSERT_TRUE(end);
    EXPECT_EQ(std::get<std::uint8_t>(*end), flag);
    EXPECT_EQ(FrameEndText(*end), std::to_string(flag));
  }
}

RC_GTEST_PROP(FrameEndText, EveryHeaderComesBack, ()) {
  LengthHeader header{.sync_count = *rc::gen::inRange<std::size_t>(1, 5),
                      .length_bytes = *rc::gen::inRange<std::size_t>(1, 3),
                      .payload_bytes_max = *rc::gen::inRange<std::size_t>(0, 65536),
                      .check_bytes = *rc::gen::inRange<std::size_t>(0, 5)};
  for (std::size_t i = 0; i < header.sync_count; ++i) header.sync[i] = *rc::gen::arbitrary<std::uint8_t>();
  const auto end = ParseFrameEnd(FrameEndText(header));
  RC_ASSERT(end.has_value());
  const auto found = std::get<LengthHeader>(*end);
  RC_ASSERT(found.sync == header.sync);
  RC_ASSERT(found.sync_count == header.sync_count);
  RC_ASSERT(found.length_bytes == header.length_bytes);
  RC_ASSERT(found.payload_bytes_max == header.payload_bytes_max);
  RC_ASSERT(found.check_bytes == header.check_bytes);
}

TEST(FrameEndText, OtherTextsAreNone) {
  for (const char* text : {"", "256", "-1", "7e", "1:", ":1:2:3", "aa:1:255", "aa:1:255:2:", "aa:3:255:2",
                           "aa:0:255:2", "aa:1:65536:2", "aa:1:255:5", "a:1:255:2", "aab:1:255:2",
                           "gg:1:255:2", "aa:1:255:2 ", "aabbccddee:1:255:2", "aa:1::2"})
    EXPECT_FALSE(ParseFrameEnd(text)) << text;
}

}  // namespace
}  // namespace tiltproof::harness
