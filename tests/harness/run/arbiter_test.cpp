// Arbiters against a slow reference, which computes every decision anew from all messages so far, as docs/redundancy.md
// defines it.
#include "harness/run/arbiter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace tiltproof::harness {
namespace {

using ::testing::ElementsAre;

constexpr TimeNs kStep = 4 * kNsPerMs;
const Arbiter::Inputs kInputs = {.hover = {10, 0}, .min = {0, -2}, .max = {30, 2}};

Scenario ScenarioWith(std::size_t clients, ArbiterSpec spec) {
  Scenario scenario;
  for (std::size_t i = 0; i < clients; ++i)
    scenario.clients.push_back({.id = std::string(1, static_cast<char>('a' + i)), .firmware = ""});
  scenario.arbiter = std::move(spec);
  return scenario;
}

struct Message {
  TimeNs time_ns;
  std::size_t client;
  std::vector<double> command;
};
struct RoleTold {
  TimeNs time_ns;
  std::size_t client;
  std::uint32_t role;
};
// In order of time.
struct History {
  std::vector<Message> messages;
  std::vector<RoleTold> roles;
};

// Input in force from a boundary on. `sources`: the clients; kHoverSource stands for the input at hover.
constexpr std::size_t kHoverSource = 99;
struct Decision {
  std::vector<double> inputs;
  std::set<std::size_t> sources;
  bool disagree = false;
};

class Reference {
 public:
  Reference(const Scenario& scenario, const History& history) : scenario_(scenario), history_(history) {}

  // All boundaries from 0 to the one at `end`.
  void Run(TimeNs end) {
    std::vector<double> y = kInputs.hover;
    std::set<std::size_t> last;  // that made the input
    for (TimeNs t = 0; t <= end; t += kStep) {
      const Decision d = At(t, y, last);
      if (!d.sources.empty() && d.sources != last) {
        std::set<std::size_t> newcomers;  // whose first run this is, and who were not there
        for (const std::size_t c : d.sources)
          if (!last.contains(c) && c != kHoverSource && RunBegin(c, t) == Times(c, t).front())
            newcomers.insert(c);
        std::set<std::size_t> grown = last;
        grown.insert(newcomers.begin(), newcomers.end());
        const bool only_joined = scenario_.arbiter.type == ArbiterType::kMidValue && grown == d.sources;
        if (!last.empty() && !only_joined) {
          ++totals.switches_count;
          for (std::size_t i = 0; i < y.size(); ++i)
            totals.largest_bump = std::max(totals.largest_bump,
                                           std::abs(d.inputs[i] - y[i]) / (kInputs.max[i] - kInputs.min[i]));
        }
      }
      if (t < end) {
        const bool commanded = !history_.messages.empty() && history_.messages.front().time_ns <= t;
        if (commanded && (d.sources.empty() || d.sources.contains(kHoverSource)))
          totals.without_control_ns += kStep;
        if (d.disagree) *totals.disagreement_ns += kStep;
        if (Claimants(t).size() > 1) split_ns += kStep;
      }
      y = d.inputs;
      if (!d.sources.empty()) last = d.sources;
      decisions.push_back(d);
    }
  }

  std::vector<Decision> decisions;
  RedundancyTotals totals{.disagreement_ns = 0};
  TimeNs split_ns = 0;

 private:
  std::vector<TimeNs> Times(std::size_t c, TimeNs t) const {
    std::vector<TimeNs> times;
    for (const Message& m : history_.messages)
      if (m.client == c && m.time_ns <= t) times.push_back(m.time_ns);
    return times;
  }
  std::vector<double> Command(std::size_t c, TimeNs t) const {
    std::vector<double> command = kInputs.hover;
    for (const Message& m : history_.messages)
      if (m.client == c && m.time_ns <= t) command = m.command;
    return command;
  }
  bool Fresh(std::size_t c, TimeNs t) const {
    const auto times = Times(c, t);
    return std::any_of(times.begin(), times.end(),
                       [&](TimeNs a) { return a >= t - scenario_.arbiter_timeout_ns(); });
  }
  // The earliest message from which on no two neighbours are further apart than the timeout.
  TimeNs RunBegin(std::size_t c, TimeNs t) const {
    const auto times = Times(c, t);
    std::size_t begin = times.size() - 1;
    while (begin > 0 && times[begin] - times[begin - 1] <= scenario_.arbiter_timeout_ns()) --begin;
    return times[begin];
  }
  std::vector<std::size_t> FreshOnes(TimeNs t) const {
    std::vector<std::size_t> all;
    for (std::size_t c = 0; c < scenario_.client_count(); ++c)
      if (Fresh(c, t)) all.push_back(c);
    return all;
  }
  std::vector<std::size_t> Claimants(TimeNs t) const {
    std::vector<std::size_t> all;
    for (const std::size_t c : FreshOnes(t)) {
      std::uint32_t role = 0;
      for (const RoleTold& told : history_.roles)
        if (told.client == c && told.time_ns <= t) role = told.role;
      if (role == 1) all.push_back(c);
    }
    return all;
  }

