#include "harness/campaign/campaign_draw.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "faults/random.h"
#include "faults/registry.h"
#include "faults/volume.h"
#include "harness/formula/formula.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

using faults::FaultSpec;
using faults::FaultType;
using faults::ParameterInfo;
using faults::ParameterKind;
using faults::ParameterValue;
using faults::Random;

constexpr int kTriesMax = 64;         // for one fault
constexpr double kUntypical = 1e-6;   // six decades, where nothing says what is typical
constexpr double kFromTypical = 100;  // to both sides
constexpr std::uint64_t kSeedBits = 53;

// Four digits: scenarios are read by people.
double Short(double value) {
  const std::string text = fmt::format("{:.4g}", value);
  double shorter = value;
  std::from_chars(text.data(), text.data() + text.size(), shorter);
  return shorter;
}

TimeNs ToMs(TimeNs time_ns) { return time_ns / kNsPerMs * kNsPerMs; }

double Draw(const Distribution& distribution, Random& random) {
  const double least = std::get<double>(distribution.values.front());
  if (distribution.kind == Distribution::Kind::kChoice)
    return std::get<double>(distribution.values[random.Below(distribution.values.size())]);
  const double greatest = std::get<double>(distribution.values.back()), share = random.Uniform();
  if (distribution.kind == Distribution::Kind::kUniform) return least + share * (greatest - least);
  return least * pow(greatest / least, share);
}

// The draws of one run.
class Drawer {
 public:
  Drawer(const DrawSpec& spec, const DrawBase& base, std::uint64_t key)
      : spec_(spec), base_(base), random_(key), scenario_(base.scenario) {}

  void Draw() {
    const auto more = static_cast<std::uint64_t>(spec_.faults_count_max - spec_.faults_count_min);
    const auto count = static_cast<std::uint64_t>(spec_.faults_count_min) + random_.Below(more + 1);
    const std::vector<std::size_t> types = Subset();
    // Its places in the file do not fit any more.
    scenario_.fault_places.clear();
    for (std::uint64_t i = 0; i < count; ++i) AddFault(types, i);
  }

  Scenario TakeScenario() { return std::move(scenario_); }
  std::vector<CampaignFault> TakeFaults() { return std::move(drawn_); }

 private:
  std::vector<std::size_t> Subset() {
    std::vector<std::size_t> types(base_.types.size());
    std::iota(types.begin(), types.end(), std::size_t{0});
    if (!spec_.swarm || types.empty()) return types;
    const double all = static_cast<double>(types.size());
    const auto size = std::min(types.size(), static_cast<std::size_t>(pow(all + 1, random_.Uniform())));
    for (std::size_t i = 0; i < size; ++i) std::swap(types[i], types[i + random_.Below(types.size() - i)]);
    types.resize(size);
    return types;
  }

  void AddFault(const std::vector<std::size_t>& types, std::uint64_t place_in_run) {
    if (types.empty()) return;
    for (int i = 0; i < kTriesMax; ++i) {
      const DrawType& type = base_.types[types[random_.Below(types.size())]];
      const DrawPlace& place = type.places[random_.Below(type.places.size())];
      FaultSpec fault = place.fault;
      fault.id = fmt::format("draw-{}", place_in_run + 1);
      if (!SetWindow(*type.type, fault)) continue;
      SetParameters(*type.type, place, fault);
      if (!EndsInTime(*type.type, fault)) continue;
      scenario_.faults.push_back(std::move(fault));
      if (Fits(scenario_.faults.back())) {
        Note(*type.type, place, scenario_.faults.back());
        return;
      }
      scenario_.faults.pop_back();
    }
  }

  TimeNs latest_ns() const { return scenario_.duration_ns - FromSeconds(spec_.recover_s.value_or(0)); }

  // False: there is no such window in the flight.
  bool SetWindow(const FaultType& type, FaultSpec& fault) {
    const TimeNs period_ns = scenario_.link.protocol->control_period_ns;
    if (latest_ns() <= period_ns) return false;
    fault.start_ns = kPowerOn;
    fault.end_ns = kNever;
    if (type.start != faults::Bound::kRefused) {
      const double start_s = spec_.start_s ? harness::Draw(*spec_.start_s, random_)
                                           : random_.Uniform() * ToSeconds(latest_ns() - period_ns);
      fault.start_ns = ToMs(FromSeconds(start_s));
      if (fault.start_ns >= latest_ns()) return false;
    }
    if (type.end == faults::Bound::kRefused) return true;
    const double shortest_s = ToSeconds(period_ns), longest_s = ToSeconds(scenario_.duration_ns);
    const double length_s = spec_.length_s ? harness::Draw(*spec_.length_s, random_)
                                           : shortest_s * pow(longest_s / shortest_s, random_.Uniform());
    const TimeNs start_ns = std::max<TimeNs>(fault.start_ns, 0);
    fault.end_ns = std::min(start_ns + std::max(ToMs(FromSeconds(length_s)), kNsPerMs), latest_ns());
    return fault.end_ns > start_ns;
  }

