// Structs that name their fields (link/fields.h) as JSON, and back: one key per field, of the field's name.
//
//   const Json json = ToJson(restart);                  // {"time_ns": 1000, "cause": "reset by watchdog"}
//   const Restart restart = FromJson<Restart>(json);
//
// An enumeration is its Name(), an array by Direction is an object with their names. JSON has no infinity and no
// NaN: such a number is null, and so is an optional without a value. Reading throws std::exception with the key
// that is missing or wrong. Only an optional, a list or a map may be missing, and is then empty: so must be what
// a later version adds. A struct may list fields that its files leave out (kNotInFiles), and leave out keys instead of
// writing null (kLeavesOutNull: true, or a list of fields). It may be the list of its values (kIsList).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "harness/report/json_text.h"
#include "link/chunk.h"
#include "link/fields.h"
#include "link/named.h"
#include "link/time.h"

namespace tiltproof::harness {

using Json = nlohmann::ordered_json;

template <class T>
constexpr bool InFiles(std::string_view field) {
  if constexpr (requires { T::kNotInFiles; })
    return std::ranges::find(T::kNotInFiles, field) == T::kNotInFiles.end();
  return true;
}

template <class T>
constexpr bool LeavesOutNull(std::string_view field) {
  if constexpr (requires { T::kLeavesOutNull.begin(); })
    return std::ranges::find(T::kLeavesOutNull, field) != T::kLeavesOutNull.end();
  else if constexpr (requires { T::kLeavesOutNull; })
    return T::kLeavesOutNull;
  return false;
}

template <class T>
constexpr bool IsList() {
  if constexpr (requires { T::kIsList; }) return T::kIsList;
  return false;
}

class JsonWriter {
 public:
  // Each field to its key, which may be there already.
  template <HasFields T>
  static void PutFields(Json& json, const T& value) {
    T::Fields(
        [&json](const char* name, const auto& field) {
          if (!InFiles<T>(name)) return;
          Put(json[name], field);
          if (LeavesOutNull<T>(name) && json[name].is_null()) json.erase(name);
        },
        value);
  }

  template <class T>
  requires std::is_arithmetic_v<T>
  static void Put(Json& json, T value) {
    if (std::isfinite(static_cast<double>(value)))
      json = value;
    else
      json = nullptr;
  }
  template <class T>
  requires std::is_enum_v<T>
  static void Put(Json& json, T value) { json = Name(value); }
  static void Put(Json& json, const std::string& value) { json = value; }
  template <class T>
  static void Put(Json& json, const std::optional<T>& value) {
    json = nullptr;
    if (value) Put(json, *value);
  }
  template <class T>
  static void Put(Json& json, const std::vector<T>& values) {
    json = Json::array();
    for (const T& value : values) Put(json.emplace_back(), value);
  }
  template <class T>
  static void Put(Json& json, const std::map<std::string, T>& values) {
    json = Json::object();
    for (const auto& [key, value] : values) Put(json[key], value);
  }
  template <class T>
  static void Put(Json& json, const std::array<T, link::kDirectionCount>& values) {
    json = Json::object();
    for (std::size_t d = 0; d < values.size(); ++d)
      Put(json[std::string(Name(static_cast<link::Direction>(d)))], values[d]);
  }
  template <HasFields T>
  static void Put(Json& json, const T& value) {
    if constexpr (IsList<T>()) {
      json = Json::array();
      T::Fields([&json](const char*, const auto& field) { Put(json.emplace_back(), field); }, value);
    } else {
      json = Json::object();
      PutFields(json, value);
    }
  }
};

class JsonReader {
 public:
  template <HasFields T>
  static void GetFields(const Json& json, T& value) {
    if (!json.is_object()) throw Needed("an object", json);
    T::Fields(
        [&json](const char* name, auto& field) {
          if (!InFiles<T>(name)) return;
          try {
            GetKey(json, name, field);
          } catch (const std::exception& error) {
            throw std::runtime_error(std::string(name) + ": " + error.what());
          }
        },
        value);
  }

