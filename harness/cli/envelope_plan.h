// The plan of an envelope as its options ask for it.
#pragma once

#include "harness/campaign/envelope_search.h"
#include "harness/cli/envelope_options.h"

namespace tiltproof::harness {

// Builds of the shipped firmware first, then the firmware of users. Throws UsageError.
EnvelopePlan PlanEnvelope(const EnvelopeOptions& options);

}  // namespace tiltproof::harness
