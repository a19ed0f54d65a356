// Makes the vehicle's input from the commands of several clients. It acts between the actuator messages that the
// server has accepted and the plant's input.
//
//   Arbiter arbiter(scenario, {.hover = {10, 10}, .min = {0, 0}, .max = {30, 30}});
//   arbiter.Accept(client, time_ns, command);              // for each accepted actuator message, in order of time
//   const std::vector<double>& input = arbiter.Decide(time_ns).inputs;   // at each step boundary
//
// docs/redundancy.md defines each type as a formula. Decide() is a function of the messages and roles up to its time, and
// of the decision before. A message counts at the first boundary at or after its arrival. So a client also becomes silent
// at a boundary, whichever process decides. Times are simulation time, inputs in the order of the vehicle's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "harness/run/redundancy.h"
#include "harness/scenario/scenario.h"
#include "link/time.h"

namespace tiltproof::harness {

// Roles that a client tells (tiltproof_client_role).
enum class ClientRole : std::uint8_t { kStandby = 0, kActive = 1, kFailed = 2 };

class Arbiter {
 public:
  struct Inputs {
    std::vector<double> hover, min, max;
  };

  // Values of Choice::selected that are no client's place, and of the column arbiter_selected.
  static constexpr int kNobody =
      -1;  // no client's command is in force: the last input holds, or that of hover
  static constexpr int kTogether = -2;  // mid_value of two or more

  struct Choice {
    std::vector<double> inputs;
    int selected = kNobody;  // a client's place in the scenario, kNobody or kTogether
    std::vector<std::size_t> sources =
        {};                 // the clients whose commands made the inputs, in the scenario's order
    bool hover = false;     // the inputs are the vehicle's at hover, because two clients disagree
    bool disagree = false;  // duplex_compare: both clients are there, and not of one opinion
  };

  Arbiter(const Scenario& scenario, Inputs inputs);

  // True if this client's `start` is t = 0, when no earlier one was.
  bool MakesOrigin(std::size_t client) const {
    return spec_.type != ArbiterType::kSingle || client == fixed_;
  }
  // A message of the client was accepted. `command`: its inputs from now on.
  void Accept(std::size_t client, TimeNs now, std::span<const double> command);
  void SetRole(std::size_t client, std::uint32_t role) { clients_.at(client).role = role; }

  // Decides at a step boundary; `now` does not decrease.
  const Choice& Decide(TimeNs now);
  const Choice& choice() const { return choice_; }
  // True if the last Decide() put a message in force, or changed the inputs.
  bool has_new_command() const { return has_new_command_; }

  struct Event {
    std::string kind, text;
  };
  std::vector<Event> TakeEvents() { return std::exchange(events_, {}); }

  // Until `end`. None: the arbiter chooses nothing.
  std::optional<RedundancyTotals> Totals(TimeNs end);

 private:
  struct Client {
    std::vector<double> command;
    std::optional<TimeNs> first_ns, last_ns;  // of its accepted messages
    TimeNs run_begin_ns = 0;                  // the first of its messages since its last gap
    bool has_new = false;                     // since the last decision
    std::optional<std::uint32_t> role;

    bool is_in_first_run() const { return first_ns == run_begin_ns; }
  };

  bool IsFresh(std::size_t client, TimeNs now) const;
  bool Claims(std::size_t client, TimeNs now) const;
  // The choice of each type; the one before is choice_.
  Choice Choose(TimeNs now) const;
  std::optional<std::size_t> FirstOfOrder(TimeNs now) const;
  std::optional<std::size_t> Claimant(TimeNs now) const;
  Choice MidValue(TimeNs now) const;
  Choice Compare(TimeNs now) const;
  bool Agree() const;
  Choice Of(std::size_t client) const;
  Choice Held() const;

  void Count(TimeNs until);
  void NoteChange(const Choice& next, TimeNs now);
  bool IsSwitch(const Choice& next) const;
  std::string Describe(const Choice& choice) const;
  std::string WhyNot(const std::vector<std::size_t>& clients, TimeNs now) const;

  const ArbiterSpec spec_;
  const TimeNs timeout_ns_;
  const std::size_t fixed_;
  std::vector<std::size_t> order_;
  std::optional<std::size_t> on_disagreement_;  // none: hold or hover
  std::vector<std::string> ids_;
  const Inputs inputs_;
  const bool redundant_;
  std::vector<Client> clients_;

  Choice choice_;
  bool has_new_command_ = false;
  // The choice that made the input last; a pause in which the input holds does not change it.
  std::optional<Choice> source_;
  TimeNs counted_ns_ = 0;
  bool splits_ = false;  // two claim, since the last decision
  RedundancyTotals totals_;
  std::vector<Event> events_;
};

}  // namespace tiltproof::harness
