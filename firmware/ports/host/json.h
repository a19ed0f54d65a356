// A JSON text as a tree, for the parameters that the harness passes.
//
//   const std::optional<Json> json = ParseJson("{\"gain\": [[1, 2]]}");
//   if (const Json* gain = json ? json->Find("gain") : nullptr) Use(gain->items);
#pragma once

#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tiltproof::firmware {

struct Json {
  enum class Kind : unsigned char { kNull, kBool, kNumber, kString, kArray, kObject } kind = Kind::kNull;
  std::string text;               // of a string, a number, true or false
  std::vector<Json> items;        // of an array, or the values of an object
  std::vector<std::string> keys;  // of an object, one for each item

  // Null when this is no object or has no such key.
  const Json* Find(std::string_view key) const;
  // The text of a string at that key; empty when there is none.
  std::string_view TextAt(std::string_view key) const;
  bool IsTrueAt(std::string_view key) const;

  template <class Number>
  std::optional<Number> As() const {
    Number value{};
    if (kind != Kind::kNumber ||
        std::from_chars(text.data(), text.data() + text.size(), value).ec != std::errc())
      return std::nullopt;
    return value;
  }
  // nullopt when there is no number at that key, or not one of the type.
  template <class Number>
  std::optional<Number> NumberAt(std::string_view key) const {
    const Json* value = Find(key);
    return value == nullptr ? std::nullopt : value->As<Number>();
  }
};

// nullopt when the text is not one value, or is nested more than 32 deep. Escapes of a string other than of a quote and
// a backslash stay as written.
std::optional<Json> ParseJson(std::string_view text);

}  // namespace tiltproof::firmware