  template <class T>
  static void Get(const Json& json, T& value) {
    if constexpr (HasFields<T> && IsList<T>()) {
      std::size_t place = 0;
      T::Fields([&json, &place](const char*, auto& field) { Get(json.at(place++), field); }, value);
    } else if constexpr (HasFields<T>) {
      GetFields(json, value);
    } else if constexpr (std::is_enum_v<T>) {
      value = Named<T>(Plain<std::string>(json));
    } else if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
      value = WholeNumber<T>(json);
    } else {
      value = Plain<T>(json);
    }
  }
  template <class T>
  static void Get(const Json& json, std::optional<T>& value) {
    value.reset();
    if (!json.is_null()) Get(json, value.emplace());
  }
  template <class T>
  static void Get(const Json& json, std::vector<T>& values) {
    values.clear();
    if (!json.is_array()) throw Needed("a list", json);
    for (const Json& element : json) Get(element, values.emplace_back());
  }
  template <class T>
  static void Get(const Json& json, std::map<std::string, T>& values) {
    values.clear();
    if (!json.is_object()) throw Needed("an object", json);
    for (const auto& [key, element] : json.items()) Get(element, values[key]);
  }
  template <class T>
  static void Get(const Json& json, std::array<T, link::kDirectionCount>& values) {
    for (std::size_t d = 0; d < values.size(); ++d)
      Get(json.at(std::string(Name(static_cast<link::Direction>(d)))), values[d]);
  }

 private:
  static std::runtime_error Needed(const char* what, const Json& json) {
    return std::runtime_error(std::string(what) + " is needed, and this is of type " + json.type_name());
  }
  template <class T>
  static T Plain(const Json& json) {
    try {
      return json.get<T>();
    } catch (const Json::type_error&) {
      throw Needed(std::is_same_v<T, bool>       ? "true or false"
                   : std::is_floating_point_v<T> ? "a number"
                                                 : "a text",
                   json);
    }
  }
  // In a file stands any number: what T cannot hold is refused.
  template <class T>
  static T WholeNumber(const Json& json) {
    const bool fits = json.is_number_unsigned()
                          ? std::in_range<T>(json.get<std::uint64_t>())
                          : json.is_number_integer() && std::in_range<T>(json.get<std::int64_t>());
    if (json.is_number() && !fits)
      throw std::runtime_error(json.dump() + " is not a whole number from " +
                               std::to_string(std::numeric_limits<T>::min()) + " to " +
                               std::to_string(std::numeric_limits<T>::max()));
    if (!json.is_number()) throw Needed("a whole number", json);
    return json.get<T>();
  }

  template <class T>
  static void GetKey(const Json& json, const char* key, T& value) {
    const auto found = json.find(key);
    if (found == json.end()) throw std::runtime_error("it is missing");
    Get(*found, value);
  }
  template <class T>
  static void GetKey(const Json& json, const char* key, std::optional<T>& value) {
    Get(json.value(key, Json()), value);
  }
  template <class T>
  static void GetKey(const Json& json, const char* key, std::vector<T>& values) {
    Get(json.value(key, Json::array()), values);
  }
  template <class T>
  static void GetKey(const Json& json, const char* key, std::map<std::string, T>& values) {
    Get(json.value(key, Json::object()), values);
  }
};

// A time in seconds, as files have it. Throws std::runtime_error when nanoseconds cannot hold it.
inline TimeNs TimeFromFile(double time_s) {
  if (!(std::abs(time_s) < 9e9))
    throw std::runtime_error(std::to_string(time_s) + " s is not a time of a flight");
  return FromSeconds(time_s);
}

template <class T>
Json ToJson(const T& value) {
  Json json;
  JsonWriter::Put(json, value);
  return json;
}
template <class T>
T FromJson(const Json& json) {
  T value{};
  JsonReader::Get(json, value);
  return value;
}

}  // namespace tiltproof::harness
