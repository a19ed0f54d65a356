// The keys of one item of `faults`. They follow from its type, as the registry of faults describes it.
#pragma once

#include <string>

#include "faults/fault.h"
#include "harness/scenario/keys.h"

namespace tiltproof::harness {

void DescribeFault(KeyVisitor& visitor, faults::FaultSpec& fault);

// Several faults under one name, with a window for those that state none.
struct Compound {
  std::string id;
  TimeNs start_ns = kPowerOn, end_ns = kNever;
};

// Its keys besides `compound`, the list of its members.
void DescribeCompound(KeyVisitor& visitor, Compound& compound);

}  // namespace tiltproof::harness
