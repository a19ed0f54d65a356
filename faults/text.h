// Small helpers for messages.
#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

namespace tiltproof::faults {

std::string Concat(std::initializer_list<std::string_view> parts);
// "a, b, c"
std::string Joined(std::span<const std::string_view> names);
// "0.001", "1e+06": short, and the same on every machine.
std::string NumberText(double value);

}  // namespace tiltproof::faults
