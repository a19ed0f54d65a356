// Everything that two boards, the line between them and an arbiter can do in small scope: all interleavings of up to four
// faults, with any time between them.
//
// The boards run the real protocol of roles. The line and the arbiter `active_claims` are models of their own, in steps of one
// control period. Nothing in a state depends on the time since power-on: numbers of heartbeats count from the sender's next
// one, ages of two claims from the younger. So there are finitely many states, and the exploration ends when it finds no new
// one. It keeps each state once, with the fewest faults that lead to it: whatever can follow with more faults used can follow
// with fewer.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "firmware/failover/role_protocol.h"

namespace tiltproof::firmware {
namespace {

constexpr int kFaultsMax = 4;
constexpr TimeNs kPeriod_ns = 12 * kNsPerMs;
// A command counts in its period and in so many more: an arbiter with a time-out of 36 ms.
constexpr int kCommandPeriods = 2;
// 200 ms after the line is back.
constexpr int kDoubleClaimMax = 16;
// Without control, in periods: after the death of one board, while the other one ran and heard it before; and in any case,
// of a board that runs all the time.
constexpr int kLostMax = 2;
constexpr int kLostMaxAlone = 7;

// Order of the boards within a period.
enum class Phase : std::uint8_t { kTogether, kFirstLeads, kSecondLeads };

enum class Power : std::uint8_t { kRuns, kBoots, kHangs };

struct Board {
  explicit Board(std::size_t place) : roles(place) {}
  RoleProtocol roles;
  Power power = Power::kRuns;
  int boot_left = 0;
  int command_age = kCommandPeriods + 1;  // periods since its last command; not more than here
  int lost_periods = 0;                   // in a row that it ran and no board had control
  bool died_in_force = false;             // since its command came into force
};

struct Late {
  int due;  // periods until it arrives
  std::size_t sender;
  Heartbeat heartbeat;
};

struct Fault {
  std::int16_t step;
  char what;          // l lost, d delayed, 2 doubled; r reset, h hung, b back; c line cut, j joined again
  std::int8_t whose;  // the board's place, or the sender's
  std::int8_t by;     // periods
};
struct Faults {
  std::array<Fault, kFaultsMax> all;
  std::size_t count = 0;
};

struct World {
  std::array<Board, 2> boards = {Board(0), Board(1)};
  std::vector<Late> late;  // frames on the line, in the order of their faults
  bool cut = false;        // the line, both ways
  int source = -1;         // the board whose command made the input last
  int both_claim_periods = 0;
  Faults faults;  // no part of the state: the way to it
  int step = 0;   // the same
};

std::string Text(const Faults& faults) {
  std::string text;
  for (const Fault& fault : std::span(faults.all).first(faults.count))
    text += std::string(text.empty() ? "" : " ") + fault.what + std::to_string(fault.whose) +
            (fault.by > 0 ? "+" + std::to_string(fault.by) : "") + "@" + std::to_string(fault.step);
  return text.empty() ? "no fault" : text;
}

// Makes numbers relative, and cuts them off where no larger one makes a difference.
void Canonicalise(World& world) {
  constexpr std::uint16_t kFar =
      12;  // beyond all that is compared: kFreshEchoPeriods, and the longest delay with its round
  std::array<RoleMemory, 2> memory = {world.boards[0].roles.memory(), world.boards[1].roles.memory()};
  const std::array<std::uint16_t, 2> base = {memory[0].sequence, memory[1].sequence};
  const bool settled = world.late.empty();
  const auto relative = [&](std::uint16_t number, std::uint16_t from) {
    auto ahead = static_cast<std::int16_t>(static_cast<std::uint16_t>(number - from));
    if (settled) ahead = std::clamp<std::int16_t>(ahead, -kFar, kFar);
    return static_cast<std::uint16_t>(ahead);
  };
  const auto age_of = [&](std::size_t board) {
    return memory[board].role == Role::kActive ? static_cast<std::int64_t>(memory[board].claim_age) : -1;
  };
  // The younger claim is at most kFar old, the elder at most kFar elder. Copies of an age move with it.
  const bool both = age_of(0) >= 0 && age_of(1) >= 0;
  const std::int64_t younger = both ? std::min(age_of(0), age_of(1)) : 0;
  std::array<std::int64_t, 2> shift{};
  for (std::size_t board = 0; board < 2; ++board) {
    const std::int64_t elder_by = age_of(board) - younger;
    shift[board] = std::max<std::int64_t>(0, younger - kFar) + std::max<std::int64_t>(0, elder_by - kFar);
  }
  const auto canonical = [&](Heartbeat& heartbeat, std::size_t sender) {
    heartbeat.sequence = relative(heartbeat.sequence, base[sender]);
    heartbeat.echo = heartbeat.heard ? relative(heartbeat.echo, base[1 - sender]) : std::uint16_t{0};
    heartbeat.claim_age = static_cast<std::uint32_t>(
        std::max<std::int64_t>(0, static_cast<std::int64_t>(heartbeat.claim_age) - shift[sender]));
    if (settled) heartbeat.claim_age = std::min<std::uint32_t>(heartbeat.claim_age, 2 * kFar);
  };
  for (std::size_t board = 0; board < 2; ++board) {
    RoleMemory& own = memory[board];
    own.sequence = 0;
    own.claim_age = static_cast<std::uint32_t>(static_cast<std::int64_t>(own.claim_age) - shift[board]);
    own.silent_periods = std::min<std::uint8_t>(own.silent_periods, 10);
    own.idle_periods =
        own.role == Role::kActive ? std::uint8_t{0} : std::min<std::uint8_t>(own.idle_periods, 4);
    if (own.period_ns) own.period_ns = std::max<TimeNs>(*own.period_ns - kPeriod_ns, -5 * kPeriod_ns);
    if (own.peer) canonical(*own.peer, 1 - board);
    world.boards[board].roles = RoleProtocol(own);
  }
  for (Late& late : world.late) {
    --late.due;
    canonical(late.heartbeat, late.sender);
  }
}

// A digest of all of a state, and of nothing else: 128 bits, so that no two of some million states share one.
struct Digest {
  std::uint64_t low = 0x9E3779B97F4A7C15, high = 0xC2B2AE3D27D4EB4F;
  friend bool operator==(const Digest&, const Digest&) = default;
  struct Low {
    std::size_t operator()(const Digest& digest) const { return digest.low; }
  };
};

Digest DigestOf(const World& world) {
  Digest digest;
  const auto put = [&digest](std::uint64_t value) {
    digest.low = (digest.low ^ value) * 0xFF51AFD7ED558CCD;
    digest.low ^= digest.low >> 32U;
    digest.high = (digest.high + value) * 0xC4CEB9FE1A85EC53 + 1;
    digest.high ^= digest.high >> 29U;
  };
  const auto flags = [](auto... values) {
    std::uint64_t all = 0;
    ((all = all << 8U | static_cast<std::uint8_t>(values)), ...);
    return all;
  };
  const auto put_heartbeat = [&](const Heartbeat& h) {
    put(std::uint64_t{h.sequence} << 48U | std::uint64_t{h.echo} << 32U | h.claim_age);
    put(flags(h.heard, h.role, h.link_good, h.keeps, h.ready));
  };
  for (const Board& board : world.boards) {
    const RoleMemory& own = board.roles.memory();
    put(flags(own.role, own.link_good, own.keeps | own.ready << 1U, own.silent_periods, own.idle_periods,
              own.period_ns ? *own.period_ns / kPeriod_ns : 1, own.peer.has_value(), board.power));
    put(std::uint64_t{own.claim_age} << 32U |
        flags(board.boot_left, board.command_age, board.lost_periods, board.died_in_force));
    if (own.peer) put_heartbeat(*own.peer);
  }
  for (const Late& late : world.late) {
    put(flags(late.due, late.sender));
    put_heartbeat(late.heartbeat);
  }
  put(flags(world.cut, world.source, world.both_claim_periods));
  return digest;
}

// A frame's fault: none, lost, delayed or doubled by so many periods.
struct Way {
  char what;
  int by;
};
struct Menu {
  std::vector<int> boots;  // periods that a board takes to boot
  std::vector<Way> ways;
};
const Menu kFew = {.boots = {0, 4}, .ways = {{' ', 0}, {'l', 0}, {'d', 1}, {'d', 4}, {'2', 1}}};
const Menu kMany = {.boots = {0, 1, 2, 4, 6},
                    .ways = {{' ', 0}, {'l', 0}, {'d', 1}, {'d', 2}, {'d', 3}, {'d', 4}, {'2', 1}, {'2', 3}}};

struct Findings {
  std::size_t states_count = 0, steps_count = 0, ties_count = 0;
  std::array<int, kFaultsMax + 1> lost_of{}, double_of{};  // the most periods, by the number of faults
  std::string lost, doubled, switched;                     // the first way to more than there may be
};

class Exploration {
 public:
  // `cuts`: the line may also be cut and joined again, each as one fault, and is cut in the beginning.
  Exploration(Phase phase, std::size_t faults_max, const Menu& menu, bool cuts)
      : phase_(phase), faults_max_(faults_max), menu_(menu), cuts_(cuts) {
    World world;
    world.cut = cuts;
    waiting_[0].push_back(world);
  }

