// Signatures: in how many different ways a campaign's flights fail. Pure.
//
//   const std::string first = FirstSignature(run);  // "upright,diverged,clock.drift+wire.drop"
//   if (chooser.Choose(first)) Use(run);
//
// The first signature of a failure is the criterion that decided, how the flight ended, and the types of the faults that
// were active then. Up to three flights of each are minimised; the final signature has the types that the smallest
// scenario still needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/campaign/campaign_store.h"

namespace tiltproof::harness {

// CRITERION,END,TYPE+TYPE with the types in the order of the alphabet, each once; "no_fault" stands for none. It is also
// the name of a folder: a criterion with other characters than letters, digits, "._-" gets "_" and a hash, and more than
// kTypesNamedMax types are a number and a hash.
std::string SignatureText(std::string_view criterion, std::string_view end, std::vector<std::string> types);
inline constexpr std::size_t kTypesNamedMax = 6;

// The types in it. Of a signature with too many types, their number and hash.
std::vector<std::string> TypesOf(std::string_view signature);

// Empty for a run that did not fail. Its types are those of faults that acted and whose window holds the time of the
// violation; where there is no such fault, or no such time, those of all that acted and had started by then.
std::string FirstSignature(const CampaignRun& run);

inline constexpr std::size_t kMinimisedPerSignature = 3;

// Chooses the flights that are minimised: the first ones of each first signature, by number. So shards of a campaign
// minimise all that the whole campaign does.
class MinimisedChooser {
 public:
  // Failures in the order of their numbers. True: this flight is minimised.
  bool Choose(const std::string& first_signature) {
    return ++counts_[first_signature] <= kMinimisedPerSignature;
  }

 private:
  std::map<std::string, std::size_t> counts_;
};

// A failure with its first signature, and what is known of it.
struct FirstFailure {
  std::uint64_t run = 0;
  std::string first_signature;
  // Only for those that were minimised.
  std::optional<CampaignFailure> minimised{};
};

// The final signature of each. A flight that was not minimised has the one that most of the minimised flights with its
// first signature have, of equally many the first; where none was minimised, its first signature. `failures`: in the
// order of the runs.
std::vector<CampaignFailure> FinalFailures(std::span<const FirstFailure> failures);

}  // namespace tiltproof::harness
