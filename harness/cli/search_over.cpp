#include "harness/cli/search_over.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "faults/registry.h"
#include "harness/campaign/fault_level.h"
#include "harness/cli/commands.h"
#include "harness/cli/suite.h"
#include "harness/scenario/did_you_mean.h"

namespace tiltproof::harness {
namespace {

std::optional<double> NumberOf(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

class OverFlag {
 public:
  OverFlag(const std::string& text, const Scenario& scenario, const VehicleSignals& signals)
      : text_(text), scenario_(scenario), signals_(signals) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      Refuse("write KEY=A..B, for instance faults.late.start_s=5..20");
    key_ = text.substr(0, equals);
    values_ = text.substr(equals + 1);
  }

  SearchedNumber Read() const {
    std::vector<std::string> parts;
    for (std::size_t from = 0; from <= key_.size();) {
      const std::size_t dot = std::min(key_.find('.', from), key_.size());
      parts.push_back(key_.substr(from, dot - from));
      from = dot + 1;
    }
    SearchedNumber number;
    if (parts.size() == 3 && parts[0] == "faults")
      number = WindowNumber(FindFault(parts[1]), parts[2]);
    else if (parts.size() == 4 && parts[0] == "faults" && parts[2] == "parameters")
      number = ParameterNumber(FindFault(parts[1]), parts[3]);
    else
      number = KeyNumber();
    number.name = key_;
    return number;
  }

 private:
  [[noreturn]] void Refuse(const std::string& why) const {
    throw UsageError(fmt::format("--over {}: {}", text_, why));
  }

  std::size_t FindFault(const std::string& id) const {
    std::vector<std::string_view> ids;
    for (std::size_t i = 0; i < scenario_.faults.size(); ++i) {
      if (scenario_.faults[i].id == id) return i;
      ids.push_back(scenario_.faults[i].id);
    }
    Refuse(fmt::format("no fault '{}'{}", id,
                       ids.empty() ? "; the scenario has none at all" : DidYouMean(id, ids)));
  }

  void ReadRange(SearchedNumber& number, double min, double max) const {
    const std::size_t dots = values_.find("..");
    const auto low = NumberOf(values_.substr(0, dots));
    const auto high = dots == std::string::npos ? std::nullopt : NumberOf(values_.substr(dots + 2));
    if (!low || !high) Refuse(fmt::format("'{}' is no range: write two numbers, A..B", values_));
    if (!(*low < *high)) Refuse(fmt::format("{} is not less than {}", *low, *high));
    if (*low < min || *high > max) Refuse(fmt::format("allowed is {:g} to {:g}", min, max));
    if (number.whole && std::ceil(*low) >= std::floor(*high))
      Refuse("a range of whole numbers has two at least");
    number.low = *low;
    number.high = *high;
  }

  // The window keeps its length where it starts elsewhere.
  SearchedNumber WindowNumber(std::size_t fault, const std::string& what) const {
    constexpr std::array<std::string_view, 2> kKeys = {"start_s", kWindowParameter};
    if (std::find(kKeys.begin(), kKeys.end(), what) == kKeys.end())
      Refuse(fmt::format("no key '{}'{}, or parameters.NAME", what, DidYouMean(what, kKeys)));
    const std::string name = fmt::format("faults.{}.{}", scenario_.faults[fault].id, what);
    for (SearchedNumber& number : FaultNumbers(scenario_, signals_)) {
      if (number.name != name) continue;
      const double flight_s = ToSeconds(scenario_.duration_ns);
      ReadRange(number, what == "start_s" ? 0 : ToSeconds(scenario_.step_ns), flight_s);
      return number;
    }
    Refuse(fmt::format("fault '{}' has no {} to move: give it a {} in the scenario",
                       scenario_.faults[fault].id, what,
                       what == "start_s" ? "start_s" : "start_s and an end_s"));
  }

  SearchedNumber ParameterNumber(std::size_t place, const std::string& name) const {
    const faults::FaultSpec& fault = scenario_.faults[place];
    const faults::FaultType& type = *faults::FindFaultType(fault.type);
    std::vector<std::string_view> names;
    for (const faults::ParameterInfo& info : type.parameters) {
      names.push_back(info.name);
      if (info.name == name) return NumberOfParameter(place, info);
    }
    Refuse(fmt::format("{} has no parameter '{}'{}", type.name, name,
                       names.empty() ? "" : DidYouMean(name, names)));
  }

  SearchedNumber NumberOfParameter(std::size_t place, const faults::ParameterInfo& info) const {
    const faults::FaultSpec& fault = scenario_.faults[place];
    const std::string name(info.name);
    const auto own = fault.parameters.find(name);
    SearchedNumber number{.name = {}, .unit = std::string(info.unit), .set = {}};
    if (info.kind == faults::ParameterKind::kNumber || info.kind == faults::ParameterKind::kInteger) {
      number.whole = info.kind == faults::ParameterKind::kInteger;
      ReadRange(number, info.min, info.max);
      number.logarithmic = info.severity == faults::Scale::kLogarithmic && number.low * number.high > 0;
      if (own != fault.parameters.end()) number.own = std::get<double>(own->second);
      number.set = [place, name](Scenario& changed, double value) {
        changed.faults.at(place).parameters[name] = value;
      };
      return number;
    }
    if (info.kind == faults::ParameterKind::kVector || info.kind == faults::ParameterKind::kFrameWords)
      Refuse(fmt::format("{} is neither a number nor a name", name));
    for (std::size_t from = 0; from <= values_.size();) {
      const std::size_t comma = std::min(values_.find(',', from), values_.size());
      number.names.push_back(values_.substr(from, comma - from));
      from = comma + 1;
    }
    if (number.names.size() < 2) Refuse(fmt::format("{} is a name: write two at least, V1,V2", name));
    CheckNames(fault, name, number.names);
    for (std::size_t i = 0; i < number.names.size() && own != fault.parameters.end(); ++i)
      if (number.names[i] == std::get<std::string>(own->second)) number.own = static_cast<double>(i);
    number.set = [place, name, names = number.names](Scenario& changed, double value) {
      changed.faults.at(place).parameters[name] = names.at(static_cast<std::size_t>(value));
    };
    return number;
  }

  // Any other key, by its path; a list of names where no range is written.
  SearchedNumber KeyNumber() const {
    if (key_ == "model" || key_ == "name") Refuse("a search flies one vehicle, and writes one scenario");
    SearchedNumber number{.name = {}, .unit = {}, .set = {}};
    if (values_.find("..") != std::string::npos)
      ReadRange(number, -1e300, 1e300);
    else
      number.names = SplitValues(values_);
    if (number.low == 0 && number.high == 1 && number.names.size() == 1)
      Refuse(fmt::format("'{}' is no range: write A..B, or V1,V2", values_));
    const auto models = std::make_shared<ModelCache>();
    const auto with = [key = key_, models](const Scenario& scenario, const std::string& value) {
      return WithKey(scenario, {key, value}, *models);
    };
    std::vector<std::string> tried = number.names;
    if (tried.empty()) tried = {fmt::format("{}", number.low), fmt::format("{}", number.high)};
    try {
      for (const std::string& value : tried) with(scenario_, value);
    } catch (const std::exception& error) {
      Refuse(error.what());
    }
    if (number.names.empty()) {
      try {
        with(scenario_, fmt::format("{}", number.low + 0.414 * (number.high - number.low)));
      } catch (const std::exception&) {
        number.whole = true;  // the ends are valid, and a fraction between them is not
      }
    }
    number.set = [with, names = number.names](Scenario& changed, double value) {
      changed =
          with(changed, names.empty() ? fmt::format("{}", value) : names.at(static_cast<std::size_t>(value)));
    };
    return number;
  }

  void CheckNames(const faults::FaultSpec& fault, const std::string& parameter,
                  const std::vector<std::string>& names) const {
    for (const std::string& name : names) {
      faults::FaultSpec named = fault;
      named.parameters[parameter] = name;
      for (const faults::Problem& problem : faults::Validate(named)) Refuse(name + ": " + problem.message);
    }
  }

  const std::string& text_;
  const Scenario& scenario_;
  const VehicleSignals& signals_;
  std::string key_, values_;
};

}  // namespace

SearchedNumber ReadOver(const std::string& text, const Scenario& scenario, const VehicleSignals& signals) {
  return OverFlag(text, scenario, signals).Read();
}

}  // namespace tiltproof::harness
