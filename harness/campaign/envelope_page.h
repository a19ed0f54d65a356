// envelope.html: one page that shows an envelope, with links to the flights on both sides of each margin. It is made
// from envelope.json and from what stands beside it (envelope_sides.h).
//
//   const std::string html = EnvelopePage("results/envelope", ".", "tiltproof");
#pragma once

#include <filesystem>
#include <string>

namespace tiltproof::harness {

// True if a folder holds an envelope.
bool HoldsEnvelope(const std::filesystem::path& folder);

// `to_folder`: from the page's folder to the envelope's, for links. `program`: as it was called, for the commands that
// the page shows. A flight is linked when it is that of the level in levels/. Throws FileError, or std::runtime_error
// naming the file.
std::string EnvelopePage(const std::filesystem::path& folder, const std::filesystem::path& to_folder,
                         const std::string& program);

}  // namespace tiltproof::harness
