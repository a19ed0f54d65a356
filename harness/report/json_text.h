// JSON as text, whatever its strings hold: what is no UTF-8 becomes U+FFFD, where nlohmann would throw.
#pragma once

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// For a file.
inline std::string JsonText(const nlohmann::ordered_json& json, int indent = -1) {
  return json.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

// For standard output, which may be a terminal: one line of ASCII, everything else as \uNNNN.
inline std::string JsonLine(const nlohmann::ordered_json& json) {
  // Of ASCII, DEL alone is a control character that JSON leaves as it is; nlohmann writes it as \u007f too.
  return json.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
}

// The value of an enumeration that counts from 0 to `last`, by its Name(). Throws std::runtime_error: "unknown `what`".
template <class Enum>
Enum EnumNamed(const std::string& what, std::string_view name, Enum last) {
  for (int i = 0; i <= static_cast<int>(last); ++i)
    if (Name(static_cast<Enum>(i)) == name) return static_cast<Enum>(i);
  throw std::runtime_error("unknown " + what + " '" + std::string(name) + "'");
}

// Of the result files: run.json, results.json, verdict.json, flight.json. It grows when a reader of the format before would
// misread them. Files without one are of the first.
inline constexpr int kResultsFormat = 1;
// Throws std::runtime_error when a newer tiltproof has written this.
inline void CheckFormat(const nlohmann::ordered_json& json) {
  const int format = json.value("format", 1);
  if (format > kResultsFormat)
    throw std::runtime_error("written by a newer tiltproof (format " + std::to_string(format) +
                             "; this one reads formats up to " + std::to_string(kResultsFormat) + ")");
}

}  // namespace tiltproof::harness
