// envelope.html: one page that shows an envelope, with links to the flights on both sides of each margin. It is made
// from envelope.json and from what stands beside it:
//
//   levels/CLIENT/NAME.yaml        each side as a scenario: the level, the seed, and the verdict that it had
//   flights/CLIENT/TYPE/           a run with the flights of one type, where they were kept: report.html#flight=NAME
//
//   const std::string html = EnvelopePage("results/envelope", ".", "tiltproof");
#pragma once

#include <filesystem>
#include <string>

namespace tiltproof::harness {

// One side of a margin: the last level that was survived, or the first that failed.
struct EnvelopeSide {
  std::string client, type, place, side;  // as in envelope.json; place and side may be empty
  bool survives = false;

  std::string name() const;  // of its scenario and of its flight: "paper-frame.delay-both-fails"
  std::filesystem::path scenario_file() const;  // these two below the envelope's folder
  std::filesystem::path run_folder() const;
};

// True if a folder holds an envelope.
bool HoldsEnvelope(const std::filesystem::path& folder);

// `to_folder`: from the page's folder to the envelope's, for links. `program`: as it was called, for the commands that
// the page shows. A flight is linked when it is that of the level in levels/. Throws FileError, or std::runtime_error
// naming the file.
std::string EnvelopePage(const std::filesystem::path& folder, const std::filesystem::path& to_folder,
                         const std::string& program);

}  // namespace tiltproof::harness
