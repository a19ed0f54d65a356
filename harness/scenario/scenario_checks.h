// Checks that a scenario's keys fit each other and the world: files, models, formulas.
#pragma once

#include <vector>

#include "harness/scenario/reader.h"
#include "harness/scenario/scenario.h"
#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {

// `root` is what the scenario was read from; keys with problems have their defaults. Fills in what follows
// from other keys: model file, absolute path of a recorded reference, initial position. Appends to
// `problems`.
void CheckScenario(const YamlNode& root, const ReadOptions& options, Scenario& scenario,
                   std::vector<YamlProblem>& problems);

// The same for the last fault alone, which `fault` was read into. The rest of the scenario is valid.
void CheckLastFault(const YamlNode& fault, const ReadOptions& options, Scenario& scenario,
                    std::vector<YamlProblem>& problems);

}  // namespace tiltproof::harness