  Decision At(TimeNs t, const std::vector<double>& y, const std::set<std::size_t>& last) const {
    const ArbiterSpec& spec = scenario_.arbiter;
    const auto of = [&](std::size_t c) { return Decision{Command(c, t), {c}}; };
    const std::vector<std::size_t> fresh = FreshOnes(t);
    switch (spec.type) {
      case ArbiterType::kSingle:
        return of(scenario_.selected_client());
      case ArbiterType::kPrimaryBackup: {
        std::vector<std::size_t> order;
        for (const std::string& id : spec.order) order.push_back(static_cast<std::size_t>(id[0] - 'a'));
        const auto place = [&](std::size_t c) {
          return std::find(order.begin(), order.end(), c) - order.begin();
        };
        for (const std::size_t c : order) {
          if (!Fresh(c, t)) continue;
          const bool goes_back = !last.empty() && place(c) < place(*last.begin());
          const bool first_of_all = c == order.front() && RunBegin(c, t) == Times(c, t).front();
          const bool long_enough =
              spec.return_ms && static_cast<double>(t - RunBegin(c, t)) >= *spec.return_ms * 1e6;
          if (!goes_back || first_of_all || long_enough) return of(c);
        }
        return {y, {}};
      }
      case ArbiterType::kActiveClaims: {
        const auto claimants = Claimants(t);
        if (claimants.empty()) return {y, {}};
        const bool stays = !last.empty() && std::ranges::find(claimants, *last.begin()) != claimants.end();
        return of(stays ? *last.begin() : claimants.front());
      }
      case ArbiterType::kMidValue: {
        if (fresh.empty()) return {y, {}};
        Decision d{y, {fresh.begin(), fresh.end()}};
        for (std::size_t i = 0; i < y.size(); ++i) {
          std::vector<double> values;
          for (const std::size_t c : fresh) values.push_back(Command(c, t)[i]);
          if (values.size() == 2) {
            d.inputs[i] = std::abs(values[1] - y[i]) < std::abs(values[0] - y[i]) ? values[1] : values[0];
            continue;
          }
          std::sort(values.begin(), values.end());
          const std::size_t n = values.size();
          d.inputs[i] = (values[(n - 1) / 2] + values[n / 2]) / 2;
        }
        return d;
      }
      case ArbiterType::kDuplexCompare: {
        if (fresh.empty()) return {y, {}};
        if (fresh.size() == 1) return of(fresh[0]);
        bool agree = true;
        for (std::size_t i = 0; i < y.size(); ++i)
          agree = agree && std::abs(Command(0, t)[i] - Command(1, t)[i]) <=
                               spec.tolerance_percent / 100 * (kInputs.max[i] - kInputs.min[i]);
        if (agree) return of(0);
        Decision d{y, {}};
        if (spec.on_disagreement == "hover") d = {kInputs.hover, {kHoverSource}};
        if (spec.on_disagreement == "a") d = of(0);
        if (spec.on_disagreement == "b") d = of(1);
        d.disagree = true;
        return d;
      }
    }
    return {y, {}};
  }

