// JSON as text, whatever its strings hold: bytes that are not UTF-8 become U+FFFD, where nlohmann would
// throw.
#pragma once

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace tiltproof::harness {

// For a file.
inline std::string JsonText(const nlohmann::ordered_json& json, int indent = -1) {
  return json.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

// For standard output, which may be a terminal: one line of ASCII, everything else as \uNNNN.
inline std::string JsonLine(const nlohmann::ordered_json& json) {
  // DEL is the only ASCII control character that JSON leaves unchanged; nlohmann also writes it as \u007f.
  return json.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
}

// Version of the result files: run.json, results.json, verdict.json, flight.json. It is increased when a
// reader of the previous format would misread them. Files without a version have the first one.
inline constexpr int kResultsFormat = 1;
// Throws std::runtime_error when a newer tiltproof has written this.
inline void CheckFormat(const nlohmann::ordered_json& json) {
  const int format = json.value("format", 1);
  if (format > kResultsFormat)
    throw std::runtime_error("written by a newer tiltproof (format " + std::to_string(format) +
                             "; this one reads formats up to " + std::to_string(kResultsFormat) + ")");
}

}  // namespace tiltproof::harness
