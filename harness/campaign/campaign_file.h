// Campaign files: which scenarios a campaign flies, how often, and what it draws for each flight.
//
//   const CampaignSpec spec = ReadCampaignFile("night.yaml");  // throws ScenarioError
//   const std::string text = WriteCampaign(spec);
//
// docs/campaigns.md describes the file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "harness/scenario/key_visitor.h"

namespace tiltproof::harness {

// Distribution of a number or a word.
struct Distribution {
  enum class Kind : std::uint8_t {
    kUniform,     // between two numbers
    kLogUniform,  // the same, of the logarithm; both numbers have the same sign
    kChoice,      // each of the list is equally likely
  };
  Kind kind = Kind::kUniform;
  std::vector<NumberOrWord> values;
  friend bool operator==(const Distribution&, const Distribution&) = default;
};

// Draws for each flight.
struct DrawSpec {
  std::vector<std::string> types = {};  // patterns of fault types; empty: every type that the client can take
  bool swarm = true;                    // each flight draws from a random subset of the types
  std::int64_t faults_count_min = 1, faults_count_max = 3;
  // By type and parameter. Others: a severity over its range, words and places uniformly, the rest as in the
  // type's example.
  std::map<std::string, std::map<std::string, Distribution>> parameters = {};
  std::optional<Distribution> start_s = {}, length_s = {};  // none: anywhere in the flight
  // Every fault ends so long before the flight does, and the criteria must hold again at the end.
  std::optional<double> recover_s = {};
  friend bool operator==(const DrawSpec&, const DrawSpec&) = default;
};

// Ends a campaign before its last run.
struct StopSpec {
  std::int64_t failures_count = 0;  // 0: no limit
  std::optional<double> wall_s = {};
  friend bool operator==(const StopSpec&, const StopSpec&) = default;
};

inline constexpr std::int64_t kRunsMax = 1'000'000'000;

struct CampaignSpec {
  std::string name;
  std::vector<std::string> scenarios;  // files; of a campaign file relative to it
  std::int64_t runs_count = 1000;
  std::int64_t seed = 1;
  std::vector<std::string> firmware;  // builds that fly the same draws; empty: what each scenario says
  DrawSpec draw;
  StopSpec stop;
  friend bool operator==(const CampaignSpec&, const CampaignSpec&) = default;
};

// True if the file is YAML with the key `campaign` at its top. A file that cannot be read is none.
bool IsCampaignFile(const std::filesystem::path& file);

// The scenarios' paths are absolute in the result. `builds`: of the client's firmware; empty: any. Throws ScenarioError
// with every problem and its place.
CampaignSpec ReadCampaignFile(const std::filesystem::path& file,
                              std::span<const std::string_view> builds = {});
// The same for a text; `file` names it in messages, and the scenarios' paths begin at its folder.
CampaignSpec ParseCampaign(const std::string& text, const std::filesystem::path& file,
                           std::span<const std::string_view> builds = {});

// YAML that reads back as an equal spec, with every default written out.
std::string WriteCampaign(const CampaignSpec& spec);

// True if the name of a fault type fits a pattern, as file names fit one in a shell.
bool MatchesType(const std::string& pattern, std::string_view type);

}  // namespace tiltproof::harness
