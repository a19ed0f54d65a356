// Compounds in the list `faults`: {id, compound: [fault, ...], start_s, end_s}.
//
// A compound is only a notation: it gives its members a window where they state none. So it is resolved in
// the tree of the file, where each member keeps its place for messages. Readers of the tree see only faults.
#pragma once

#include <vector>

#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {

// Replaces each compound of the scenario `root` by its members. Appends to `problems`.
void ResolveCompounds(YamlNode& root, std::vector<YamlProblem>& problems);

}  // namespace tiltproof::harness
