#include "harness/scenario/fault_keys.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "faults/registry.h"
#include "faults/signal_choice.h"

namespace tiltproof::harness {
namespace {

using faults::Bound;
using faults::Edge;
using faults::FaultSpec;
using faults::FaultType;
using faults::ParameterInfo;
using faults::ParameterKind;
using faults::ParameterValue;
using faults::Target;

const std::vector<Alternative>& Types() {
  static const std::vector<Alternative> types = [] {
    std::vector<Alternative> all;
    for (const FaultType& type : faults::FaultTypes()) all.push_back({type.name, type.summary});
    return all;
  }();
  return types;
}

// A text as the registry takes it.
constexpr TextRule kParameterText = {"[!-~]([ -~]*[!-~])?", "printable ASCII, without blanks at its ends",
                                     faults::kParameterTextMax};

// Likewise the name of a signal; scenario_checks.h looks for it in the vehicle's tables.
constexpr TextRule kSignalName = {"[A-Za-z][A-Za-z0-9_]*", "letters, digits and '_', beginning with a letter",
                                  faults::kSignalNameMax};

// The registry says which word is wrong, and why.
constexpr TextRule kFrameWords = {"", "", faults::kFrameWordsTextMax};

// Targets, and lines between boards with their ends.
constexpr TextRule kTargetRule = {"[A-Za-z0-9_]+", "letters, digits and '_'", 100};

// For faults on the wire and at the receiver.
void DescribeTarget(KeyVisitor& v, const FaultType& type, FaultSpec& fault) {
  std::vector<Target> targets = faults::AcceptedTargets(type);
  std::erase(targets, Target::kNone);
  std::vector<std::string_view> words;
  for (const Target target : targets) words.push_back(Name(target));
  std::string text = fault.line.empty() ? "" : faults::TargetText(fault);
  if (const Target resolved = faults::ResolvedTarget(fault, type);
      fault.line.empty() && std::find(targets.begin(), targets.end(), resolved) != targets.end())
    text = Name(resolved);
  const std::string before = text;
  v.WordOrName({"target",
                "Line and direction on which the fault acts; a line between boards by its id, or one way as "
                "ID_to_CLIENT",
                type.default_target() ? Presence::kOptional : Presence::kRequired},
               words, text, kTargetRule);
  const auto found = std::find(words.begin(), words.end(), text);
  if (text.empty() || found != words.end()) {
    fault.target = targets[text.empty() ? 0 : static_cast<std::size_t>(found - words.begin())];
    fault.line = fault.line_end = "";
  } else if (text != before) {
    fault.line = text;
    fault.line_end = "";
    fault.target = Target::kNone;  // until the scenario's lines are known
  }
}

// A name of the protocol's; scenario_checks.h looks for it there.
constexpr TextRule kMessageName = {"[A-Za-z][A-Za-z0-9_]*",
                                   "letters, digits and '_', beginning with a letter", 64};

void DescribeMessage(KeyVisitor& v, FaultSpec& fault) {
  v.Text(
      {"message",
       "Only frames of this message of the protocol; absent: all. In the shipped protocols: start, request "
       "(also called sensors), actuators, reply, reference"},
      fault.message, kMessageName);
}

void DescribeClientOf(KeyVisitor& v, const FaultType& type, FaultSpec& fault) {
  const Key key = {"client", "With several clients: the one on which the fault acts; absent: all"};
  if (type.is_of_client())
    v.Text(key, fault.client, kClientRule);
  else
    v.Refuse({"client", "a fault of this type acts on the vehicle, not on a client"});
}

// A missing value begins as the default, or as the registry's example when there is no default.
void DescribeParameter(KeyVisitor& v, const ParameterInfo& info, FaultSpec& fault) {
  const Key key = {info.name, info.doc, info.default_value ? Presence::kOptional : Presence::kRequired};
  ParameterValue& value =
      fault.parameters.try_emplace(std::string(info.name), info.default_value.value_or(info.example))
          .first->second;
  switch (info.kind) {
    case ParameterKind::kNumber: {
      if (auto* number = std::get_if<double>(&value)) v.Number(key, *number, {info.min, info.max});
      break;
    }
    case ParameterKind::kInteger: {
      if (auto* number = std::get_if<double>(&value)) {
        std::int64_t integer = std::llround(*number);
        v.Integer(key, integer, {info.min, info.max});
        *number = static_cast<double>(integer);
      }
      break;
    }
    case ParameterKind::kChoice: {
      auto* word = std::get_if<std::string>(&value);
      if (word == nullptr) break;
      const auto found = std::find(info.choices.begin(), info.choices.end(), *word);
      std::optional<std::size_t> index;
      if (found != info.choices.end()) index = static_cast<std::size_t>(found - info.choices.begin());
      v.Choice(key, info.choices, index);
      if (index) *word = info.choices[*index];
      break;
    }
    case ParameterKind::kVector: {
      if (auto* vector = std::get_if<std::array<double, 3>>(&value))
        v.Point(key, *vector, {info.min, info.max});
      break;
    }
    case ParameterKind::kField:
    case ParameterKind::kRotor:
    case ParameterKind::kJoint:
    case ParameterKind::kText: {
      if (auto* text = std::get_if<std::string>(&value)) v.Text(key, *text, kParameterText);
      break;
    }
    case ParameterKind::kFrameWords: {
      if (auto* text = std::get_if<std::string>(&value)) v.Text(key, *text, kFrameWords);
      break;
    }
    case ParameterKind::kSensor:
    case ParameterKind::kSensorOrAll:
    case ParameterKind::kPositionSensor:
    case ParameterKind::kSensorVector:
    case ParameterKind::kInput: {
      if (auto* text = std::get_if<std::string>(&value)) v.Text(key, *text, kSignalName);
      break;
    }
  }
}

constexpr double kWindowMax_s = 86400;

// The ends of the window, as far as the type has them.
void DescribeWindow(KeyVisitor& v, const FaultType& type, FaultSpec& fault) {
  const double min_s = type.is_command() ? 0 : -1000;
  const auto describe = [&](Key key, Bound bound, std::string_view why_not, TimeNs& time_ns) {
    if (bound == Bound::kRefused) {
      key.doc = why_not;
      v.Refuse(key);
    } else {
      key.presence = bound == Bound::kRequired ? Presence::kRequired : Presence::kOptional;
      v.Seconds(key, time_ns, {min_s, kWindowMax_s});
    }
  };
  describe({"start_s", "Begin of the window; absent: power-on"}, type.start,
           "a fault of this type lasts the whole flight", fault.start_ns);
  describe({"end_s", "End of the window, exclusive; absent: never"}, type.end,
           type.start == Bound::kRefused ? "a fault of this type lasts the whole flight"
                                         : "a fault of this type has a begin only",
           fault.end_ns);
}

// A command is given once, whatever passes.
void RefuseTrigger(KeyVisitor& v, const FaultType& type) {
  for (const std::string_view key : {"target", "message", "every_nth_count", "probability"})
    v.Refuse({key, type.IsOneOf<faults::NodeKind>() ? "a fault on a node has no target and no trigger"
                   : type.IsOneOf<faults::ClockKind>()
                       ? "a fault on a clock has no target and no trigger"
                       : "a fault on the device has no target and no trigger"});
}

// Periods divide the window, so faults that have no begin have no period either.
void DescribePeriod(KeyVisitor& v, const FaultType& type, FaultSpec& fault) {
  Key period = {
      "period_s",
      "The fault is active in the first part of each period, counted from start_s; absent: throughout the "
      "window"};
  Key duty = {"duty", "Share of the period in which the fault is active"};
  const bool happens_once = type.happens_once();
  if (type.start == Bound::kRefused || happens_once) {
    period.doc = duty.doc = type.start == Bound::kRefused
                                ? "a fault of this type lasts the whole flight"
                                : "a fault of this type happens once: add a fault for each further time";
    v.Refuse(period);
    v.Refuse(duty);
    return;
  }
  v.Seconds(period, fault.period_ns, {1e-6, kWindowMax_s});
  v.MaybeNumber(duty, fault.duty, {1e-6, 1});
}

constexpr TextRule kCondition = {};

void DescribeWaiting(KeyVisitor& v, FaultSpec& fault) {
  v.Text({"when",
          "Condition on the flight for the fault to be active: comparisons of signals with and, or, not"},
         fault.when, kCondition);
  constexpr std::array kEdges = {Edge::kLevel, Edge::kRising};
  constexpr std::array<std::string_view, 2> kWords = {"level", "rising"};
  std::optional<std::size_t> index;
  if (!fault.when.empty() || fault.edge != Edge::kLevel) index = fault.edge == Edge::kRising ? 1 : 0;
  v.Choice(
      {"edge",
       "level (default): active while `when` holds; rising: from where it turns true to the window's end"},
      kWords, index);
  fault.edge = kEdges[index.value_or(0)];
  v.MaybeSection(
      {"after", "The window opens some time after another fault's first activation"}, fault.after.has_value(),
      [&](KeyVisitor& w) {
        if (!fault.after) fault.after.emplace();
        w.Text({"fault", "Id of the other fault", Presence::kRequired}, fault.after->fault, kNameRule);
        w.Seconds({"delay_s", "Time from that activation to the opening"}, fault.after->delay_ns,
                  {0, kWindowMax_s});
      });
}

// A command is planned before the flight.
void RefuseWaiting(KeyVisitor& v) {
  for (const std::string_view key : {"when", "edge", "after"})
    v.Refuse({key, "a fault of this type is a command, planned before the flight"});
}

void DescribeTrigger(KeyVisitor& v, FaultSpec& fault) {
  v.Integer({"every_nth_count", "Pick only every n-th frame, sample or byte in the window"},
            fault.every_nth_count, {1, 1e9});
  v.Number({"probability", "Act on a picked one with this probability"}, fault.probability, {0, 1});
}

}  // namespace

void DescribeFault(KeyVisitor& v, FaultSpec& fault) {
  v.Text({"id", "Unique in the scenario; names its random stream", Presence::kRequired}, fault.id, kNameRule);
  const auto found = std::find_if(Types().begin(), Types().end(),
                                  [&](const Alternative& type) { return type.word == fault.type; });
  std::optional<std::size_t> index;
  if (found != Types().end()) index = static_cast<std::size_t>(found - Types().begin());
  v.Alternatives({.name = "type",
                  .doc = "What kind of fault; `tiltproof faults` lists them",
                  .presence = Presence::kRequired,
                  .why_no_longer = faults::WhyNoLonger},
                 Types(), index, [&](KeyVisitor& w, std::size_t chosen) {
                   const FaultType& type = faults::FaultTypes()[chosen];
                   if (fault.type != type.name) fault.parameters.clear();
                   fault.type = type.name;
                   if (type.has_target()) DescribeTarget(w, type, fault);
                   DescribeClientOf(w, type, fault);
                   if (type.IsOneOf<faults::WireKind>()) DescribeMessage(w, fault);
                   const bool some_required =
                       std::any_of(type.parameters.begin(), type.parameters.end(),
                                   [](const ParameterInfo& info) { return !info.default_value; });
                   w.Section({"parameters", "The parameters of this type of fault",
                              some_required ? Presence::kRequired : Presence::kOptional},
                             [&](KeyVisitor& p) {
                               for (const ParameterInfo& info : type.parameters)
                                 DescribeParameter(p, info, fault);
                             });
                   DescribeWindow(w, type, fault);
                   DescribePeriod(w, type, fault);
                   if (type.is_command()) {
                     RefuseWaiting(w);
                     RefuseTrigger(w, type);
                   } else {
                     DescribeWaiting(w, fault);
                     DescribeTrigger(w, fault);
                   }
                 });
}

void DescribeCompound(KeyVisitor& v, Compound& compound) {
  v.Text({"id", "Unique among the faults' ids, for people", Presence::kRequired}, compound.id, kNameRule);
  v.Seconds({"start_s", "start_s of each member that states none and can have one"}, compound.start_ns,
            {-1000, kWindowMax_s});
  v.Seconds({"end_s", "end_s of each member that states none and can have one"}, compound.end_ns,
            {-1000, kWindowMax_s});
}

}  // namespace tiltproof::harness
