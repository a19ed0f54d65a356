#include "firmware/ports/host/lqr_parameters.h"

#include <charconv>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

namespace tiltproof::firmware {
namespace {

std::string_view WithoutSpaces(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \n\t\r");
  return begin == std::string_view::npos ? std::string_view() : text.substr(begin);
}

// The text behind `"key":`; empty when there is none. A key inside a string has escaped quotes, so it does not match.
std::string_view After(std::string_view text, std::string_view key) {
  for (std::size_t at = 0; (at = text.find(key, at)) != std::string_view::npos; at += key.size()) {
    const std::string_view rest = text.substr(at + key.size());
    if (at == 0 || text[at - 1] != '"' || !rest.starts_with('"')) continue;
    const std::string_view value = WithoutSpaces(rest.substr(1));
    if (value.starts_with(':')) return WithoutSpaces(value.substr(1));
  }
  return {};
}

// The inside of the array at the front of the text; empty when there is none. The names in it hold no bracket.
std::string_view ArrayAt(std::string_view text) {
  if (!text.starts_with('[')) return {};
  std::size_t depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '[') ++depth;
    if (text[i] == ']' && --depth == 0) return text.substr(1, i - 1);
  }
  return {};
}

std::optional<float> NumberAt(std::string_view text) {
  float value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return std::nullopt;
  return value;
}

// The numbers behind each `"key":` of an array of objects, in order. nullopt when they are too many or one is no number.
std::optional<std::size_t> ReadMembers(std::string_view objects, std::string_view key,
                                       std::span<float> into) {
  std::size_t count = 0;
  while (!(objects = After(objects, key)).empty()) {
    const auto value = NumberAt(objects);
    if (!value || count == into.size()) return std::nullopt;
    into[count++] = *value;
  }
  return count;
}

// The numbers of an array, separated by commas.
std::optional<std::size_t> ReadNumbers(std::string_view array, std::span<float> into) {
  std::size_t count = 0;
  while (!(array = WithoutSpaces(array)).empty()) {
    const auto value = NumberAt(array);
    if (!value || count == into.size()) return std::nullopt;
    into[count++] = *value;
    const std::size_t comma = array.find(',');
    array = comma == std::string_view::npos ? std::string_view() : array.substr(comma + 1);
  }
  return count;
}

bool ReadGain(std::string_view rows, LqrTable& table) {
  std::size_t count = 0;
  for (std::size_t at = 0; (at = rows.find('[', at)) != std::string_view::npos; ++count) {
    const std::string_view row = ArrayAt(rows.substr(at));
    if (count == table.input_count ||
        ReadNumbers(row, table.gain[count]) != table.sensed_count() + kLqrIntegralCount)
      return false;
    at += row.size() + 2;
  }
  return count == table.input_count;
}

}  // namespace

bool ReadLqrTable(const char* parameters, LqrTable& table) {
  if (parameters == nullptr) return false;
  const std::string_view text = parameters;
  table = LqrTable();
  const auto period_s = NumberAt(After(text, "control_period_s"));
  const auto sensed = ReadMembers(ArrayAt(After(text, "signals")), "hover", table.hover_state);
  const std::string_view inputs = ArrayAt(After(text, "inputs"));
  const auto hover = ReadMembers(inputs, "hover", table.hover_input);
  if (!period_s || !(*period_s > 0) || !sensed || !hover) return false;
  if (*sensed < 12 || *sensed % 2 != 0 || *hover == 0) return false;
  table.period_s = *period_s;
  table.hinge_count = *sensed / 2 - 6;
  table.input_count = *hover;
  table.rates_in_world = After(text, "angular_rates").starts_with("\"world\"");
  return ReadMembers(inputs, "min", table.input_min) == table.input_count &&
         ReadMembers(inputs, "max", table.input_max) == table.input_count &&
         ReadGain(ArrayAt(After(text, "gain")), table);
}

}  // namespace tiltproof::firmware
