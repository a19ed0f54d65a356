// The report of a run as `run` and `report` write it.
#pragma once

#include <string>

#include "harness/report/run_view.h"

namespace tiltproof::harness {

std::string PageOf(const RunView& view);

}  // namespace tiltproof::harness