  const Scenario& scenario_;
  const History& history_;
};

// Clients that speak, fall silent and come back, some at the very ends of the timeout, and that agree more or less.
History RandomHistory(std::mt19937& random, std::size_t clients, TimeNs timeout_ns, TimeNs end) {
  History history;
  const auto draw = [&](int from, int to) {
    return from + static_cast<int>(random() % static_cast<unsigned>(to - from + 1));
  };
  for (std::size_t c = 0; c < clients; ++c) {
    TimeNs t = draw(0, 3) * kStep / 2;
    while (t < end) {
      history.messages.push_back({t, c, {10.0 + draw(-2, 2), 0.25 * draw(-2, 2)}});
      const int what = draw(0, 9);
      t += what == 0   ? timeout_ns
           : what == 1 ? timeout_ns + 1
           : what == 2 ? timeout_ns * draw(1, 4) + draw(0, 9) * kNsPerMs
                       : 12 * kNsPerMs - draw(0, 1) * 100'000;
    }
    for (TimeNs at = 0; at < end; at += 12 * kNsPerMs * draw(1, 8))
      history.roles.push_back({at, c, static_cast<std::uint32_t>(draw(0, 2))});
  }
  const auto by_time = [](const auto& a, const auto& b) { return a.time_ns < b.time_ns; };
  std::stable_sort(history.messages.begin(), history.messages.end(), by_time);
  std::stable_sort(history.roles.begin(), history.roles.end(), by_time);
  return history;
}

struct Flown {
  std::vector<Arbiter::Choice> choices;
  std::vector<bool> new_commands;
  std::map<std::string, std::int64_t> events;
  std::optional<RedundancyTotals> totals;
};

Flown FlyBy(const Scenario& scenario, const History& history, TimeNs end) {
  Arbiter arbiter(scenario, kInputs);
  Flown flown;
  auto message = history.messages.begin();
  auto role = history.roles.begin();
  for (TimeNs t = 0; t <= end; t += kStep) {
    for (; message != history.messages.end() && message->time_ns <= t; ++message)
      arbiter.Accept(message->client, message->time_ns, message->command);
    for (; role != history.roles.end() && role->time_ns <= t; ++role)
      arbiter.SetRole(role->client, role->role);
    flown.choices.push_back(arbiter.Decide(t));
    flown.new_commands.push_back(arbiter.has_new_command());
    for (const Arbiter::Event& event : arbiter.TakeEvents()) ++flown.events[event.kind];
  }
  flown.totals = arbiter.Totals(end);
  return flown;
}

void ExpectAsReference(const Scenario& scenario, std::mt19937& random, int histories_count) {
  constexpr TimeNs kEnd = 500 * kStep;
  bool switched = false, lost = false;
  for (int i = 0; i < histories_count; ++i) {
    const History history =
        RandomHistory(random, scenario.client_count(), scenario.arbiter_timeout_ns(), kEnd);
    Reference reference(scenario, history);
    reference.Run(kEnd);
    const Flown flown = FlyBy(scenario, history, kEnd);
    ASSERT_EQ(flown.choices.size(), reference.decisions.size());
    for (std::size_t k = 0; k < flown.choices.size(); ++k) {
      const Arbiter::Choice& choice = flown.choices[k];
      const Decision& expected = reference.decisions[k];
      ASSERT_EQ(choice.inputs, expected.inputs) << Name(scenario.arbiter.type) << " boundary " << k;
      std::set<std::size_t> sources(choice.sources.begin(), choice.sources.end());
      if (choice.hover) sources.insert(kHoverSource);
      ASSERT_EQ(sources, expected.sources) << Name(scenario.arbiter.type) << " boundary " << k;
      ASSERT_EQ(choice.disagree, expected.disagree);
      ASSERT_EQ(choice.selected, choice.sources.size() == 1  ? static_cast<int>(choice.sources[0])
                                 : choice.sources.size() > 1 ? Arbiter::kTogether
                                                             : Arbiter::kNobody);
    }
    ASSERT_TRUE(flown.totals);
    EXPECT_EQ(flown.totals->switches_count, reference.totals.switches_count);
    EXPECT_EQ(flown.totals->without_control_ns, reference.totals.without_control_ns);
    EXPECT_DOUBLE_EQ(flown.totals->largest_bump, reference.totals.largest_bump);
    EXPECT_EQ(flown.totals->split_brain_ns, reference.split_ns);
    if (scenario.arbiter.type == ArbiterType::kDuplexCompare)
      EXPECT_EQ(flown.totals->disagreement_ns, reference.totals.disagreement_ns);
    else
      EXPECT_FALSE(flown.totals->disagreement_ns);
    const auto switches = flown.events.find("arbiter_switched");
    EXPECT_EQ(switches == flown.events.end() ? 0 : switches->second, reference.totals.switches_count);
    switched |= reference.totals.switches_count > 0;
    lost |= reference.totals.without_control_ns > 0;
  }
  EXPECT_TRUE(switched);
  EXPECT_TRUE(lost);
}

TEST(Arbiter, PrimaryBackupIsAsDefined) {
  std::mt19937 random(1);
  for (const std::optional<double> return_ms : {std::optional<double>(), {0.0}, {60.0}})
    for (const std::vector<std::string>& order :
         {std::vector<std::string>{"a", "b"}, {"c", "a", "b"}, {"b", "c"}})
      ExpectAsReference(ScenarioWith(3, {.type = ArbiterType::kPrimaryBackup,
                                         .timeout_ms = 36,
                                         .order = order,
                                         .return_ms = return_ms}),
                        random, 15);
}

TEST(Arbiter, ActiveClaimsIsAsDefined) {
  std::mt19937 random(2);
  for (const std::size_t clients : {2U, 3U})
    ExpectAsReference(ScenarioWith(clients, {.type = ArbiterType::kActiveClaims, .timeout_ms = 30}), random,
                      30);
}

TEST(Arbiter, MidValueIsAsDefined) {
  std::mt19937 random(3);
  for (const std::size_t clients : {2U, 3U, 4U, 5U})
    ExpectAsReference(ScenarioWith(clients, {.type = ArbiterType::kMidValue, .timeout_ms = 24}), random, 20);
}

TEST(Arbiter, DuplexCompareIsAsDefined) {
  std::mt19937 random(4);
  for (const char* what : {"hold", "hover", "a", "b"})
    ExpectAsReference(ScenarioWith(2, {.type = ArbiterType::kDuplexCompare,
                                       .timeout_ms = 36,
                                       .tolerance_percent = 10,
                                       .on_disagreement = what}),
                      random, 20);
}

// A command counts up to an age of exactly the timeout.
TEST(Arbiter, AClientCountsUntilItsCommandIsOlderThanTheTimeout) {
  const Scenario scenario = ScenarioWith(2, {.type = ArbiterType::kPrimaryBackup, .timeout_ms = 8});
  for (const TimeNs late_ns : {TimeNs{0}, TimeNs{1}}) {
    Arbiter arbiter(scenario, kInputs);
    arbiter.Accept(0, kStep - late_ns, kInputs.hover);
    EXPECT_EQ(arbiter.Decide(kStep).selected, 0);
    EXPECT_EQ(arbiter.Decide(2 * kStep).selected, 0);
    EXPECT_EQ(arbiter.Decide(3 * kStep).selected, late_ns == 0 ? 0 : Arbiter::kNobody);
  }
}

// The first in order is not held back when it speaks up for the first time; after a gap, `never` is for good.
TEST(Arbiter, NeverHoldsBackOnlyOneThatWasLost) {
  const Scenario scenario = ScenarioWith(2, {.type = ArbiterType::kPrimaryBackup, .timeout_ms = 36});
  Arbiter arbiter(scenario, kInputs);
  const auto fly = [&](TimeNs from_ms, TimeNs to_ms, const std::vector<std::size_t>& speak) {
    int selected = Arbiter::kNobody;
    for (TimeNs ms = from_ms; ms < to_ms; ms += 4) {
      for (const std::size_t client : speak) arbiter.Accept(client, ms * kNsPerMs, kInputs.hover);
      selected = arbiter.Decide(ms * kNsPerMs).selected;
    }
    return selected;
  };
  EXPECT_EQ(fly(0, 40, {1}), 1);
  EXPECT_EQ(fly(40, 80, {0, 1}), 0);
  EXPECT_EQ(fly(80, 160, {1}), 1);
  EXPECT_EQ(fly(160, 1000, {0, 1}), 1);
  EXPECT_EQ(fly(1000, 1100, {0}), Arbiter::kNobody) << "it would be a way back";
}

// `single` is a wire: what its client says is the input, however old.
TEST(Arbiter, SingleTakesOneClient) {
  const Scenario scenario = ScenarioWith(2, {.client = "b"});
  Arbiter arbiter(scenario, kInputs);
  EXPECT_EQ(arbiter.Decide(0).inputs, kInputs.hover);
  EXPECT_FALSE(arbiter.has_new_command());
  arbiter.Accept(0, 1, std::vector<double>{1, 1});
  EXPECT_EQ(arbiter.Decide(kStep).inputs, kInputs.hover);
  arbiter.Accept(1, kStep, std::vector<double>{2, 2});
  EXPECT_THAT(arbiter.Decide(kStep).inputs, ElementsAre(2, 2));
  EXPECT_TRUE(arbiter.has_new_command());
  EXPECT_THAT(arbiter.Decide(kNsPerS).inputs, ElementsAre(2, 2));
  EXPECT_FALSE(arbiter.has_new_command());
  EXPECT_EQ(arbiter.choice().selected, 1);
  EXPECT_FALSE(arbiter.MakesOrigin(0));
  EXPECT_TRUE(arbiter.MakesOrigin(1));
  EXPECT_FALSE(arbiter.Totals(kNsPerS));
}

}  // namespace
}  // namespace tiltproof::harness
