// Certainty of a margin: the levels that were flown, the pockets among them, and the seeds; as JSON and as text.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "harness/campaign/margins.h"

namespace tiltproof::harness {

// Adds `levels`, `pockets`, `survived_share`, `seeds` and `sure_share` (docs/margins.md). `repeat_count`: seeds of each
// level.
void AddScan(const Margin& margin, int repeat_count, nlohmann::ordered_json& json);
// Reads what AddScan added. Throws std::exception, naming the key, where it is damaged.
void TakeScan(const nlohmann::ordered_json& json, Margin& margin);

// Lines of text for a margin that is known. `unit` may be empty.
std::vector<std::string> ScanLines(const Margin& margin, int repeat_count, const std::string& unit);

}  // namespace tiltproof::harness
