// The roles' table, the message between boards, and boards that are joined by lines without faults.
#include "firmware/failover/redundant_board.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

namespace tiltproof::firmware {
namespace {

constexpr TimeNs kPeriod_ns = 12 * kNsPerMs;

// --- The table, against its rules in words.

TEST(RoleTable, OnlyAStandbyClaimsAndAFailedBoardFirstBecomesStandby) {
  for (std::size_t event = 0; event < kRoleEventCount; ++event) {
    const auto what = static_cast<RoleEvent>(event);
    const bool claims =
        what == RoleEvent::kNoClaim || what == RoleEvent::kPeerLost || what == RoleEvent::kPeerWeak;
    EXPECT_EQ(RoleAfter(Role::kStandby, what) == Role::kActive, claims) << event;
    EXPECT_EQ(RoleAfter(Role::kStandby, what) == Role::kFailed, what == RoleEvent::kLinkBad) << event;
    EXPECT_EQ(RoleAfter(Role::kFailed, what), what == RoleEvent::kLinkGood ? Role::kStandby : Role::kFailed)
        << event;
    // Its own bad link does not end a claim: there may be no other board.
    const bool ends = what == RoleEvent::kPeerPrecedes || what == RoleEvent::kAway;
    EXPECT_EQ(RoleAfter(Role::kActive, what), ends ? Role::kStandby : Role::kActive) << event;
  }
}

// --- The message.

CrossMessage AnyMessage(std::mt19937& random) {
  const auto below = [&](std::uint32_t n) { return static_cast<std::uint32_t>(random() % n); };
  CrossMessage message{.heartbeat = {.sequence = static_cast<std::uint16_t>(below(65536)),
                                     .echo = static_cast<std::uint16_t>(below(65536)),
                                     .claim_age = static_cast<std::uint32_t>(random()),
                                     .heard = below(2) == 1,
                                     .role = static_cast<Role>(below(3)),
                                     .link_good = below(2) == 1,
                                     .keeps = below(2) == 1,
                                     .ready = below(2) == 1}};
  for (float& integral : message.integrals) {
    const auto bits = static_cast<std::uint32_t>(random());
    integral = (bits & 0x7F80'0000U) == 0x7F80'0000U ? 1.0F : std::bit_cast<float>(bits);
  }
  return message;
}

TEST(CrossMessage, ComesBackAsItWasSentAndOtherwiseNotAtAll) {
  std::mt19937 random(7);
  for (int i = 0; i < 2000; ++i) {
    const CrossMessage message = AnyMessage(random);
    auto payload = EncodeCross(message);
    const auto decoded = DecodeCross(payload);
    ASSERT_TRUE(decoded);
    EXPECT_EQ(EncodeCross(*decoded), payload);
    EXPECT_EQ(decoded->heartbeat, message.heartbeat);
    EXPECT_FALSE(DecodeCross(std::span(payload).first(payload.size() - 1)));
    payload[0] |= static_cast<std::uint8_t>(0x40U << random() % 2);
    EXPECT_FALSE(DecodeCross(payload)) << "an unknown flag";
  }
}

TEST(CrossMessage, HasTheBytesOfItsDescription) {
  const auto payload = EncodeCross({.heartbeat = {.sequence = 0x0201,
                                                  .echo = 0x0403,
                                                  .claim_age = 0x08070605,
                                                  .heard = true,
                                                  .role = Role::kActive,
                                                  .keeps = true},
                                    .integrals = {1, 0, -2, 0}});
  const std::vector<std::uint8_t> expected = {0x15, 1, 2, 3, 4, 5, 6, 7,    8, 0, 0, 0x80, 0x3F,
                                              0,    0, 0, 0, 0, 0, 0, 0xC0, 0, 0, 0, 0};
  EXPECT_EQ(std::vector<std::uint8_t>(payload.begin(), payload.end()), expected);
}

TEST(CrossMessage, RefusesAThirdRoleAndNumbersThatAreNone) {
  auto payload = EncodeCross({});
  payload[0] |= 3;
  EXPECT_FALSE(DecodeCross(payload));
  for (const float bad : {std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
                          std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_FALSE(DecodeCross(EncodeCross({.heartbeat = {}, .integrals = {0, bad, 0, 0}})));
  }
}

// --- Boards and lines: what one transmits arrives at another at once, or is lost.

class Wires final : public Port {
 public:
  TimeNs Transmit(Uart uart, TimeNs now, std::span<const std::uint8_t> bytes) override {
    sent.emplace_back(uart, std::vector<std::uint8_t>(bytes.begin(), bytes.end()));
    return now;
  }
  void Log(TimeNs, const char*) override {}
  std::vector<std::pair<Uart, std::vector<std::uint8_t>>> sent;
};

struct TestBoard {
  TestBoard(Redundancy redundancy, std::size_t place) : board(redundancy, place, wires) {}
  Wires wires;
  RedundantBoard board;
  Integrals integrals{};
  bool runs = true;
  bool link = true;
};

class Boards {
 public:
  Boards(Redundancy redundancy, std::size_t count) : redundancy_(redundancy) {
    for (std::size_t place = 0; place < count; ++place)
      boards.push_back(std::make_unique<TestBoard>(redundancy, place));
  }
  void Reset(std::size_t place) { boards[place] = std::make_unique<TestBoard>(redundancy_, place); }

  void Period() {
    now_ += kPeriod_ns;
    for (auto& own : boards)
      if (own->runs) own->board.BeginPeriod(now_, own->integrals);
    for (std::size_t from = 0; from < boards.size(); ++from) {
      for (const auto& [uart, bytes] : std::exchange(boards[from]->wires.sent, {})) {
        // The lines of three boards are ab, ac, bc: each board's lines are in this order.
        const std::size_t line = static_cast<std::size_t>(uart) - 2;
        if (line >= boards.size() - 1 || cut) continue;
        const std::size_t to = line >= from ? line + 1 : line;
        const Uart at = static_cast<Uart>(2 + (from > to ? from - 1 : from));
        if (boards[to]->runs) boards[to]->board.Receive(at, bytes);
      }
    }
    for (auto& own : boards) {
      if (!own->runs) continue;
      if (const auto integrals = own->board.TakeIntegrals(own->integrals)) own->integrals = *integrals;
      if (own->link) own->board.NoteReply();
      for (float& integral : own->integrals) integral += 1;  // all see the same error
    }
  }
  void Periods(int count) {
    for (int i = 0; i < count; ++i) Period();
  }
  Role RoleOf(std::size_t place) const { return boards[place]->board.role(); }

  std::vector<std::unique_ptr<TestBoard>> boards;
  bool cut = false;

 private:
  Redundancy redundancy_;
  TimeNs now_ = 0;
};

TEST(Failover, TheFirstBoardClaimsAtOnceAndTheSecondFollowsItsIntegrals) {
  Boards boards(Redundancy::kFailover, 2);
  boards.Period();
  EXPECT_EQ(boards.RoleOf(0), Role::kActive);
  EXPECT_EQ(boards.RoleOf(1), Role::kStandby);
  boards.boards[0]->integrals = {10, 20, 30, 40};
  boards.Periods(2);
  EXPECT_EQ(boards.boards[1]->integrals, boards.boards[0]->integrals);
}

TEST(Failover, ABoardThatWasResetTakesOverWithoutABump) {
  Boards boards(Redundancy::kFailover, 2);
  boards.Periods(50);
  boards.Reset(1);
  boards.Periods(5);
  const Integrals before = boards.boards[0]->integrals;
  boards.boards[0]->runs = false;
  int periods = 0;
  for (; boards.RoleOf(1) != Role::kActive && periods < 10; ++periods) boards.Period();
  EXPECT_LE(periods, kLostPeriods + 1);
  EXPECT_EQ(boards.boards[1]->integrals[0], before[0] + static_cast<float>(periods));
}

TEST(Failover, ABoardWithABadLinkHandsOverToAGoodOneAndOtherwiseKeepsItsClaim) {
  Boards boards(Redundancy::kFailover, 2);
  boards.Periods(20);
  boards.boards[0]->link = false;
  boards.boards[1]->link = false;
  boards.Periods(20);
  EXPECT_EQ(boards.RoleOf(0), Role::kActive) << "there is no better one";
  EXPECT_EQ(boards.RoleOf(1), Role::kFailed);
  boards.boards[1]->link = true;
  int periods = 0;
  for (; boards.RoleOf(1) != Role::kActive && periods < 10; ++periods) {
    boards.Period();
    EXPECT_TRUE(boards.RoleOf(0) == Role::kActive || boards.RoleOf(1) == Role::kActive);
  }
  EXPECT_LE(periods, 2);
  boards.Periods(2);
  EXPECT_EQ(boards.RoleOf(0), Role::kFailed);
  boards.boards[0]->link = true;
  boards.Periods(20);
  EXPECT_EQ(boards.RoleOf(0), Role::kStandby);
  EXPECT_EQ(boards.RoleOf(1), Role::kActive) << "it does not go back";
}

TEST(Failover, TheYoungerOfTwoClaimsEndsWhenTheLineIsBack) {
  for (const std::size_t elder : {std::size_t{0}, std::size_t{1}}) {
    Boards boards(Redundancy::kFailover, 2);
    boards.Periods(20);
    if (elder == 1) {
      boards.boards[0]->runs = false;
      boards.Periods(10);
      boards.Reset(0);
    }
    boards.cut = true;
    boards.Periods(30);
    ASSERT_EQ(boards.RoleOf(0), Role::kActive);
    ASSERT_EQ(boards.RoleOf(1), Role::kActive);
    boards.cut = false;
    boards.Periods(4);
    EXPECT_EQ(boards.RoleOf(elder), Role::kActive);
    EXPECT_EQ(boards.RoleOf(1 - elder), Role::kStandby);
  }
}

TEST(Triplex, EveryBoardFliesAndTheIntegralsAreTheMedian) {
  Boards boards(Redundancy::kTriplex, 3);
  std::mt19937 random(3);
  boards.Periods(100);
  for (int i = 0; i < 200; ++i) {
    std::vector<float> values;
    for (auto& board : boards.boards) {
      board->integrals[2] = static_cast<float>(random() % 1000);
      values.push_back(board->integrals[2]);
    }
    std::sort(values.begin(), values.end());
    boards.Period();
    for (std::size_t place = 0; place < 3; ++place) {
      EXPECT_EQ(boards.RoleOf(place), Role::kActive);
      EXPECT_EQ(boards.boards[place]->integrals[2], values[1] + 1);
    }
  }
}

TEST(Triplex, ABoardThatWasResetHasTheOthersIntegralsInTheNextPeriod) {
  Boards boards(Redundancy::kTriplex, 3);
  boards.Periods(100);
  boards.Reset(2);
  boards.Period();
  EXPECT_EQ(boards.boards[2]->integrals, boards.boards[0]->integrals);
  // Also from one board alone.
  boards.boards[0]->runs = false;
  boards.Periods(5);
  boards.Reset(2);
  boards.Periods(2);
  EXPECT_EQ(boards.boards[2]->integrals, boards.boards[1]->integrals);
  // An old board does not follow one other.
  boards.Periods(200);
  boards.boards[1]->integrals[0] = 1e6F;
  boards.Periods(2);
  EXPECT_LT(boards.boards[2]->integrals[0], 1e5F);
}

}  // namespace
}  // namespace tiltproof::firmware
