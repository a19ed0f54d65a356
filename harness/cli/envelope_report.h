// Results of `tiltproof envelope` as text.
#pragma once

#include <string>
#include <vector>

#include "harness/campaign/envelope_search.h"

namespace tiltproof::harness {

// Lines of at most 80 columns with one or two clients.
std::string EnvelopeTable(const EnvelopeSearch& search);
// One line per type and reason.
std::vector<std::string> NotApplicableLines(const EnvelopeSearch& search);
std::string EnvelopeMapText(const EnvelopeMap& map);

}  // namespace tiltproof::harness
