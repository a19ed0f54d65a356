// Names the fields of a struct once, for everything that reads or writes them one by one: JSON files, messages
// between processes, and messages on the bus.
//
//   TILTPROOF_FIELDS(time_ns, cause)    // last in the struct Restart
//
// A visitor is called with the name of each field and, for each struct it is given, with that field:
//
//   Restart::Fields([](const char* name, const auto& field) { Print(name, field); }, restart);
//   Restart::Fields([](const char*, auto& to, const auto& from) { to = from; }, restart, another);
//
// The other structs need not have the same type, only fields of the same names.
#pragma once

#include <cstddef>
#include <utility>

// A macro is not expanded within itself, but its result is read again: each TILTPROOF_EXPAND does so four times as often
// as the one before, which is enough for 256 fields (more do not compile).
#define TILTPROOF_EXPAND(...) \
  TILTPROOF_EXPAND_4(TILTPROOF_EXPAND_4(TILTPROOF_EXPAND_4(TILTPROOF_EXPAND_4(__VA_ARGS__))))
#define TILTPROOF_EXPAND_4(...) \
  TILTPROOF_EXPAND_3(TILTPROOF_EXPAND_3(TILTPROOF_EXPAND_3(TILTPROOF_EXPAND_3(__VA_ARGS__))))
#define TILTPROOF_EXPAND_3(...) \
  TILTPROOF_EXPAND_2(TILTPROOF_EXPAND_2(TILTPROOF_EXPAND_2(TILTPROOF_EXPAND_2(__VA_ARGS__))))
#define TILTPROOF_EXPAND_2(...) \
  TILTPROOF_EXPAND_1(TILTPROOF_EXPAND_1(TILTPROOF_EXPAND_1(TILTPROOF_EXPAND_1(__VA_ARGS__))))
#define TILTPROOF_EXPAND_1(...) __VA_ARGS__
#define TILTPROOF_PARENTHESES ()

#define TILTPROOF_VISIT_FIELDS(name, ...) \
  visit(#name, of.name...);               \
  __VA_OPT__(TILTPROOF_VISIT_FIELDS_AGAIN TILTPROOF_PARENTHESES(__VA_ARGS__))
#define TILTPROOF_VISIT_FIELDS_AGAIN() TILTPROOF_VISIT_FIELDS
#define TILTPROOF_FIELDS(...)                                \
  template <class Visit, class... Like>                      \
  static constexpr void Fields(Visit&& visit, Like&... of) { \
    TILTPROOF_EXPAND(TILTPROOF_VISIT_FIELDS(__VA_ARGS__))    \
  }

namespace tiltproof {

template <class T>
concept HasFields = requires {
  T::Fields([](const char*) {});
};

namespace internal {
struct Anything {
  template <class T>
  operator T() const;  // only declared: it stands for a field's initial value
};
template <class T, std::size_t... i>
consteval bool TakesInitialValues(std::index_sequence<i...>) {
  return requires { T{(static_cast<void>(i), Anything())...}; };
}
}  // namespace internal

// True if the list of a struct has all of its fields. Code that copies structs asserts it: a field that is not in
// the list would be lost.
template <HasFields T>
consteval bool NamesEveryField() {
  constexpr std::size_t kNamed = [] {
    std::size_t count = 0;
    T::Fields([&count](const char*) { ++count; });
    return count;
  }();
  return internal::TakesInitialValues<T>(std::make_index_sequence<kNamed>()) &&
         !internal::TakesInitialValues<T>(std::make_index_sequence<kNamed + 1>());
}

}  // namespace tiltproof
