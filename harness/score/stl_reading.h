// Reading of a formula over time: the lowest, or the highest, of its conditions on single rows.
//
//   ReadingOf(*Parse("always[5,60](position_error_m <= 1.0)", {columns, fault_ids}));  // kLowest
#pragma once

#include "harness/formula/formula.h"
#include "harness/score/stl.h"

namespace tiltproof::harness::stl {

// kLowest (kHighest) when an always (an eventually) stands above all that the formula asks of single rows.
OverTimeReading ReadingOf(const Node& formula);

// True if a node is the lowest (or the highest) of what its operands are, at one time or over a window. `negated`: it
// is under an odd number of negations of the whole formula.
bool Folds(const Node& node, bool lowest, bool negated);
// True if its left operand is under one more negation.
bool FlipsLeft(const Node& node);

// True if its value at a row depends on later rows.
bool LooksAhead(const Node& node);

}  // namespace tiltproof::harness::stl
