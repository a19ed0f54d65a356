// The keys of one item of `faults`: which there are follows from its type, as the registry of faults
// describes it.
#pragma once

#include "faults/fault.h"
#include "harness/scenario/keys.h"

namespace tiltproof::harness {

void DescribeFault(KeyVisitor& visitor, faults::FaultSpec& fault);

}  // namespace tiltproof::harness
