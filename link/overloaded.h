// One function out of several lambdas, for std::visit. A type of the variant that no lambda takes does not compile:
//
//   std::visit(Overloaded{[](const Reset&) { ... }, [](const Hang&) { ... }}, command.action);
#pragma once

namespace tiltproof {

template <class... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <class... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;  // clang before 17 does not deduce an aggregate

}  // namespace tiltproof
