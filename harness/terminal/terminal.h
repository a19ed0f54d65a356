// Printing to a terminal. Texts of nodes, firmware and files may hold anything: escape sequences that clear
// the screen, line breaks that forge a line of the harness, bytes that are not UTF-8. Print makes them
// harmless; the harness prints by nothing else.
//
//   Print(stderr, "warning: {}\n", text);       // every text among the arguments stays on one line
//   Print(stderr, "{}\n", TextLines(error.what())); // it may have several lines
//   Print(stdout, "{}\n", OfOurs(coloured));    // as it is
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace tiltproof::harness {

// `text` with every byte that is not printable UTF-8 as \xNN: control characters (C0, DEL, C1), line breaks
// and tabs, characters that change the direction of writing or break lines (U+2028, U+202A and the like), and
// what is not UTF-8.
std::string Plain(std::string_view text);

// Text of several lines: its line breaks and tabs stay.
struct TextLines {
  explicit TextLines(std::string_view text_in) : text(text_in) {}
  std::string text;
};
// Text with escape sequences of this program. Foreign text in it has gone through Plain.
struct OfOurs {
  explicit OfOurs(std::string_view text_in) : text(text_in) {}
  std::string text;
};

namespace internal {

template <class T>
auto Printable(const T& value) {
  if constexpr (std::is_convertible_v<const T&, std::string_view>) {
    return Plain(value);
  } else {
    static_assert(std::is_arithmetic_v<T>, "format it to text first: only text can be made plain");
    return value;
  }
}
std::string Printable(const TextLines& lines);
inline std::string Printable(const OfOurs& text) { return text.text; }
void Write(std::FILE* to, const std::string& text);

template <class T>
using PrintableOf = decltype(Printable(std::declval<const T&>()));

}  // namespace internal

// Throws std::system_error when `to` cannot be written, unless it is standard error, where such an error
// would be printed.
template <class... Args>
void Print(std::FILE* to, fmt::format_string<internal::PrintableOf<Args>...> format, const Args&... args) {
  internal::Write(to, fmt::format(format, internal::Printable(args)...));
}

}  // namespace tiltproof::harness
