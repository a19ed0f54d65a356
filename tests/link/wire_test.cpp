// The wire's times: exact byte times, where frames are cut, when bytes can be taken, and in which order.

#include "link/wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "firmware/messages.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/frame.h"
#include "tests/link/taken.h"

namespace tiltproof::link {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

using Bytes = std::vector<std::uint8_t>;

constexpr BootTime kStart(5 * kNsPerMs);

// 10 bits at 921600 baud are 10850.694444... ns.
constexpr TimeNs kByteTimes[] = {0, 10850, 21701, 32552, 43402, 54253, 65104, 75954, 86805, 97656, 108506};

const Protocol& kPaper = *harness::FindProtocol("paper");

Bytes Framed(const MessageBytes& message) {
  std::array<std::uint8_t, FrameBytesMax(kMessageBytesMax)> wire;
  const auto frame = EncodeFrame(message.span(), wire).bytes;
  return {frame.begin(), frame.end()};
}

// A filter made of a function.
struct TestFilter : ChunkFilter {
  std::function<void(std::vector<Chunk>&)> apply;
  void Apply(std::vector<Chunk>& chunks) override { apply(chunks); }
};

// Chunks as sent, as the taps saw them.
struct SentFrames {
  std::vector<BootTime> begins;
  std::vector<Bytes> frames;
  explicit SentFrames(Wire& wire) {
    wire.SetTaps({.sent =
                      [this](const Chunk& chunk) {
                        begins.push_back(chunk.begin_ns);
                        frames.push_back(chunk.bytes);
                      },
                  .delivered = {}});
  }
};

TEST(WireTest, ByteTimesAt921600BaudAreRoundedDownFromTheBeginning) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  const Bytes frame = {0x7E, 1, 2, 3, 4, 5, 6, 7, 8, 0x7E};
  EXPECT_EQ(wire.Transmit(kStart, frame), kStart + 108506);
  for (std::size_t i = 1; i <= frame.size(); ++i) {
    EXPECT_THAT(TakeAll(wire, kStart + kByteTimes[i] - 1), IsEmpty()) << i;
    EXPECT_THAT(TakeAll(wire, kStart + kByteTimes[i]),
                ElementsAre(Taken{kStart + kByteTimes[i], {frame[i - 1]}}))
        << i;
  }
  EXPECT_EQ(wire.NextArrival(), BootTime::Never());
}

