#include "harness/cli/report_command.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <functional>
#include <memory>

#include "harness/campaign/campaign_page.h"
#include "harness/campaign/envelope_page.h"
#include "harness/cli/run_folder.h"
#include "harness/cli/shared_options.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/report_page.h"
#include "harness/terminal/terminal.h"

namespace tiltproof::harness {
namespace {

struct ReportOptions {
  std::vector<std::filesystem::path>
      runs;                           // folders of runs, or of flights; or one of an envelope or a campaign
  std::filesystem::path out;          // empty: report.html in the only run's folder, or here
  std::filesystem::path baseline;     // empty: none
  std::string program = "tiltproof";  // as it was called, for commands on the page
};

std::vector<double> Numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

std::optional<std::filesystem::path> Written(const std::filesystem::path& file,
                                             const std::function<std::string()>& page) {
  try {
    WriteFile(file, page());
    return file;
  } catch (const std::exception& error) {
    Print(stderr, "warning: no report: {}\n", error.what());
    return std::nullopt;
  }
}

// The page shows what is left of such a flight.
void WarnOfChanges(const std::filesystem::path& flight) {
  try {
    CheckFlightFiles(flight);
    if (HasEnded(flight)) ReadVerdict(flight);
  } catch (const FileError& error) {
    Print(stderr, "warning: {}\n", error.what());
  }
}

// The page of an envelope or a campaign: `name`.html beside its files.
int ReportSearch(const ReportOptions& options, const std::string& name, decltype(EnvelopePage)& page) {
  if (options.runs.size() > 1)
    throw UsageError(fmt::format("report: the {} has a page of its own: give its folder alone", name));
  if (!options.baseline.empty())
    throw UsageError(fmt::format("report: --baseline is for runs; this is a folder of `{}`", name));
  namespace fs = std::filesystem;
  const fs::path& folder = options.runs.front();
  const fs::path out = options.out.empty() ? folder / (name + ".html") : options.out;
  const fs::path to_folder = fs::relative(folder, fs::absolute(out).parent_path());
  WriteFile(out, page(folder, to_folder, options.program));
  Print(stdout, "report: {}\n", out.string());
  return kExitGreen;
}

}  // namespace

VehicleShape ShapeOf(const plant::VehicleModel& model) {
  VehicleShape shape;
  shape.name = model.name;
  // The main body's first; a vehicle may have shapes on its hinges only.
  const auto on_base = std::find_if(model.shapes.begin(), model.shapes.end(),
                                    [](const plant::CollisionShape& each) { return !each.hinge; });
  const plant::CollisionShape collision = on_base == model.shapes.end() ? plant::CollisionShape() : *on_base;
  Eigen::Vector3d size = collision.size_m;
  if (collision.kind == plant::CollisionShape::Kind::kSphere) size.setConstant(2 * collision.size_m.x());
  if (collision.kind == plant::CollisionShape::Kind::kCylinder)
    size = {2 * collision.size_m.x(), 2 * collision.size_m.x(), collision.size_m.y()};
  shape.body_size_m = Numbers((collision.R_LS * size).cwiseAbs());
  shape.body_position_m = Numbers(collision.p_LS_m);
  const VehicleSignals signals = model.signals();
  for (std::size_t i = 0; i < model.rotors.size(); ++i) {
    const plant::Rotor& from = model.rotors[i];
    RotorShape& rotor = shape.rotors.emplace_back();
    rotor.name = from.name;
    rotor.force_max_n = from.force_max_n;
    rotor.force = signals.inputs[i].name;
    if (!from.hinge) {
      rotor.position_m = rotor.hinge_point_m = Numbers(from.p_LR_m);
      rotor.hinge_axis = Numbers(Eigen::Vector3d::Zero());
      rotor.thrust_axis = Numbers(from.thrust_axis_L);
      continue;
    }
    const plant::Hinge& hinge = model.hinges[*from.hinge];
    rotor.position_m = Numbers(hinge.p_BT_m + hinge.R_BT * from.p_LR_m);
    rotor.hinge_point_m = Numbers(hinge.p_BH_m);
    rotor.hinge_axis = Numbers(hinge.axis_B);
    rotor.thrust_axis = Numbers(hinge.R_BT * from.thrust_axis_L);
    constexpr std::size_t kFirstHinge = 6;  // of the states, behind position and attitude
    rotor.angle = signals.states[kFirstHinge + *from.hinge].name;
  }
  return shape;
}

std::string PageOf(const RunView& view, ModelCache models) {
  return ReportPage(view, [&models](const std::filesystem::path& folder) {
    LoadedScenario flown = LoadFlown(folder, models);
    return FlownFlight{std::move(flown.scenario), ShapeOf(*flown.model)};
  });
}

std::optional<std::filesystem::path> WriteReport(const std::filesystem::path& folder, ModelCache models) {
  return Written(folder / "report.html", [&] { return PageOf(ViewRuns({{folder, ""}}), std::move(models)); });
}

std::optional<std::filesystem::path> WriteEnvelopeReport(const std::filesystem::path& folder,
                                                         const std::string& program) {
  return Written(folder / "envelope.html", [&] { return EnvelopePage(folder, ".", program); });
}

std::optional<std::filesystem::path> WriteCampaignReport(const std::filesystem::path& folder,
                                                         const std::string& program) {
  return Written(folder / "campaign.html", [&] { return CampaignPage(folder, ".", program); });
}

namespace {

int ReportCommand(const ReportOptions& options) {
  for (const auto& path : options.runs)
    if (HoldsEnvelope(path)) return ReportSearch(options, "envelope", EnvelopePage);
  for (const auto& path : options.runs)
    if (HoldsCampaign(path)) return ReportSearch(options, "campaign", CampaignPage);
  std::vector<ReportedRun> runs;
  for (const auto& path : options.runs) {
    const OldRun run = OpenRun(path);
    for (const auto& folder : run.scenario_folders) WarnOfChanges(folder);
    runs.push_back({run.folder, run.whole ? "" : run.scenario_folders.front().filename().string()});
  }
  RunView view = ViewRuns(runs);
  for (const auto& run : view.runs)
    if (!run.problem.empty()) Print(stderr, "warning: {}\n", run.problem);
  if (!options.baseline.empty()) {
    const OldRun baseline = OpenRun(options.baseline);
    try {
      CompareWith(view, baseline.folder);
    } catch (const std::runtime_error& error) {
      throw UsageError(error.what());
    }
  }
  std::filesystem::path out = options.out;
  if (out.empty())
    out = (runs.size() > 1               ? std::filesystem::path()
           : runs.front().flight.empty() ? runs.front().folder
                                         : runs.front().folder / runs.front().flight) /
          "report.html";
  WriteFile(out, PageOf(view));
  Print(stdout, "report: {}\n", out.string());
  return kExitGreen;
}

}  // namespace

void RegisterReport(CLI::App& program, CommandLine& line) {
  const auto options = std::make_shared<ReportOptions>();
  options->program = line.words.front();
  CLI::App* command =
      program.add_subcommand("report", "Write one page that shows runs, for a browser (report.html)");
  command
      ->add_option("RUN", options->runs,
                   "Results folders of runs, or of scenarios in them; or one of an envelope or a campaign")
      ->required();
  command->add_option("--out", options->out,
                      "The file (default: report.html in the folder of the only RUN, otherwise here)");
  command->add_option("--baseline", options->baseline, "Also show what changed since this run");
  SetAction(*command, line, [options] { return ReportCommand(*options); });
}

}  // namespace tiltproof::harness
