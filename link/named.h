// The values of an enumeration by their names. The enumeration has Name(value), and LastOf(Enum()) is its last value.
//
//   Named<Side>("left");       // throws std::runtime_error for an unknown name
//   FindNamed<Side>("above");  // std::nullopt for an unknown name
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace tiltproof {

template <class Enum>
std::optional<Enum> FindNamed(std::string_view name) {
  for (int i = 0; i <= static_cast<int>(LastOf(Enum())); ++i)
    if (Name(static_cast<Enum>(i)) == name) return static_cast<Enum>(i);
  return std::nullopt;
}

template <class Enum>
Enum Named(std::string_view name) {
  if (const auto found = FindNamed<Enum>(name)) return *found;
  throw std::runtime_error("unknown name '" + std::string(name) + "'");
}

}  // namespace tiltproof
