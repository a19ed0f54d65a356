#pragma once

#include <string>
#include <string_view>

namespace tiltproof::harness {

// ASCII letters alone, in every locale.
inline std::string LowerCase(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

}  // namespace tiltproof::harness