  void SetParameters(const FaultType& type, const DrawPlace& place, FaultSpec& fault) {
    const auto chosen = spec_.parameters.find(std::string(type.name));
    for (const ParameterInfo& info : type.parameters) {
      const std::string name(info.name);
      ParameterValue& value = fault.parameters[name];
      if (chosen != spec_.parameters.end()) {
        if (const auto own = chosen->second.find(name); own != chosen->second.end()) {
          value = Chosen(info, own->second);
          continue;
        }
      }
      if (place.severity && place.severity->parameter == name)
        value = std::clamp(Short(LevelAt(place.severity->range, random_.Uniform())), info.min, info.max);
      else
        DrawOther(type, info, fault, value);
    }
  }

  ParameterValue Chosen(const ParameterInfo& info, const Distribution& distribution) {
    if (distribution.kind == Distribution::Kind::kChoice) {
      const NumberOrWord& scalar = distribution.values[random_.Below(distribution.values.size())];
      if (const auto* word = std::get_if<std::string>(&scalar)) return *word;
      return std::get<double>(scalar);
    }
    const double number = harness::Draw(distribution, random_);
    if (info.kind == ParameterKind::kInteger) return std::round(number);
    return std::clamp(Short(number), info.min, info.max);
  }

  // Words, fields and directions; everything else stays as in the type's example.
  void DrawOther(const FaultType& type, const ParameterInfo& info, const FaultSpec& fault,
                 ParameterValue& value) {
    if (info.kind == ParameterKind::kChoice && !type.IsOneOf<faults::ClockKind, faults::NodeKind>()) {
      value = std::string(info.choices[random_.Below(info.choices.size())]);
    } else if (info.kind == ParameterKind::kField) {
      const std::vector<std::string> names = faults::FieldNames(
          scenario_.protocol_of(fault), faults::ResolvedTarget(fault, type), fault.message);
      if (!names.empty()) value = names[random_.Below(names.size())];
    } else if (info.kind == ParameterKind::kVector) {
      std::array<double, 3> direction{};
      const std::uint64_t axis = random_.Below(6);
      direction[axis % 3] = axis < 3 ? 1 : -1;
      value = direction;
    }
  }

  // With a time to recover, a fault whose length is one of its parameters begins early enough.
  bool EndsInTime(const FaultType& type, FaultSpec& fault) const {
    if (!spec_.recover_s || type.duration_ms.empty()) return true;
    const faults::Window window = faults::WindowOf(fault);
    if (window.end_ns == kNever || window.end_ns <= latest_ns()) return true;
    fault.start_ns -= window.end_ns - latest_ns();
    return fault.start_ns >= 0;
  }

  bool Fits(const FaultSpec& fault) const {
    const bool alone =
        std::all_of(scenario_.faults.begin(), scenario_.faults.end() - 1,
                    [&](const FaultSpec& other) { return other.id != fault.id && !Drift(other, fault); });
    return alone && faults::Validate(fault).empty() &&
           !faults::ProtocolProblem(fault, scenario_.protocol_of(fault)) &&
           !faults::CertainOverfull(scenario_.faults, scenario_.duration_ns, *scenario_.link.protocol);
  }

  // Two drifts of one clock may not overlap; one without a client is on all.
  static bool Drift(const FaultSpec& a, const FaultSpec& b) {
    return a.type == "clock.drift" && b.type == "clock.drift" &&
           (a.client.empty() || b.client.empty() || a.client == b.client);
  }