  Findings Run() {
    for (std::size_t faults = 0; faults < waiting_.size(); ++faults) {
      while (!waiting_[faults].empty()) {
        const World world = std::move(waiting_[faults].back());
        waiting_[faults].pop_back();
        Environment(world);
      }
    }
    found_.states_count = known_.size();
    return found_;
  }

 private:
  bool MayFault(const World& world) const { return world.faults.count < faults_max_; }
  static void Add(World& world, char what, std::size_t whose, int by = 0) {
    world.faults.all[world.faults.count++] = {static_cast<std::int16_t>(world.step), what,
                                              static_cast<std::int8_t>(whose), static_cast<std::int8_t>(by)};
    world.both_claim_periods = 0;
  }

  // Faults of the line, then of each board, then of each frame, in every combination.
  void Environment(const World& world) {
    FaultsOfBoard(0, world);
    if (!cuts_ || !MayFault(world)) return;
    World changed = world;
    Add(changed, world.cut ? 'j' : 'c', 0);
    changed.cut = !world.cut;
    FaultsOfBoard(0, changed);
  }

  void FaultsOfBoard(std::size_t which, const World& world) {
    const auto go_on = [&](const World& to) { which == 0 ? FaultsOfBoard(1, to) : Frames(to); };
    go_on(world);
    if (!MayFault(world)) return;
    const Power power = world.boards[which].power;
    for (const int boot : menu_.boots) {
      if (power == Power::kBoots) break;
      World to = world;
      Add(to, 'r', which, boot);
      Board& board = to.boards[which];
      board.roles = RoleProtocol(which);
      board.power = boot == 0 ? Power::kRuns : Power::kBoots;
      board.boot_left = boot;
      Die(to, which);
      go_on(to);
    }
    if (power == Power::kBoots) return;
    World to = world;
    Add(to, power == Power::kRuns ? 'h' : 'b', which);
    to.boards[which].power = power == Power::kRuns ? Power::kHangs : Power::kRuns;
    if (power == Power::kRuns) Die(to, which);
    go_on(to);
  }
  static void Die(World& world, std::size_t which) {
    world.boards[which].lost_periods = 0;
    if (world.source == static_cast<int>(which)) world.boards[which].died_in_force = true;
  }

