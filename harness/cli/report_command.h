// The report of a run as `run` and `report` write it, and those of an envelope and a campaign.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "harness/cli/suite.h"
#include "harness/report/flight_view.h"
#include "harness/report/run_view.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

// `models`: vehicles that are loaded already.
std::string PageOf(const RunView& view, ModelCache models = {});

// Writes report.html of a whole run into its folder. None: it could not be written, and a warning says why; it changes
// no verdict.
std::optional<std::filesystem::path> WriteReport(const std::filesystem::path& folder, ModelCache models = {});
// The same of envelope.html.
std::optional<std::filesystem::path> WriteEnvelopeReport(const std::filesystem::path& folder,
                                                         const std::string& program);
// The same of campaign.html.
std::optional<std::filesystem::path> WriteCampaignReport(const std::filesystem::path& folder,
                                                         const std::string& program);

// The vehicle as the page draws it.
VehicleShape ShapeOf(const plant::VehicleModel& model);

}  // namespace tiltproof::harness
