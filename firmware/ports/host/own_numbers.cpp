#include "firmware/ports/host/own_numbers.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace tiltproof::firmware {
namespace {

// Without the zeros that do not count.
std::string TextOf(double number) { return nlohmann::json(number).dump(); }

}  // namespace

std::string ReadOwnNumbers(const char* parameters, std::span<const OwnNumber> known) {
  const auto json = nlohmann::json::parse(parameters == nullptr ? "" : parameters, nullptr, false);
  const auto own = json.is_object() ? json.find("firmware_parameters") : json.end();
  if (own == json.end() || !own->is_object()) return "";
  for (const auto& [name, number] : own->items()) {
    const auto found = std::find_if(known.begin(), known.end(),
                                    [&, name = name](const OwnNumber& each) { return each.name == name; });
    if (found == known.end()) {
      std::string problem = "firmware_parameters: this firmware has no " + name + "; it has";
      for (const OwnNumber& each : known) problem.append(" ").append(each.name);
      return problem;
    }
    const double value = number.is_number() ? number.get<double>() : NAN;
    if (!(value >= found->min) || !(value <= found->max) || (found->whole && std::floor(value) != value))
      return "firmware_parameters: out of range: " + name + " is a " + (found->whole ? "whole " : "") +
             "number from " + TextOf(found->min) + " to " + TextOf(found->max);
    found->value = value;
  }
  return "";
}

}  // namespace tiltproof::firmware