  void Frames(const World& world) {
    const auto can_fault = [this](const World& at, std::size_t sender) {
      return MayFault(at) && !at.cut && at.boards[sender].power == Power::kRuns;
    };
    for (const Way& first : menu_.ways) {
      if (first.what != ' ' && !can_fault(world, 0)) break;
      World with_first = world;
      if (first.what != ' ') Add(with_first, first.what, 0, first.by);
      for (const Way& second : menu_.ways) {
        if (second.what != ' ' && !can_fault(with_first, 1)) break;
        World to = with_first;
        if (second.what != ' ') Add(to, second.what, 1, second.by);
        const std::array<std::int64_t, 2> ages = Ages(to);
        RunPeriod(to, {first.what, second.what}, {first.by, second.by});
        Judge(to, ages);
        Keep(std::move(to));
      }
    }
  }

  void RunPeriod(World& world, std::array<char, 2> what, std::array<int, 2> by) {
    ++found_.steps_count;
    std::array<std::optional<Heartbeat>, 2> sent;
    const auto run = [&](std::size_t which) {
      Board& board = world.boards[which];
      board.command_age = std::min(board.command_age + 1, kCommandPeriods + 1);
      if (board.power == Power::kBoots && --board.boot_left <= 0) board.power = Power::kRuns;
      if (board.power != Power::kRuns) return;
      const bool link_was_good = board.roles.memory().link_good;
      sent[which] = board.roles.BeginPeriod(0, link_was_good);
      board.roles.NoteLinkGood();  // the reply
      board.command_age = 0;
    };
    const auto deliver = [&](std::size_t from) {
      Board& to = world.boards[1 - from];
      const auto hear = [&](const Heartbeat& heartbeat) {
        if (to.power == Power::kRuns) to.roles.Hear(heartbeat);
      };
      for (const Late& late : world.late)
        if (late.sender == from && late.due <= 0) hear(late.heartbeat);
      std::erase_if(world.late, [&](const Late& late) { return late.sender == from && late.due <= 0; });
      if (!sent[from] || world.cut || what[from] == 'l') return;
      if (what[from] != ' ')
        world.late.push_back({.due = by[from], .sender = from, .heartbeat = *sent[from]});
      if (what[from] != 'd') hear(*sent[from]);
    };
    const std::size_t leader = phase_ == Phase::kSecondLeads ? 1 : 0;
    run(leader);
    if (phase_ != Phase::kTogether) deliver(leader);
    run(1 - leader);
    if (phase_ == Phase::kTogether) deliver(leader);
    deliver(1 - leader);
  }

  static std::array<std::int64_t, 2> Ages(const World& world) {
    return {world.boards[0].roles.memory().claim_age, world.boards[1].roles.memory().claim_age};
  }

