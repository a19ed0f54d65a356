// report.html: one file that shows a run, for people. It opens from the disk, and loads nothing from anywhere.
//
//   const std::string html = ReportPage(ViewRuns({{folder, ""}}), load);
//
// The page itself is harness/report/page, built beforehand and part of the program. The data stand in it as JSON and as
// base64, never as markup or script.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "harness/report/flight_view.h"
#include "harness/report/run_view.h"

namespace tiltproof::harness {

// Facts on a flight from its scenario.
struct FlownFlight {
  Scenario scenario;
  std::optional<VehicleShape> vehicle;
};
// May throw: then the flight is shown as far as results.json has it.
using FlightLoader = std::function<FlownFlight(const std::filesystem::path& flight_folder)>;

struct PageLimits {
  std::size_t flights_max = 20'000;            // in the table; those that are not green first
  std::size_t details_bytes_max = 64'000'000;  // of all flights together, as they stand in the page
  std::size_t results_bytes_max = 16'000'000;  // of the results of flights without details
  std::size_t bytes_aim = 13'000'000;          // of all details: close-ups get what is left of it
};

std::string ReportPage(const RunView& view, const FlightLoader& load, const PageLimits& limits = {});

// The page with `run_json`, which src/main.js reads, and the script elements of flights' details.
std::string RunPage(std::string_view run_json, std::string_view details);

// The pages without data; and the place in each where they go.
std::string_view PageTemplate();
std::string_view EnvelopePageTemplate();
std::string_view CampaignPageTemplate();
std::string_view IntegrityPageTemplate();
inline constexpr std::string_view kDataPlace = "@TILTPROOF_DATA@";
std::string PageWith(std::string_view page, const std::string& data);

std::string Base64(std::string_view bytes);
// For the inside of a script element: nothing in it ends the element.
std::string ScriptSafe(std::string_view json);

}  // namespace tiltproof::harness
