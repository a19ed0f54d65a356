#include "harness/run/arbiter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "link/check.h"

namespace tiltproof::harness {

Arbiter::Arbiter(const Scenario& scenario, Inputs inputs)
    : spec_(scenario.arbiter),
      timeout_ns_(scenario.arbiter_timeout_ns()),
      fixed_(scenario.selected_client()),
      inputs_(std::move(inputs)),
      redundant_(scenario.is_redundant()),
      clients_(scenario.client_count()) {
  for (std::size_t client = 0; client < clients_.size(); ++client) {
    ids_.push_back(scenario.client_id(client));
    clients_[client].command = inputs_.hover;
    if (spec_.order.empty()) order_.push_back(client);
  }
  for (const std::string& id : spec_.order)
    if (const auto client = scenario.FindClient(id)) order_.push_back(*client);
  if (spec_.on_disagreement != kHoldInput && spec_.on_disagreement != kHoverInput)
    on_disagreement_ = scenario.FindClient(spec_.on_disagreement);
  choice_.inputs = inputs_.hover;
  if (spec_.type == ArbiterType::kSingle) choice_.selected = static_cast<int>(fixed_);
  if (spec_.type == ArbiterType::kDuplexCompare) totals_.disagreement_ns = 0;
}

void Arbiter::Accept(std::size_t client, TimeNs now, std::span<const double> command) {
  Client& own = clients_.at(client);
  if (!own.last_ns || now - *own.last_ns > timeout_ns_) own.run_begin_ns = now;
  if (!own.first_ns) own.first_ns = now;
  own.last_ns = now;
  own.command.assign(command.begin(), command.end());
  own.has_new = true;
}

bool Arbiter::IsFresh(std::size_t client, TimeNs now) const {
  const Client& own = clients_[client];
  return own.last_ns && now - *own.last_ns <= timeout_ns_;
}

bool Arbiter::Claims(std::size_t client, TimeNs now) const {
  return clients_[client].role == static_cast<std::uint32_t>(ClientRole::kActive) && IsFresh(client, now);
}

const Arbiter::Choice& Arbiter::Decide(TimeNs now) {
  if (spec_.type == ArbiterType::kSingle) {
    has_new_command_ = std::exchange(clients_[fixed_].has_new, false);
    if (has_new_command_) choice_.inputs = clients_[fixed_].command;
    return choice_;
  }
  Count(now);
  Choice next = Choose(now);
  has_new_command_ = next.inputs != choice_.inputs;
  for (const std::size_t client : next.sources) has_new_command_ |= clients_[client].has_new;
  for (Client& client : clients_) client.has_new = false;
  NoteChange(next, now);
  std::size_t claims_count = 0;
  for (std::size_t client = 0; client < clients_.size(); ++client)
    claims_count += Claims(client, now) ? 1 : 0;
  splits_ = claims_count > 1;
  if (!next.sources.empty() || next.hover) source_ = next;
  choice_ = std::move(next);
  return choice_;
}

Arbiter::Choice Arbiter::Choose(TimeNs now) const {
  const auto of = [this](std::optional<std::size_t> client) { return client ? Of(*client) : Held(); };
  switch (spec_.type) {
    case ArbiterType::kSingle:
      break;
    case ArbiterType::kPrimaryBackup:
      return of(FirstOfOrder(now));
    case ArbiterType::kActiveClaims:
      return of(Claimant(now));
    case ArbiterType::kMidValue:
      return MidValue(now);
    case ArbiterType::kDuplexCompare:
      return Compare(now);
  }
  return Held();
}

std::optional<std::size_t> Arbiter::FirstOfOrder(TimeNs now) const {
  bool before_that_in_force = source_.has_value();
  for (const std::size_t client : order_) {
    if (source_ && source_->sources.front() == client) before_that_in_force = false;
    if (!IsFresh(client, now)) continue;
    const Client& own = clients_[client];
    const bool was_never_lost = client == order_.front() && own.is_in_first_run();
    const bool returns =
        spec_.return_ms && static_cast<double>(now - own.run_begin_ns) >= *spec_.return_ms * 1e6;
    if (!before_that_in_force || was_never_lost || returns) return client;
  }
  return std::nullopt;
}

std::optional<std::size_t> Arbiter::Claimant(TimeNs now) const {
  if (source_ && Claims(source_->sources.front(), now)) return source_->sources.front();
  for (std::size_t client = 0; client < clients_.size(); ++client)
    if (Claims(client, now)) return client;
  return std::nullopt;
}

Arbiter::Choice Arbiter::MidValue(TimeNs now) const {
  std::vector<std::size_t> fresh;
  for (std::size_t client = 0; client < clients_.size(); ++client)
    if (IsFresh(client, now)) fresh.push_back(client);
  if (fresh.empty()) return Held();
  if (fresh.size() == 1) return Of(fresh.front());
  Choice choice = Held();
  choice.selected = kTogether;
  choice.sources = fresh;
  std::vector<double> values(fresh.size());
  for (std::size_t input = 0; input < choice.inputs.size(); ++input) {
    for (std::size_t i = 0; i < fresh.size(); ++i) values[i] = clients_[fresh[i]].command[input];
    double& in_force = choice.inputs[input];
    if (values.size() == 2) {
      in_force = std::abs(values[1] - in_force) < std::abs(values[0] - in_force) ? values[1] : values[0];
      continue;
    }
    std::sort(values.begin(), values.end());
    const double upper = values[values.size() / 2];
    in_force = values.size() % 2 == 1 ? upper : (values[values.size() / 2 - 1] + upper) / 2;
  }
  return choice;
}

Arbiter::Choice Arbiter::Compare(TimeNs now) const {
  Check(clients_.size() == 2, "two clients are compared");
  const bool first = IsFresh(0, now), second = IsFresh(1, now);
  if (!first || !second) return first ? Of(0) : second ? Of(1) : Held();
  if (Agree()) return Of(0);
  Choice choice = on_disagreement_ ? Of(*on_disagreement_) : Held();
  choice.disagree = true;
  if (spec_.on_disagreement == kHoverInput) {
    choice.inputs = inputs_.hover;
    choice.hover = true;
  }
  return choice;
}

bool Arbiter::Agree() const {
  for (std::size_t input = 0; input < inputs_.hover.size(); ++input) {
    const double allowed = spec_.tolerance_percent / 100 * (inputs_.max[input] - inputs_.min[input]);
    if (!(std::abs(clients_[0].command[input] - clients_[1].command[input]) <= allowed)) return false;
  }
  return true;
}

Arbiter::Choice Arbiter::Of(std::size_t client) const {
  return {.inputs = clients_[client].command, .selected = static_cast<int>(client), .sources = {client}};
}

Arbiter::Choice Arbiter::Held() const { return {.inputs = choice_.inputs}; }

// A client that joins the others with its very first message is no switch.
bool Arbiter::IsSwitch(const Choice& next) const {
  if (!source_ || (next.sources.empty() && !next.hover)) return false;
  if (source_->sources == next.sources && source_->hover == next.hover) return false;
  if (spec_.type != ArbiterType::kMidValue) return true;
  const auto& before = source_->sources;
  return !std::ranges::includes(next.sources, before) ||
         std::ranges::any_of(next.sources, [&](std::size_t client) {
           return !std::ranges::binary_search(before, client) && !clients_[client].is_in_first_run();
         });
}

void Arbiter::NoteChange(const Choice& next, TimeNs now) {
  const bool is_switch = IsSwitch(next);
  if (is_switch) {
    double bump = 0;
    for (std::size_t input = 0; input < next.inputs.size(); ++input) {
      const double range = inputs_.max[input] - inputs_.min[input];
      const double step = std::abs(next.inputs[input] - choice_.inputs[input]);
      if (range > 0 && std::isfinite(range)) bump = std::max(bump, step / range);
    }
    ++totals_.switches_count;
    totals_.largest_bump = std::max(totals_.largest_bump, bump);
    std::vector<std::size_t> gone;
    for (const std::size_t client : source_->sources)
      if (std::ranges::find(next.sources, client) == next.sources.end()) gone.push_back(client);
    const std::string why = WhyNot(gone, now);
    events_.push_back(
        {"arbiter_switched",
         fmt::format("{} instead of {}{}{}; the largest step of an input is {:.3g} % of its range",
                     Describe(next), Describe(*source_), why.empty() ? "" : ": ", why, 100 * bump)});
  }
  if (next.disagree && !choice_.disagree)
    events_.push_back({"arbiter_disagreement", fmt::format("{} and {} disagree", ids_[0], ids_[1])});
  if (!next.disagree && choice_.disagree) events_.push_back({"arbiter_agreement", "they no longer disagree"});
  const bool was_lost = source_ && choice_.selected == kNobody && !choice_.disagree;
  const bool is_lost = source_ && next.selected == kNobody && !next.disagree;
  if (is_lost && !was_lost)
    events_.push_back(
        {"arbiter_lost", "no client qualifies, and the last input holds: " + WhyNot(source_->sources, now)});
  if (was_lost && !is_lost && !is_switch)
    events_.push_back({"arbiter_regained", fmt::format("{} again", Describe(next))});
}

std::string Arbiter::Describe(const Choice& choice) const {
  if (choice.hover) return "the input at hover";
  std::string text;
  for (const std::size_t client : choice.sources) text += (text.empty() ? "" : ", ") + ids_[client];
  return text;
}

// Reasons that these clients do not count.
std::string Arbiter::WhyNot(const std::vector<std::size_t>& clients, TimeNs now) const {
  std::vector<std::string> reasons;
  for (const std::size_t client : clients) {
    const Client& own = clients_[client];
    if (!IsFresh(client, now))
      reasons.push_back(fmt::format("the last command of {} is {:.6g} ms old", ids_[client],
                                    ToSeconds(now - own.last_ns.value_or(0)) * 1e3));
    else if (spec_.type == ArbiterType::kActiveClaims)
      reasons.push_back(own.role ? fmt::format("{} tells role {}", ids_[client], *own.role)
                                 : fmt::format("{} tells no role", ids_[client]));
  }
  return fmt::format("{}", fmt::join(reasons, ", "));
}

void Arbiter::Count(TimeNs until) {
  const TimeNs passed_ns = std::max<TimeNs>(until - counted_ns_, 0);
  counted_ns_ = std::max(counted_ns_, until);
  if (!redundant_ || passed_ns == 0) return;
  const bool commanded = std::ranges::any_of(clients_, [&](const Client& client) {
    return client.first_ns && *client.first_ns <= until - passed_ns;
  });
  if (choice_.selected == kNobody && commanded) totals_.without_control_ns += passed_ns;
  if (choice_.disagree) *totals_.disagreement_ns += passed_ns;
  if (std::ranges::any_of(clients_, [](const Client& client) { return client.role.has_value(); })) {
    if (!totals_.split_brain_ns) totals_.split_brain_ns = 0;
    if (splits_) *totals_.split_brain_ns += passed_ns;
  }
}

std::optional<RedundancyTotals> Arbiter::Totals(TimeNs end) {
  Count(end);
  if (!redundant_) return std::nullopt;
  return totals_;
}

}  // namespace tiltproof::harness
