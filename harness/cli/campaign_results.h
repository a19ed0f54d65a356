// `campaign compare` and `campaign merge`: what is done with campaigns that were flown.
#pragma once

#include <CLI/App.hpp>

#include "harness/cli/commands.h"

namespace tiltproof::harness {

void RegisterCampaignResults(CLI::App& campaign, CommandLine& line);

}  // namespace tiltproof::harness