  // The arbiter active_claims at the end of the period, and what must hold. `ages`: of the claims at its begin.
  void Judge(World& world, const std::array<std::int64_t, 2>& ages) {
    const auto claims = [&](std::size_t which) {
      const Board& board = world.boards[which];
      return board.command_age <= kCommandPeriods && board.roles.role() == Role::kActive;
    };
    const int before = world.source;
    const bool stays = before >= 0 && claims(static_cast<std::size_t>(before));
    const int in_force = stays ? before : claims(0) ? 0 : claims(1) ? 1 : -1;
    if (in_force >= 0 && in_force != before) {
      const bool excused = before < 0 || world.boards[static_cast<std::size_t>(before)].died_in_force;
      // No board can know which claim is in force when both began within one period.
      const std::int64_t elder_by =
          before < 0 ? 0
                     : ages[static_cast<std::size_t>(before)] + 1 -
                           world.boards[static_cast<std::size_t>(in_force)].roles.memory().claim_age;
      if (!excused && -1 <= elder_by && elder_by <= 1)
        ++found_.ties_count;
      else if (!excused && found_.switched.empty())
        found_.switched = Text(world.faults);
      world.source = in_force;
      Board& board = world.boards[static_cast<std::size_t>(in_force)];
      board.died_in_force = board.power != Power::kRuns;
    }
    const bool both = claims(0) && claims(1) && !world.cut && world.boards[0].power == Power::kRuns &&
                      world.boards[1].power == Power::kRuns;
    world.both_claim_periods = both ? std::min(world.both_claim_periods + 1, kDoubleClaimMax + 1) : 0;
    Note(world.both_claim_periods, kDoubleClaimMax, found_.double_of, found_.doubled, world);
    for (Board& board : world.boards) {
      const bool lost = in_force < 0 && board.power == Power::kRuns;
      board.lost_periods = lost ? std::min(board.lost_periods + 1, 40) : 0;
      const bool stood_by = before >= 0 && board.roles.memory().peer.has_value() && world.faults.count < 2;
      Note(board.lost_periods, stood_by ? kLostMax : kLostMaxAlone, found_.lost_of, found_.lost, world);
    }
  }
  static void Note(int value, int allowed, std::array<int, kFaultsMax + 1>& of, std::string& which,
                   const World& world) {
    int& largest = of[world.faults.count];
    largest = std::max(largest, value);
    if (value > allowed && which.empty()) which = Text(world.faults);
  }

  void Keep(World&& world) {
    Canonicalise(world);
    ++world.step;
    if (known_.insert(DigestOf(world)).second) waiting_[world.faults.count].push_back(std::move(world));
  }

  const Phase phase_;
  const std::size_t faults_max_;
  const Menu& menu_;
  const bool cuts_;
  std::array<std::vector<World>, kFaultsMax + 1> waiting_;  // to be explored, by the number of faults
  std::unordered_set<Digest, Digest::Low> known_;
  Findings found_;
};

const char* NameOf(Phase phase) {
  return phase == Phase::kTogether     ? "together"
         : phase == Phase::kFirstLeads ? "the first leads"
                                       : "the second leads";
}

// Prints the numbers, and expects that nothing was found that must not be.
void Explore(std::size_t faults_max, const Menu& menu, bool cuts) {
  for (const Phase phase : {Phase::kTogether, Phase::kFirstLeads, Phase::kSecondLeads}) {
    const Findings found = Exploration(phase, faults_max, menu, cuts).Run();
    std::printf("%s, up to %zu faults%s: %zu states, %zu periods; ", NameOf(phase), faults_max,
                cuts ? " and a line that is cut" : "", found.states_count, found.steps_count);
    std::printf("most periods, by faults, without control");
    for (std::size_t i = 0; i <= faults_max; ++i) std::printf(" %d", found.lost_of[i]);
    std::printf(", with two claims");
    for (std::size_t i = 0; i <= faults_max; ++i) std::printf(" %d", found.double_of[i]);
    std::printf("; switches between equally old claims %zu\n", found.ties_count);
    EXPECT_EQ(found.lost, "") << NameOf(phase) << ": control was lost for too long";
    EXPECT_EQ(found.doubled, "") << NameOf(phase) << ": two claims for too long";
    EXPECT_EQ(found.switched, "") << NameOf(phase) << ": a switch without a death";
    EXPECT_GT(found.states_count, 100'000U);
  }
}

TEST(FailoverExploration, FourFaults) { Explore(4, kFew, false); }

TEST(FailoverExploration, ThreeFaultsOfManyKinds) { Explore(3, kMany, false); }

TEST(FailoverExploration, ThreeFaultsAndALineThatIsCutFromTheBeginning) { Explore(3, kMany, true); }

}  // namespace
}  // namespace tiltproof::firmware
