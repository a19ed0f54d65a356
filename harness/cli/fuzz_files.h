// The files of a fuzz campaign: findings/NAME.yaml, each a resolved scenario that `tiltproof run` flies; corpus/, from which the
// next campaign in this folder begins; and fuzz.json.
//
//   FuzzFiles files("results/fuzz", " --client 'library:mine.so'");
//   for (const HostileSequence& sequence : files.ReadCorpus()) files.Add(sequence);
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "harness/campaign/fuzz.h"
#include "link/unix_socket.h"

namespace tiltproof::harness {

class FuzzFiles {
 public:
  // Makes the folders, and keeps others out of them for as long as it lives. `flags`: what `tiltproof run` needs beside the
  // file. Throws UsageError when they cannot be made or written, or another campaign uses them.
  FuzzFiles(std::filesystem::path folder, std::string flags);

  std::filesystem::path FileOf(const std::string& finding) const;  // by its name
  // `base`: as the campaign has it.
  void Write(const FuzzFinding& finding, const Scenario& base) const;
  // Findings of earlier campaigns, by name, in the order of names. A file that cannot be read is left out.
  std::vector<std::pair<std::string, HostileSequence>> ReadFindings() const;
  void Add(const HostileSequence& sequence) const;
  // In the order of their names; a name that begins with "." or ends with ".part" is none. Throws UsageError for a file that
  // is no sequence.
  std::vector<HostileSequence> ReadCorpus() const;
  void WriteSummary(const nlohmann::ordered_json& summary) const;
  // Summary by the command that wrote here last; null when there was none, or it is no longer readable.
  nlohmann::ordered_json ReadSummary() const;

  const std::filesystem::path& folder() const { return folder_; }
  // For a person: flies it again.
  std::string ReplayOf(const FuzzFinding& finding) const;

 private:
  std::filesystem::path folder_;
  std::string flags_;
  link::OwnedDescriptor lock_;
};

// Base of every flight of a campaign, without its faults: the vehicle is on a test stand, because hostile values cannot
// crash it there, and hovers by the reference.
Scenario FuzzBase(const std::string& firmware, std::shared_ptr<const link::Protocol> protocol,
                  const std::string& model);

}  // namespace tiltproof::harness
