#include "harness/scenario/fault_keys.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "faults/registry.h"

namespace tiltproof::harness {
namespace {

using faults::Bound;
using faults::FaultSpec;
using faults::FaultType;
using faults::ParameterInfo;
using faults::ParameterKind;
using faults::ParameterValue;
using faults::Target;
using link::MessageKind;

constexpr std::array kMessages = {MessageKind::kStart, MessageKind::kSensors, MessageKind::kActuators,
                                  MessageKind::kReply, MessageKind::kReference};

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

// For faults on the wire and at the receiver.
void DescribeTarget(KeyVisitor& v, const FaultType& type, FaultSpec& fault) {
  std::vector<Target> targets = faults::AcceptedTargets(type);
  std::erase(targets, Target::kNone);
  std::vector<std::string_view> words;
  for (const Target target : targets) words.push_back(Name(target));
  const Target resolved = faults::ResolvedTarget(fault, type);
  const auto found = std::find(targets.begin(), targets.end(), resolved);
  std::optional<std::size_t> index;
  if (found != targets.end()) index = static_cast<std::size_t>(found - targets.begin());
  v.Choice({"target", "The line and direction it stands in",
            type.default_target ? Presence::kOptional : Presence::kRequired},
           words, index);
  fault.target = targets[index.value_or(0)];
}

void DescribeMessage(KeyVisitor& v, FaultSpec& fault) {
  std::array<std::string_view, kMessages.size()> words;
  std::optional<std::size_t> index;
  for (std::size_t i = 0; i < kMessages.size(); ++i) {
    words[i] = Name(kMessages[i]);
    if (fault.message == kMessages[i]) index = i;
  }
  v.Choice({"message", "Frames of this kind alone; absent: all"}, words, index);
  if (index) fault.message = kMessages[*index];
}

// What is not there yet begins as the default, or as the registry's example when there is none.
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
    case ParameterKind::kText: {
      if (auto* text = std::get_if<std::string>(&value)) v.Text(key, *text, kParameterText);
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
  describe({"start_s", "The window begins; absent: at power-on"}, type.start,
           "a fault of this type lasts the whole flight", fault.start_ns);
  describe({"end_s", "The window ends, itself outside; absent: never"}, type.end,
           type.start == Bound::kRefused ? "a fault of this type lasts the whole flight"
                                         : "a fault of this type has a begin only",
           fault.end_ns);
}

// A command is given once, whatever passes.
void RefuseTrigger(KeyVisitor& v, const FaultType& type) {
  for (const std::string_view key : {"target", "message", "every_nth_count", "probability"})
    v.Refuse({key, type.on_node ? "a fault on a node has no target and no trigger"
                                : "a fault on the device has no target and no trigger"});
}

void DescribeTrigger(KeyVisitor& v, FaultSpec& fault) {
  v.Integer({"every_nth_count", "Of the frames, samples or bytes in the window, only every so many"},
            fault.every_nth_count, {1, 1e9});
  v.Number({"probability", "Then with this probability"}, fault.probability, {0, 1});
}

}  // namespace

void DescribeFault(KeyVisitor& v, FaultSpec& fault) {
  v.Text({"id", "Unique in the scenario; names its random stream", Presence::kRequired}, fault.id, kNameRule);
  const auto found = std::find_if(Types().begin(), Types().end(),
                                  [&](const Alternative& type) { return type.word == fault.type; });
  std::optional<std::size_t> index;
  if (found != Types().end()) index = static_cast<std::size_t>(found - Types().begin());
  v.Alternatives(
      {"type", "What kind of fault; `tiltproof faults` lists them", Presence::kRequired}, Types(), index,
      [&](KeyVisitor& w, std::size_t chosen) {
        const FaultType& type = faults::FaultTypes()[chosen];
        if (fault.type != type.name) fault.parameters.clear();
        fault.type = type.name;
        if (type.has_target()) DescribeTarget(w, type, fault);
        if (type.on_wire()) DescribeMessage(w, fault);
        const bool some_required = std::any_of(type.parameters.begin(), type.parameters.end(),
                                               [](const ParameterInfo& info) { return !info.default_value; });
        w.Section(
            {"parameters", "How strong it is", some_required ? Presence::kRequired : Presence::kOptional},
            [&](KeyVisitor& p) {
              for (const ParameterInfo& info : type.parameters) DescribeParameter(p, info, fault);
            });
        DescribeWindow(w, type, fault);
        type.is_command() ? RefuseTrigger(w, type) : DescribeTrigger(w, fault);
      });
}

}  // namespace tiltproof::harness