  void Note(const FaultType& type, const DrawPlace& place, const FaultSpec& fault) {
    const faults::Window window = faults::WindowOf(fault);
    CampaignFault& noted = drawn_.emplace_back();
    noted.id = fault.id;
    noted.type = fault.type;
    noted.place = place.name;
    const TimeNs begin_ns = std::max<TimeNs>(window.begin_ns, 0);
    const TimeNs end_ns = std::min(window.end_ns, scenario_.duration_ns);
    noted.start_s = ToSeconds(begin_ns);
    noted.end_s = ToSeconds(end_ns);
    if (place.severity)
      noted.severity = std::get<double>(fault.parameters.at(place.severity->parameter));
    else if (type.has_severity())
      noted.severity = ToSeconds(end_ns - begin_ns);
  }

  const DrawSpec& spec_;
  const DrawBase& base_;
  Random random_;
  Scenario scenario_;
  std::vector<CampaignFault> drawn_;
};

}  // namespace

bool IsDrawn(const DrawSpec& spec, const FaultType& type) {
  if (spec.types.empty()) return type.layer() != "harness" && !type.has_no_severity;
  return std::any_of(spec.types.begin(), spec.types.end(),
                     [&](const std::string& pattern) { return MatchesType(pattern, type.name); });
}

double LevelAt(const LevelRange& range, double share) {
  const bool logarithmic = range.scale == faults::Scale::kLogarithmic;
  const double length = range.end - range.start, far = std::abs(length);
  const double typical =
      range.typical ? std::abs(*range.typical - range.harmless.value_or(range.start)) : 0.0;
  const auto between = [&](double from, double to) { return from * pow(to / from, share); };
  double level = range.start + share * length;
  if (logarithmic && range.start * range.end > 0) {
    const double size = range.typical ? std::abs(*range.typical) : 0;
    const auto near_typical = [&](double end) {
      const double limited =
          size > 0 ? std::clamp(std::abs(end), size / kFromTypical, size * kFromTypical) : std::abs(end);
      return std::copysign(limited, end);
    };
    level = between(near_typical(range.start), near_typical(range.end));
  } else if (logarithmic && range.end == 0) {
    level = std::copysign(
        between(std::abs(range.start), range.typical && *range.typical != 0
                                           ? std::min(far, std::abs(*range.typical) / kFromTypical)
                                           : far * kUntypical),
        range.start);
  } else if (logarithmic || (typical > 0 && far > kFromTypical * typical)) {
    const double from = typical > 0 ? std::min(far, typical / kFromTypical) : far * kUntypical;
    const double to = typical > 0 ? std::min(far, typical * kFromTypical) : far;
    level = range.start + std::copysign(between(from, to), length);
  }
  if (range.whole) level = std::round(level);
  return std::clamp(level, std::min(range.start, range.end), std::max(range.start, range.end));
}

Scenario WithRecovery(const Scenario& scenario, double recover_s) {
  Scenario recovered = scenario;
  const stl::Window end{scenario.duration_ns - FromSeconds(recover_s / 4), scenario.duration_ns};
  for (CriterionSpec& criterion : recovered.criteria) {
    if (criterion.stl.empty()) continue;
    if (const stl::Formula body = stl::BodyOfAlways(stl::Parse(criterion.stl, {.any_name = true})))
      criterion.stl = stl::ToString(
          std::make_shared<const stl::Node>(stl::Node{.op = stl::Op::kAlways, .window = end, .left = body}));
  }
  return recovered;
}

namespace {

std::string NameOfPlace(const EnvelopeRow& row, const FaultSpec& fault) {
  if (!row.line.empty()) return faults::TargetText(fault);
  return row.client + (row.client.empty() || row.place.empty() ? "" : ":") + row.place;
}

}  // namespace

std::vector<DrawType> PrepareTypes(const DrawSpec& spec, const Scenario& scenario,
                                   const VehicleSignals& signals, std::span<const EnvelopeRow> rows) {
  FaultSpec placeholder;
  placeholder.id = "draw-1";
  placeholder.type = kPlaceholderType;
  placeholder.start_ns = 0;
  placeholder.end_ns = scenario.duration_ns;
  Scenario with_placeholder = scenario;
  with_placeholder.faults = {placeholder};
  std::vector<DrawType> types;
  for (const EnvelopeRow& row : rows) {
    if (!IsDrawn(spec, *row.type)) continue;
    const Scenario with_fault = WithRow(with_placeholder, row, signals);
    const FaultSpec& fault = with_fault.faults.front();
    DrawPlace place{.name = NameOfPlace(row, fault), .fault = fault, .severity = {}};
    if (row.type->severity_parameter() != nullptr) place.severity = SeverityOf(with_fault, 0, signals);
    if (types.empty() || types.back().type != row.type) types.push_back({row.type, {}});
    types.back().places.push_back(std::move(place));
  }
  return types;
}

