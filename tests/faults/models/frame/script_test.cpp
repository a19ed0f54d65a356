// Bytes that the scenario states: each word once, at the frame that it belongs to.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "faults/frame_words.h"
#include "tests/faults/models/frame/message_frames.h"

namespace tiltproof::faults {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

FaultSpec Scripted(const std::string& frames, const std::string& place = "instead") {
  return Spec("frame.script", {{"frames", frames}, {"place", place}});
}

// All bytes that came of each frame, in order; of frames that are as they were, none.
std::vector<std::vector<Bytes>> Changed(const std::vector<std::vector<link::Chunk>>& out) {
  std::vector<std::vector<Bytes>> changed(out.size());
  for (std::size_t n = 0; n < out.size(); ++n) {
    if (Unchanged(out[n], static_cast<std::int64_t>(n))) continue;
    for (const link::Chunk& chunk : out[n]) {
      EXPECT_GE(chunk.begin_ns, Frame(static_cast<std::int64_t>(n)).begin_ns);
      EXPECT_EQ(chunk.number, n);
      changed[n].push_back(chunk.bytes);
    }
  }
  return changed;
}

const std::vector<Bytes> kAsItWas;

TEST(ScriptTest, EachWordReplacesItsFrame) {
  EXPECT_THAT(
      Changed(Send(Scripted("00ff - 7e7d7e7e a1"), 6)),
      ElementsAre(ElementsAre(Bytes{0x00, 0xFF}), kAsItWas, ElementsAre(Bytes{0x7E, 0x7D, 0x7E, 0x7E}),
                  ElementsAre(Bytes{0xA1}), kAsItWas, kAsItWas));
}

TEST(ScriptTest, BytesComeBeforeOrAfterTheFrame) {
  const Bytes first = Frame(0).bytes, third = Frame(2).bytes;
  EXPECT_THAT(Changed(Send(Scripted("01 - 0203", "before"), 4)),
              ElementsAre(ElementsAre(Bytes{1}, first), kAsItWas, ElementsAre(Bytes{2, 3}, third), kAsItWas));
  EXPECT_THAT(Changed(Send(Scripted("01 - 0203", "after"), 4)),
              ElementsAre(ElementsAre(first, Bytes{1}), kAsItWas, ElementsAre(third, Bytes{2, 3}), kAsItWas));
}

// The trigger assigns words to frames as they are sent, not as they come to this fault.
TEST(ScriptTest, WordsCountTheFramesThatAreSentAndPicked) {
  FaultSpec script = Scripted("01 02 03");
  script.every_nth_count = 3;
  script.start_ns = FrameTime(2);
  FaultSpec drop = Spec("frame.drop", {{"probability", 1.0}}, "drop");
  drop.start_ns = FrameTime(7);
  drop.end_ns = FrameTime(8);
  FaultSpec twice = Spec("frame.duplicate", {{"probability", 1.0}}, "twice");
  twice.start_ns = FrameTime(10);
  FaultSchedule schedule = AtTheLine({drop, twice, script}, 1);
  const auto out = Changed(Send(schedule, 12));
  EXPECT_THAT(out[4], ElementsAre(Bytes{1}));  // of 2, 3, 4
  EXPECT_THAT(out[7], SizeIs(0));              // dropped, with its word
  EXPECT_THAT(out[10], ElementsAre(Bytes{3}, Bytes{3}));
}

TEST(ScriptTest, EachDirectionBeginsWithTheFirstWord) {
  FaultSpec script = Scripted("01 02");
  script.target = Target::kBoth;
  FaultSchedule schedule = AtTheLine({script}, 1);
  for (const link::Direction direction : {link::Direction::kToClient, link::Direction::kToPlant})
    EXPECT_THAT(Changed(Send(schedule, 3, 68, direction)),
                ElementsAre(ElementsAre(Bytes{1}), ElementsAre(Bytes{2}), kAsItWas));
}

TEST(ScriptTest, AFrameAsItIsSentIsNoActivation) {
  std::string hex;
  for (const std::uint8_t byte : Frame(0).bytes) {
    hex += "0123456789abcdef"[byte >> 4];
    hex += "0123456789abcdef"[byte & 15];
  }
  FaultSchedule schedule = AtTheLine({Scripted(hex + " " + hex)}, 1);
  Send(schedule, 3);
  EXPECT_THAT(schedule.ActivationCounts(), ElementsAre(1));
}

TEST(FrameWordsTest, AreRefusedByTheRegistryWhenTheyAreNone) {
  const auto problems_of = [](const ParameterValue& value) {
    return Validate(Spec("frame.script", {{"frames", value}}));
  };
  EXPECT_THAT(problems_of(1.0), SizeIs(1));
  for (const std::string text : {"", " 7e", "7e ", "7e  00", "7e\t00", "7E", "7", "0x7e", "7e,00", "--"})
    EXPECT_THAT(problems_of(text), SizeIs(1)) << text;
  for (const std::string text : {"-", "7e", "00 - ff7d", "- -"})
    EXPECT_THAT(problems_of(text), SizeIs(0)) << text;
  EXPECT_THAT(problems_of(std::string(kFrameWordsTextMax, '0')), SizeIs(0));
  EXPECT_THAT(problems_of(std::string(kFrameWordsTextMax + 2, '0')), SizeIs(1));
}

TEST(FrameWordsTest, SayWhichWordIsWrongAndWhy) {
  EXPECT_THAT(ReadFrameWords("7e - 7e0g").problem, HasSubstr("word 3 '7e0g' has 'g' as character 4"));
  EXPECT_THAT(ReadFrameWords("7e 7e0").problem, HasSubstr("word 2 '7e0' has 3 digits"));
  EXPECT_THAT(ReadFrameWords("7e  00").problem, HasSubstr("word 2 is empty"));
  EXPECT_THAT(ReadFrameWords("7E").problem, HasSubstr("lower-case"));
  EXPECT_THAT(ReadFrameWords("7e  00").frames, SizeIs(0));
  EXPECT_EQ(ReadFrameWords("7e00 - ff").problem, "");
}

}  // namespace
}  // namespace tiltproof::faults
