// Comments above a scenario that the program writes.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// Behind a "#", in lines of a width that can be read; further lines are indented.
std::string Comment(const std::string& text);

// Checks, before anything is flown, that --out may be written: only a file that begins with these words is written
// over. Throws UsageError.
void CheckOwnFile(const std::filesystem::path& out, std::string_view first_words);

}  // namespace tiltproof::harness
