// An extended regular expression of the C library, because std::regex takes 2 s to compile.
//
//   const PosixRegex place("[a-z]+[.]c:[0-9]+");
//   if (const std::optional<std::string_view> found = place.Find(line)) Report(*found);
#pragma once

#include <regex.h>

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "link/check.h"

namespace tiltproof {

class PosixRegex {
 public:
  explicit PosixRegex(const std::string& regex) {
    Check(regcomp(&compiled_, regex.c_str(), REG_EXTENDED) == 0,
          "a regular expression of the program is valid");
  }
  ~PosixRegex() { regfree(&compiled_); }
  PosixRegex(const PosixRegex&) = delete;
  PosixRegex& operator=(const PosixRegex&) = delete;

  // The first part of the text that matches.
  std::optional<std::string_view> Find(std::string_view text) const {
    // On entry the part of the text to search, on return the part that matches.
    regmatch_t part = {.rm_so = 0, .rm_eo = static_cast<regoff_t>(text.size())};
    if (regexec(&compiled_, text.data(), 1, &part, REG_STARTEND) != 0) return std::nullopt;
    return text.substr(static_cast<std::size_t>(part.rm_so),
                       static_cast<std::size_t>(part.rm_eo - part.rm_so));
  }

 private:
  regex_t compiled_;
};

}  // namespace tiltproof