namespace {

std::uint64_t BuildsOf(const CampaignPlan& plan) {
  return std::max<std::size_t>(plan.spec.firmware.size(), 1);
}

}  // namespace

std::size_t BaseOf(const CampaignPlan& plan, std::uint64_t number) {
  return number / BuildsOf(plan) % plan.bases.size();
}

DrawnRun DrawRun(const CampaignPlan& plan, std::uint64_t number) {
  const std::uint64_t builds = BuildsOf(plan), draw = number / builds;
  const auto seed = static_cast<std::uint64_t>(plan.spec.seed);
  DrawnRun run;
  run.number = number;
  run.base = BaseOf(plan, number);
  const DrawBase& base = plan.bases[run.base];
  Drawer drawer(plan.spec.draw, base, faults::KeyOf(faults::StreamKey(seed, {"campaign", "draw"}), draw));
  drawer.Draw();
  run.scenario = drawer.TakeScenario();
  run.faults = drawer.TakeFaults();
  run.scenario.seed =
      faults::KeyOf(faults::StreamKey(seed, {"campaign", "flight"}), draw) >> (64 - kSeedBits);
  if (!plan.spec.firmware.empty()) run.scenario.FlyFirmware(plan.spec.firmware[number % builds]);
  return run;
}

namespace {

// The levels at the ends of the bands.
std::vector<double> BandLevels(const CampaignPlan& plan, const DrawBase& base, const DrawType& type,
                               const DrawPlace& place, const std::string& parameter) {
  const auto at = [](double from, double to, double share, bool logarithmic) {
    return logarithmic ? from * pow(to / from, share) : from + share * (to - from);
  };
  const Distribution* chosen = nullptr;
  if (const auto own = plan.spec.draw.parameters.find(std::string(type.type->name));
      own != plan.spec.draw.parameters.end())
    if (const auto found = own->second.find(parameter); found != own->second.end()) chosen = &found->second;
  if (!place.severity && plan.spec.draw.length_s) chosen = &*plan.spec.draw.length_s;
  const double shortest_s = ToSeconds(base.scenario.link.protocol->control_period_ns);
  std::vector<double> levels;
  for (std::size_t i = 0; i <= kBandsCount; ++i) {
    const double share = static_cast<double>(i) / kBandsCount;
    if (chosen != nullptr) {
      const auto numbers = [](const NumberOrWord& a, const NumberOrWord& b) {
        return std::get<double>(a) < std::get<double>(b);
      };
      const auto [least, greatest] =
          std::minmax_element(chosen->values.begin(), chosen->values.end(), numbers);
      levels.push_back(at(std::get<double>(*least), std::get<double>(*greatest), share,
                          chosen->kind == Distribution::Kind::kLogUniform));
    } else if (place.severity) {
      levels.push_back(LevelAt(place.severity->range, share));
    } else {
      levels.push_back(at(shortest_s, ToSeconds(base.scenario.duration_ns), share, true));
    }
  }
  return levels;
}

}  // namespace

CampaignFrame MakeFrame(const CampaignPlan& plan) {
  CampaignFrame frame;
  frame.campaign = plan.spec.name;
  frame.seed = static_cast<std::uint64_t>(plan.spec.seed);
  frame.runs_count = static_cast<std::uint64_t>(plan.spec.runs_count);
  std::set<std::tuple<std::string, std::string, bool>> known;
  for (const DrawBase& base : plan.bases) {
    frame.durations_s[base.scenario.name] = ToSeconds(base.scenario.duration_ns);
    for (const DrawType& type : base.types) {
      for (const DrawPlace& place : type.places) {
        CampaignRange range;
        range.type = type.type->name;
        range.place = place.name;
        if (place.severity) {
          range.parameter = place.severity->parameter;
          range.unit = place.severity->unit;
        } else if (type.type->has_severity()) {
          range.parameter = kWindowParameter;
          range.unit = "s";
        }
        if (!range.parameter.empty()) range.levels = BandLevels(plan, base, type, place, range.parameter);
        const bool rises = range.levels.empty() || range.levels.back() >= range.levels.front();
        if (known.emplace(range.type, range.place, rises).second) frame.ranges.push_back(std::move(range));
      }
    }
  }
  return frame;
}

}  // namespace tiltproof::harness
