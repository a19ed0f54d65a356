#include "harness/cli/live_page.h"

#include <fmt/format.h>

#include "harness/cli/commands.h"
#include "harness/cli/interrupt_scope.h"
#include "harness/cli/report_command.h"
#include "harness/cli/suite.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_pack.h"
#include "harness/report/page_json.h"
#include "harness/report/report_page.h"
#include "harness/run/run_id.h"
#include "harness/score/headline.h"
#include "harness/terminal/terminal.h"
#include "link/check.h"
#include "link/named.h"

namespace tiltproof::harness {
namespace {

// Allows the page to ask its server, which the report may not do.
std::string AllowConnections(std::string page) {
  static constexpr std::string_view kPlace = "base-uri 'none'";
  const std::size_t place = page.find(kPlace);
  tiltproof::Check(place != std::string::npos, "the page says what it may do");
  return page.insert(place, "connect-src 'self'; ");
}

std::string Page(const std::vector<RunEntry>& runs, const Json& live,
                 const std::vector<std::string>& entries) {
  Json json = {{"version", Version()}, {"runs", Json::array()}, {"flights", Json::array()}, {"live", live}};
  json["left_out_count"] = 0;
  for (const RunEntry& run : runs) json["runs"].push_back(RunJson(run));
  for (const std::string& entry : entries) json["flights"].push_back(Json::parse(entry));
  return AllowConnections(RunPage(JsonText(json), ""));
}

Json Entry(const RunEntry& run, const FlightResult& result) {
  RunView view;
  view.runs.push_back(run);
  FlightEntry flight{.run = 0, .result = result, .margin = LeastMargin(result.score), .before = {}};
  return EntryJson(view, flight);
}

// Details of a flight that is over, as the report has it.
std::optional<std::string> Details(const std::filesystem::path& folder) {
  try {
    const FlightResult result = ReadVerdict(folder);
    ModelCache models;
    const LoadedScenario flown = LoadFlown(folder, models);
    return PackFlight(ViewFlight(folder, result, flown.scenario, ShapeOf(*flown.model)), {});
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

}  // namespace

LiveSocket ListenForPage(int port, const char* flag) {
  try {
    return ListenOnLoopback(port);
  } catch (const std::runtime_error& error) {
    throw UsageError(fmt::format("{}: {}", flag, error.what()));
  }
}

LivePage::LivePage(const LiveSocket& socket, const RunOptions& options, const FlightMeans& means,
                   const RunInfo& info, const std::filesystem::path& folder, std::vector<FlightJob>& jobs)
    : run_{folder, info, {}}, waits_(options.live_waits) {
  LiveOptions live;
  if (means.realtime) live.token = NewRunId();
  live.waits = waits_;
  live.bus = {.interface = means.interface, .peers = means.peers};
  const Json about = {{"buttons", means.realtime},
                      {"waits", waits_},
                      {"flights_count", jobs.size()},
                      {"folder", folder.string()}};
  live.page = [run = run_, about](const auto& entries) { return Page({run}, about, entries); };
  std::vector<LivePlan> plans;
  std::vector<std::filesystem::path> folders;
  for (const FlightJob& job : jobs) {
    numbers_[job.name] = plans.size();
    plans.push_back({job.name, job.scenario, job.model->signals(), ShapeOf(*job.model)});
    folders.push_back(folder / job.name);
  }
  live.details = [folders](std::size_t flight) -> std::optional<std::string> {
    if (flight >= folders.size()) return std::nullopt;
    return Details(folders[flight]);
  };
  const std::string token = live.token;
  live_ = std::make_unique<LiveProcess>(socket, std::move(live), std::move(plans));
  if (means.realtime) {
    const auto injections = [live = live_.get()] {
      Injections taken = live->TakeInjections();
      taken.add = WithInjected;
      return taken;
    };
    for (FlightJob& job : jobs) job.injections = injections;
  }
  for (std::size_t i = 0; i < jobs.size(); ++i)
    jobs[i].observe = [live = live_.get(), i] { return live->Observe(i); };
  Print(stderr, "tiltproof: live page: http://127.0.0.1:{}/{}\n", socket.port,
        token.empty() ? "" : "#token=" + token);
  if (waits_) Print(stderr, "tiltproof: the run waits for the button Start on that page\n");
}

void LivePage::Place(const std::string& flight, const BusPlace& place) {
  if (!place.run_id.empty()) live_->Place(numbers_.at(flight), place);
}

void LivePage::Finished(const FlightJob& job, const FlightResult& result) {
  const std::size_t number = numbers_.at(job.name);
  Json entry = Entry(run_, result);
  entry["tags"] = job.scenario.tags;
  if (std::filesystem::exists(run_.folder / job.name / "verdict.json"))
    entry["details"] = fmt::format("flights/{}", number);
  else
    PutResult(entry, result);
  live_->Finished(number, JsonText(entry));
}

void LivePage::Poll() {
  live_->Poll();
  if (live_->wants_abort()) InterruptScope::Interrupt();
}

std::unique_ptr<LiveProcess> ServeMonitor(int port, const dds::BusConfig& bus,
                                          const FindWatchTarget& target) {
  const LiveSocket socket = ListenForPage(port, "--http");
  LiveOptions live;
  live.bus = bus;
  live.target = target;
  live.page = [](const auto& entries) { return Page({}, {{"monitor", true}, {"buttons", false}}, entries); };
  live.load = [](const std::string& yaml) {
    LoadedScenario loaded = LoadAnnounced(yaml);
    const std::string name = loaded.scenario.name;
    return LivePlan{name, std::move(loaded.scenario), loaded.model->signals(), ShapeOf(*loaded.model)};
  };
  live.finish = [](const LivePlan& plan, const dds::Score& score) {
    FlightResult result;
    result.name = plan.name;
    result.expected = plan.scenario.expected();
    result.seed = plan.scenario.seed;
    try {
      result.score.verdict = Named<Verdict>(score.verdict);
      result.score.metrics = Json::parse(score.metrics_json).get<std::map<std::string, double>>();
    } catch (const std::exception&) {
      // Score of another version: without metrics.
    }
    result.score.reason = score.reason;
    Json entry = Entry({}, result);
    entry["tags"] = plan.scenario.tags;
    entry["problem"] =
        "A monitor knows no more of a flight that is over: its report is where `tiltproof run` ran.";
    PutResult(entry, result);
    return JsonText(entry);
  };
  auto process = std::make_unique<LiveProcess>(socket, std::move(live), std::vector<LivePlan>{});
  Print(stderr, "tiltproof: live page: http://127.0.0.1:{}/\n", socket.port);
  return process;
}

}  // namespace tiltproof::harness