TEST(WireTest, OneMillionBytesTakeExactlyTheirTime) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  const Bytes bytes(1000, 0x55);
  BootTime end;
  for (int i = 0; i < 1000; ++i) end = wire.Transmit(end, bytes);
  EXPECT_EQ(end, BootTime(1'000'000LL * 10 * kNsPerS / 921'600));
}

TEST(WireTest, AnIdealLineTakesNoTime) {
  Wire wire({.baud = 0}, Direction::kToPlant, kPaper, nullptr);
  const Bytes frame = {0x7E, 1, 2, 0x7E};
  EXPECT_EQ(wire.Transmit(kStart, frame), kStart);
  EXPECT_EQ(wire.NextArrival(), kStart);
  EXPECT_THAT(TakeAll(wire, kStart), ElementsAre(Taken{kStart, frame}));
}

TEST(WireTest, TheAdapterDelaysEveryArrival) {
  Wire wire({.baud = 921'600, .adapter_latency_ns = kNsPerMs}, Direction::kToPlant, kPaper, nullptr);
  const Bytes frame = {0x7E, 1, 0x7E};
  EXPECT_EQ(wire.Transmit(kStart, frame), kStart + kByteTimes[3]);
  EXPECT_EQ(wire.NextArrival(), kStart + kByteTimes[3] + kNsPerMs);
  EXPECT_THAT(TakeAll(wire, kStart + kNsPerMs), IsEmpty());
  EXPECT_THAT(TakeAll(wire), ElementsAre(Taken{kStart + kByteTimes[3] + kNsPerMs, frame}));
}

TEST(WireTest, AFrameWaitsForTheTransmitter) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  const Bytes first = {0x7E, 1, 2, 0x7E};
  const Bytes second = {0x7E, 3, 0x7E};
  wire.Transmit(kStart, first);
  EXPECT_EQ(wire.Transmit(kStart + 1, second), kStart + kByteTimes[7]);
  EXPECT_THAT(TakeAll(wire),
              ElementsAre(Taken{kStart + kByteTimes[4], first}, Taken{kStart + kByteTimes[7], second}));
}

TEST(WireTest, CutsAtSeparateAndSharedFlags) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  const SentFrames sent(wire);
  const Bytes bytes = {0x7E, 1, 0x7E, 0x7E, 2, 0x7E, 3, 0x7E, 0x7E, 0x7E, 4, 0x7E};
  wire.Transmit(kStart, bytes);
  EXPECT_THAT(sent.frames, ElementsAre(Bytes{0x7E, 1, 0x7E}, Bytes{0x7E, 2, 0x7E}, Bytes{3, 0x7E},
                                       Bytes{0x7E, 0x7E, 4, 0x7E}));
  EXPECT_THAT(sent.begins,
              ElementsAre(kStart, kStart + kByteTimes[3], kStart + kByteTimes[6], kStart + kByteTimes[8]));
}

TEST(WireTest, AFrameSentByteByByteIsTheSameFrame) {
  const Bytes frame = Framed(EncodeSensors({}));
  Wire whole({}, Direction::kToClient, kPaper, nullptr);
  Wire single({}, Direction::kToClient, kPaper, nullptr);
  const BootTime end = whole.Transmit(kStart, frame);
  BootTime now = kStart;
  for (const std::uint8_t byte : frame) now = single.Transmit(now, std::span(&byte, 1));
  EXPECT_EQ(now, end);
  EXPECT_EQ(TakeAll(single), TakeAll(whole));
}

TEST(WireTest, APauseWithinAFrameDelaysTheWholeOfIt) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  const SentFrames sent(wire);
  wire.Transmit(kStart, Bytes{0x7E, 1});
  wire.Transmit(kStart + 100'000, Bytes{2, 0x7E});
  EXPECT_THAT(sent.begins, ElementsAre(kStart + 100'000 - kByteTimes[2]));
  EXPECT_EQ(TakeAll(wire).back().arrival, kStart + 100'000 - kByteTimes[2] + kByteTimes[4]);
}

TEST(WireTest, BytesWithoutAClosingFlagGoOnAfterTheIdleTime) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  EXPECT_EQ(wire.IdleTime(), 217'013);
  wire.Transmit(kStart, Bytes{0x7E, 1, 2});
  const BootTime flush = kStart + kByteTimes[3] + wire.IdleTime();
  EXPECT_EQ(wire.NextArrival(), flush);
  EXPECT_THAT(TakeAll(wire, flush - 1), IsEmpty());
  EXPECT_THAT(TakeAll(wire, flush), ElementsAre(Taken{flush, {0x7E, 1, 2}}));
  EXPECT_EQ(wire.NextArrival(), BootTime::Never());
}

TEST(WireTest, TheNextBytesFindAnIdleLineFlushed) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  const SentFrames sent(wire);
  wire.Transmit(kStart, Bytes{0x7E, 1});
  wire.Transmit(kStart + kNsPerMs, Bytes{2, 0x7E});
  EXPECT_THAT(sent.frames, ElementsAre(Bytes{0x7E, 1}, Bytes{2, 0x7E}));
}

TEST(WireTest, AnIdealLineWaitsBetweenTheBytesOfAFrame) {
  Wire wire({.baud = 0}, Direction::kToPlant, kPaper, nullptr);
  const SentFrames sent(wire);
  for (int i = 0; i < 4; ++i) {
    wire.Transmit(kStart + i * 1000, Bytes{static_cast<std::uint8_t>(i % 3 == 0 ? 0x7E : i)});
    TakeAll(wire, kStart + i * 1000);
  }
  EXPECT_THAT(sent.frames, ElementsAre(Bytes{0x7E, 1, 2, 0x7E}));
}

TEST(WireTest, AChunkHasALimit) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  const SentFrames sent(wire);
  wire.Transmit(kStart, Bytes(2 * Wire::kChunkBytesMax + 5, 0x55));
  ASSERT_EQ(sent.frames.size(), 2U);
  EXPECT_EQ(sent.frames[0].size(), Wire::kChunkBytesMax);
  EXPECT_EQ(sent.frames[1].size(), Wire::kChunkBytesMax);
}

TEST(WireTest, WhoTakesInTheMiddleGetsThePartThatHasArrived) {
  Wire wire({}, Direction::kToPlant, kPaper, nullptr);
  wire.Transmit(kStart, Bytes{0x7E, 1, 2, 3, 0x7E});
  EXPECT_THAT(TakeAll(wire, kStart + kByteTimes[3] + 5),
              ElementsAre(Taken{kStart + kByteTimes[3], {0x7E, 1, 2}}));
  EXPECT_EQ(wire.NextArrival(), kStart + kByteTimes[5]);
  EXPECT_THAT(TakeAll(wire), ElementsAre(Taken{kStart + kByteTimes[5], {3, 0x7E}}));
}

TEST(WireTest, APieceEndsAtAFlagThatMayEndAFrame) {
  TestFilter filter;
  filter.apply = [](std::vector<Chunk>& chunks) {
    chunks.front().bytes = {0x7E, 1, 0x7E, 2, 0x7D, 0x7E, 0x7E, 3};
  };
  Wire wire({}, Direction::kToPlant, kPaper, &filter);
  wire.Transmit(kStart, Bytes{0x7E, 1, 1, 1, 1, 1, 1, 0x7E});
  EXPECT_EQ(wire.NextArrival(), kStart + kByteTimes[3]);
  EXPECT_THAT(TakeAll(wire), ElementsAre(Taken{kStart + kByteTimes[3], {0x7E, 1, 0x7E}},
                                         Taken{kStart + kByteTimes[6], {2, 0x7D, 0x7E}},
                                         Taken{kStart + kByteTimes[8], {0x7E, 3}}));
  // The line ended without a flag: the next frame's opening flag ends what was open.
  filter.apply = [](std::vector<Chunk>&) {};
  wire.Transmit(kStart + kNsPerMs, Bytes{0x7E, 4, 0x7E});
  EXPECT_EQ(wire.NextArrival(), kStart + kNsPerMs + kByteTimes[1]);
}

TEST(WireTest, AFilterSeesEachFrameWithItsMessage) {
  std::vector<std::string> names;
  TestFilter filter;
  filter.apply = [&names](std::vector<Chunk>& chunks) {
    ASSERT_EQ(chunks.size(), 1U);
    const std::uint8_t message = chunks.front().message;
    names.push_back(message == kNoMessage ? "none" : kPaper.messages.at(message).name);
  };
  // 0x7D and 0x7E in the floats: the frames are escaped.
  Actuators actuators;
  const std::array<std::uint8_t, 4> awkward = {0x7E, 0x7D, 0x7E, 0x41};
  std::memcpy(&actuators.f_r_n, awkward.data(), awkward.size());
  for (const Dialect dialect : {Dialect::kPaper, Dialect::kProvant}) {
    Wire wire({}, Direction::kToPlant, *harness::FindProtocol(Name(dialect)), &filter);
    Bytes bytes = Framed(EncodeStart(dialect, {}));
    const Bytes request = Framed(EncodeReadSensors(dialect));
    const Bytes command = Framed(EncodeActuators(dialect, actuators));
    EXPECT_GT(command.size(), 24U);
    bytes.insert(bytes.end(), request.begin() + 1, request.end());  // shares the flag before it
    bytes.insert(bytes.end(), command.begin(), command.end());
    bytes.insert(bytes.end(), {0x7E, 1, 2, 3, 0x7E});
    names.clear();
    wire.Transmit(BootTime(), bytes);
    EXPECT_THAT(names, ElementsAre("start", "request", "actuators", "none"));
  }
  names.clear();
  Wire to_client({}, Direction::kToClient, kPaper, &filter);
  to_client.Transmit(BootTime(), Framed(EncodeSensors({})));
  to_client.Transmit(BootTime(), Framed(EncodeReference({})));
  Wire reference({}, Direction::kReference, kPaper, &filter);
  reference.Transmit(BootTime(), Framed(EncodeReference({})));
  EXPECT_THAT(names, ElementsAre("reply", "none", "reference"));
}

TEST(WireTest, ChunksKeepTheFiltersOrderAndNeverOverlap) {
  TestFilter filter;
  filter.apply = [](std::vector<Chunk>& chunks) {
    // Late, then on time, then nothing at all.
    Chunk copy = chunks.front();
    chunks.front().begin_ns += kNsPerMs;
    copy.bytes[1] = 9;
    chunks.push_back(copy);
    chunks.push_back(Chunk{});
  };
  Wire wire({}, Direction::kToPlant, kPaper, &filter);
  std::vector<BootTime> delivered;
  wire.SetTaps(
      {.sent = {}, .delivered = [&delivered](const Chunk& chunk) { delivered.push_back(chunk.begin_ns); }});
  wire.Transmit(kStart, Bytes{0x7E, 1, 0x7E});
  const BootTime first = kStart + kNsPerMs;
  EXPECT_THAT(delivered, ElementsAre(first, first + kByteTimes[3]));
  EXPECT_THAT(TakeAll(wire), ElementsAre(Taken{first + kByteTimes[3], {0x7E, 1, 0x7E}},
                                         Taken{first + 2 * kByteTimes[3], {0x7E, 9, 0x7E}}));
}

TEST(WireTest, NothingArrivesBeforeTheWireKnowsOfIt) {
  TestFilter filter;
  filter.apply = [](std::vector<Chunk>& chunks) { chunks.front().bytes.resize(1); };
  Wire wire({}, Direction::kToPlant, kPaper, &filter);
  BootTime now = kStart;
  BootTime last = now;
  for (const std::uint8_t byte : Bytes{0x7E, 1, 2, 3, 4, 0x7E}) {
    last = now;
    now = wire.Transmit(now, std::span(&byte, 1));
  }
  EXPECT_EQ(wire.NextArrival(), last);
}

TEST(WireTest, TheReceiverMayTransmitOnTheSameWire) {
  Wire wire({.baud = 0}, Direction::kToPlant, kPaper, nullptr);
  wire.Transmit(BootTime(), Bytes{0x7E, 1, 0x7E});
  int count = 0;
  wire.Take(BootTime(), [&](BootTime, std::span<const std::uint8_t> bytes) {
    if (++count < 40) wire.Transmit(BootTime(), bytes);
  });
  EXPECT_EQ(count, 40);
}

// One entry per byte, everything recomputed from the beginning at every question.
class NaiveWire {
 public:
  NaiveWire(WireConfig config) : config_(config) {}

  BootTime Transmit(BootTime now, const Bytes& bytes) {
    for (const std::uint8_t byte : bytes) {
      if (sent_.empty() || now > sent_.back().end) base_ = now, count_ = 0;
      const BootTime begin = base_ + Span(count_++);
      sent_.push_back({byte, now, begin, base_ + Span(count_)});
    }
    return std::max(now, sent_.empty() ? now : sent_.back().end);
  }

  struct Arrival {
    std::uint8_t byte;
    BootTime time;
    bool chunk_ends;
  };
  // Arrivals of all bytes that the wire knows at `now`. `flush` becomes the time at which it will flush an open chunk.
  std::vector<Arrival> Arrivals(BootTime now, BootTime& flush) const {
    std::vector<Arrival> arrivals;
    BootTime line_free = BootTime::Earliest();
    Bytes open;
    bool content = false;
    const auto close = [&](BootTime end, BootTime known) {
      const auto n = static_cast<std::int64_t>(open.size());
      const BootTime begin =
          std::max({end, known, line_free == BootTime::Earliest() ? end : line_free + Span(n)}) - Span(n);
      for (std::int64_t i = 0; i < n; ++i) {
        arrivals.push_back({open[static_cast<std::size_t>(i)],
                            begin + Span(i + 1) + config_.adapter_latency_ns, i + 1 == n});
      }
      line_free = begin + Span(n);
      open.clear();
      content = false;
    };
    // The chunk's end as its bytes' times add up: begin of the first, the pauses, and its length.
    BootTime chunk_begin;
    const TimeNs idle = 20LL * Bits() * kNsPerS / (config_.baud == 0 ? 921'600 : config_.baud);
    for (std::size_t i = 0; i < sent_.size(); ++i) {
      const Byte& byte = sent_[i];
      if (!open.empty() && byte.now >= sent_[i - 1].end + idle) {
        close(chunk_begin + Span(static_cast<std::int64_t>(open.size())), sent_[i - 1].end + idle);
      }
      chunk_begin = open.empty() ? byte.begin : chunk_begin + (byte.begin - sent_[i - 1].end);
      open.push_back(byte.value);
      if (byte.value == 0x7E && content) {
        close(chunk_begin + Span(static_cast<std::int64_t>(open.size())), byte.now);
      } else {
        content = content || byte.value != 0x7E;
      }
    }
    flush = open.empty() ? BootTime::Never() : sent_.back().end + idle;
    if (now >= flush) {
      close(chunk_begin + Span(static_cast<std::int64_t>(open.size())), flush);
      flush = BootTime::Never();
    }
    return arrivals;
  }

 private:
  struct Byte {
    std::uint8_t value;
    BootTime now, begin, end;
  };
  std::int64_t Bits() const {
    const CharacterFormat& format = config_.character;
    return 1 + format.data_bits + (format.parity == Parity::kNone ? 0 : 1) + format.stop_bits;
  }
  TimeNs Span(std::int64_t n) const { return config_.baud == 0 ? 0 : n * Bits() * kNsPerS / config_.baud; }

  WireConfig config_;
  BootTime base_;
  std::int64_t count_ = 0;
  std::vector<Byte> sent_;
};

RC_GTEST_PROP(WirePropertyTest, EqualsTheByteByByteModel, ()) {
  const WireConfig config{.baud = *rc::gen::element<std::int64_t>(921'600, 921'600, 115'200, 300, 0),
                          .adapter_latency_ns = *rc::gen::element<TimeNs>(0, 0, 1'000'000),
                          .character = {.data_bits = *rc::gen::element<std::int64_t>(7, 8),
                                        .parity = *rc::gen::element(Parity::kNone, Parity::kEven),
                                        .stop_bits = *rc::gen::element<std::int64_t>(1, 2)}};
  Wire wire(config, Direction::kToPlant, kPaper, nullptr);
  NaiveWire naive(config);
  const TimeNs byte_time = config.baud == 0 ? 10'851 : 10 * kNsPerS / config.baud;
  BootTime now;
  std::size_t taken = 0;
  bool taken_flag = true;

  const int op_count = *rc::gen::inRange(1, 30);
  for (int op = 0; op < op_count; ++op) {
    now += *rc::gen::weightedOneOf<TimeNs>(
        {{3, rc::gen::just<TimeNs>(0)},
         {3, rc::gen::inRange<TimeNs>(0, 3 * byte_time)},
         {1, rc::gen::map(rc::gen::inRange<TimeNs>(-1, 2), [&](TimeNs d) { return wire.IdleTime() + d; })},
         {1, rc::gen::inRange<TimeNs>(0, 60 * byte_time)}});
    if (*rc::gen::arbitrary<bool>()) {
      const auto bytes = *rc::gen::container<Bytes>(rc::gen::element<std::uint8_t>(0x7E, 0x7E, 0x7D, 1, 2));
      RC_ASSERT(wire.Transmit(now, bytes) == naive.Transmit(now, bytes));
    } else {
      const std::size_t first = taken;
      BootTime flush = BootTime::Never();
      const auto arrivals = naive.Arrivals(now, flush);
      wire.Take(now, [&](BootTime arrival, std::span<const std::uint8_t> piece) {
        RC_ASSERT(!piece.empty());
        for (std::size_t i = 0; i < piece.size(); ++i) {
          RC_ASSERT(arrivals.at(taken).byte == piece[i]);
          const bool may_end_frame = piece[i] == 0x7E && !taken_flag;
          if (i + 1 < piece.size()) RC_ASSERT(!may_end_frame && !arrivals[taken].chunk_ends);
          taken_flag = piece[i] == 0x7E;
          ++taken;
        }
        RC_ASSERT(arrivals[taken - 1].time == arrival);
      });
      std::size_t arrived = first;
      while (arrived < arrivals.size() && arrivals[arrived].time <= now) ++arrived;
      RC_ASSERT(taken == arrived);
    }

    BootTime next = BootTime::Never();
    BootTime flush = BootTime::Never();
    const auto arrivals = naive.Arrivals(now, flush);
    if (flush != BootTime::Never()) next = flush + config.adapter_latency_ns;
    bool flag_before = taken_flag;
    for (std::size_t i = taken; i < arrivals.size(); ++i) {
      const bool flag = arrivals[i].byte == 0x7E;
      if (arrivals[i].chunk_ends || (flag && !flag_before)) {
        next = std::min(next, arrivals[i].time);
        break;
      }
      flag_before = flag;
    }
    RC_ASSERT(wire.NextArrival() == next);
  }
}

}  // namespace
}  // namespace tiltproof::link
