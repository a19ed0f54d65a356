#include "harness/report/activations_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <utility>

#include "harness/report/json_fields.h"

namespace tiltproof::harness {
namespace {

std::vector<std::uint8_t> BytesOf(const std::string& hex) {
  if (hex.size() % 2 != 0)
    throw std::runtime_error(
        fmt::format("bytes with {} hexadecimal digits, not a whole number of bytes", hex.size()));
  std::vector<std::uint8_t> bytes(hex.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const char* digits = hex.data() + 2 * i;
    if (std::from_chars(digits, digits + 2, bytes[i], 16).ptr != digits + 2)
      throw std::runtime_error("bytes that are not hexadecimal");
  }
  return bytes;
}

std::vector<KeptChunk> ChunksOf(const Json& json) {
  std::vector<KeptChunk> chunks;
  for (const Json& chunk : json)
    chunks.push_back({TimeFromFile(chunk.at("begin_s").get<double>()), BytesOf(chunk.at("bytes"))});
  return chunks;
}

Json ParseWithoutBytes(std::string_view line) {
  return Json::parse(line, [](int, Json::parse_event_t event, Json& parsed) {
    return event != Json::parse_event_t::key || (parsed != "before" && parsed != "after");
  });
}

}  // namespace

void ReadActivations(std::string_view jsonl, ActivationBytes bytes,
                     const std::function<bool(KeptActivation)>& visit) {
  for (std::size_t number = 1; !jsonl.empty(); ++number) {
    const std::string_view line = jsonl.substr(0, jsonl.find('\n'));
    jsonl.remove_prefix(std::min(jsonl.size(), line.size() + 1));
    if (line.empty()) continue;
    KeptActivation activation;
    try {
      const bool all = bytes == ActivationBytes::kAll;
      const Json json = all ? Json::parse(line) : ParseWithoutBytes(line);
      if (!json.contains("time_s")) continue;  // how many were not kept
      activation.time_ns = TimeFromFile(json.at("time_s").get<double>());
      activation.fault = json.at("fault");
      activation.type = json.at("type");
      activation.what = json.at("what");
      if (all) {
        activation.before = ChunksOf(json.at("before"));
        activation.after = ChunksOf(json.at("after"));
      }
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("line {}: {}", number, error.what()));
    }
    if (!visit(std::move(activation))) return;
  }
}

}  // namespace tiltproof::harness
