// Compounds in the list `faults`: {id, compound: [fault, ...], start_s, end_s}.
//
// A compound is a way to write, not a thing that flies: it gives its members a window where they state none. So it is
// resolved in the tree of the file, where each member keeps its place for messages; what reads the tree meets faults alone.
#pragma once

#include <vector>

#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {

// Puts the members of each compound of the scenario `root` into its place. Appends to `problems`.
void ResolveCompounds(YamlNode& root, std::vector<YamlProblem>& problems);

}  // namespace tiltproof::harness
