// Numbers and times of messages, as a sender writes them and a receiver judges them.
#include "harness/run/message_order.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "harness/run/message_receiver.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/protocol.h"

namespace tiltproof::harness {
namespace {

using link::FieldContent;
using link::MessageField;
using link::NumberType;

MessageField Stamp(FieldContent content, NumberType type) {
  return {.signal = content == FieldContent::kSequence ? "sequence" : "time_us",
          .max = link::LargestNumber(type),
          .type = type,
          .content = content};
}

// Messages `start` (id 1, a number), `a` (id 2, a number of 8 bits, a value) and `b` (id 3, a time of 16 bits).
link::Protocol Numbered() {
  link::Protocol protocol;
  protocol.name = "numbered";
  protocol.control_period_ns = kNsPerMs;
  protocol.repeated_start_is_boot = true;
  const auto add = [&](const char* name, std::uint32_t id, link::MessageKind kind,
                       std::vector<MessageField> fields) {
    protocol.messages.push_back(link::LayOut({.name = name,
                                              .kind = kind,
                                              .direction = link::Direction::kToPlant,
                                              .id = link::MessageId{.type = NumberType::kU8, .bits = id},
                                              .starts = kind == link::MessageKind::kStart,
                                              .fields = std::move(fields)}));
  };
  add("start", 1, link::MessageKind::kStart, {Stamp(FieldContent::kSequence, NumberType::kU8)});
  add("a", 2, link::MessageKind::kActuators,
      {Stamp(FieldContent::kSequence, NumberType::kU8), {.signal = "f_r_n", .min = -10, .max = 10}});
  add("b", 3, link::MessageKind::kActuators, {Stamp(FieldContent::kTimeUs, NumberType::kU16)});
  return protocol;
}

// Sends messages and keeps their payloads.
class Sender {
 public:
  explicit Sender(const link::Protocol& protocol) : protocol_(protocol), stamps_(protocol) {}
  std::vector<std::uint8_t> Frame(const char* name, TimeNs now = 0) {
    const link::MessageType& type = *protocol_.Find(name);
    std::vector<double> values(type.fields.size(), 5.0);
    stamps_.Write(type, BootTime(now), values);
    return protocol_.framing->Encode(protocol_.Encode(type, values).span());
  }

 private:
  const link::Protocol& protocol_;
  MessageStamps stamps_;
};

class MessageOrderTest : public ::testing::Test {
 protected:
  // The reason that the receiver refuses the frame; empty when it takes it.
  std::string Send(const std::vector<std::uint8_t>& frame) {
    std::string status = "nothing";
    receiver_.ReceiveFrames(0, frame, [&](const MessageReceiver::Frame& read) { status = read.rejected; });
    return status;
  }
  const link::Protocol protocol_ = Numbered();
  Sender sender_{protocol_};
  MessageReceiver receiver_{protocol_, link::Direction::kToPlant};
};

TEST_F(MessageOrderTest, NumbersCountFromZeroForEachTypeAndWrap) {
  MessageStamps stamps(protocol_);
  const link::MessageType& a = *protocol_.Find("a");
  std::vector<double> values(2, 5.0);
  for (int i = 0; i < 600; ++i) {
    stamps.Write(*protocol_.Find("start"), BootTime(), std::span(values).first(1));
    stamps.Write(a, BootTime(), values);
    EXPECT_EQ(values[0], i % 256);
    EXPECT_EQ(values[1], 5.0);
  }
  const link::MessageType& b = *protocol_.Find("b");
  for (const TimeNs now_us : {0, 7, 65'535, 65'536, 200'000}) {
    stamps.Write(b, BootTime(now_us * kNsPerUs + 999), std::span(values).first(1));
    EXPECT_EQ(values[0], now_us % 65'536);
  }
}

TEST_F(MessageOrderTest, ASoundSenderIsNeverRefusedThroughManyWraps) {
  for (TimeNs i = 0; i < 2000; ++i) {
    ASSERT_EQ(Send(sender_.Frame("a", i * kNsPerMs)), "") << i;
    ASSERT_EQ(Send(sender_.Frame("b", i * kNsPerMs)), "") << i;
  }
}

TEST_F(MessageOrderTest, ARepeatedOrOlderMessageIsStale) {
  std::vector<std::vector<std::uint8_t>> a;
  for (int i = 0; i < 10; ++i) a.push_back(sender_.Frame("a"));
  EXPECT_EQ(Send(a[0]), "");
  EXPECT_EQ(Send(a[0]), "stale");
  EXPECT_EQ(Send(a[5]), "");
  for (const std::size_t old : {0U, 3U, 5U}) EXPECT_EQ(Send(a[old]), "stale");
  EXPECT_EQ(Send(a[6]), "") << "a stale one changes nothing";
  const auto b = sender_.Frame("b", kNsPerMs);
  EXPECT_EQ(Send(b), "") << "each type by itself";
  EXPECT_EQ(Send(b), "stale");
}

// Half of the range ahead and more is taken for old.
TEST_F(MessageOrderTest, AGapOfHalfTheRangeIsTheLargest) {
  for (const int lost : {126, 127, 128, 254}) {
    Sender sender(protocol_);
    MessageOrder order(protocol_);
    const link::MessageType& a = *protocol_.Find("a");
    EXPECT_TRUE(order.Takes({&a, {250, 0}}));
    const double next = (250 + 1 + lost) % 256;
    EXPECT_EQ(order.Takes({&a, {next, 0}}), lost + 1 < 128) << lost;
  }
}

TEST_F(MessageOrderTest, AStartThatMeansABootBeginsAgain) {
  const auto start = sender_.Frame("start");
  EXPECT_EQ(Send(start), "");
  for (int i = 0; i < 20; ++i) EXPECT_EQ(Send(sender_.Frame("a")), "");
  Sender rebooted(protocol_);
  EXPECT_EQ(Send(rebooted.Frame("a")), "stale");
  EXPECT_EQ(Send(rebooted.Frame("start")), "");
  EXPECT_EQ(Send(rebooted.Frame("a")), "");
}

TEST(MessageOrder, AProtocolWithoutNumbersTakesEverything) {
  const link::Protocol& paper = *FindProtocol("paper");
  MessageOrder order(paper);
  const link::Message message{paper.Find(link::MessageKind::kActuators), {1, 2, 3, 4}};
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(order.Takes(message));
}

}  // namespace
}  // namespace tiltproof::harness
