// The keys of a scenario file (harness/scenario/key_visitor.h).
#pragma once

#include "harness/scenario/key_visitor.h"
#include "harness/scenario/scenario.h"

namespace tiltproof::harness {

void DescribeScenario(KeyVisitor& visitor, Scenario& scenario);

}  // namespace tiltproof::harness
