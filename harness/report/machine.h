// The machine that computed a flight, as far as it can make two flights of one program differ.
//
//   info.machine = ThisMachine();
//   const std::string what = MachineDifference(info.machine, ThisMachine(), "then", "now");
//   // "libc 'glibc 2.36' then, 'glibc 2.41' now"
#pragma once

#include <map>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// By name: compiler (of this program), libc, processor (its model), processor_features (those by which glibc
// chooses its mathematics, as glibc sees them; absent where it has no choice).
using Machine = std::map<std::string, std::string>;

Machine ThisMachine();

// Empty when the two are equal, or one is unknown (files of older versions).
std::string MachineDifference(const Machine& a, const Machine& b, std::string_view in_a,
                              std::string_view in_b);

}  // namespace tiltproof::harness
