// Checks of the lines between boards, and of faults on them.
#pragma once

#include <vector>

#include "faults/fault.h"
#include "harness/scenario/scenario.h"
#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {

// The scenario's `lines`. Reads their protocols, and fills in their places.
void CheckBoardLines(const YamlNode& root, Scenario& scenario, std::vector<YamlProblem>& problems);

// Finds the line of a fault that acts on one between boards. Does nothing for other faults.
void FindBoardLine(faults::FaultSpec& fault, const YamlNode& node, Scenario& scenario,
                   std::vector<YamlProblem>& problems);

}  // namespace tiltproof::harness
