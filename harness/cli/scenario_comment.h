// Comments above a scenario that the program writes.
#pragma once

#include <string>

namespace tiltproof::harness {

// Behind a "#", in lines of a width that can be read; further lines are indented.
std::string Comment(const std::string& text);

}  // namespace tiltproof::harness
