#include "harness/cli/watch_targets.h"

#include <fmt/format.h>

#include <memory>
#include <stdexcept>
#include <system_error>

#include "harness/cli/commands.h"
#include "harness/report/results.h"
#include "harness/run/realtime/realtime_flight.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

std::string PlaceText(const BusPlace& place) {
  return fmt::format("DDS domain {}, tag '{}'", place.domain, place.tag);
}

WatchTarget WatchTargetNow(const fs::path& folder) {
  const RunInfo info = ReadRunInfo(folder);
  std::optional<BusPlace> place;
  // The last one flies, or has flown last.
  for (const PlannedFlight& flight : info.flights)
    if (flight.bus) place = flight.bus;
  if (info.mode != "realtime")
    return {{},
            fmt::format("The run in {} flies in lockstep, and no monitor can hear it: fly it with `--live`.",
                        folder.string())};
  if (!place) return {{}, fmt::format("No flight of the run in {} is on the bus yet.", folder.string())};
  return {place, fmt::format("Listening on {}, to the run in {}.", PlaceText(*place), folder.string())};
}

// Reads run.json when it is another one than before.
class RunReader {
 public:
  explicit RunReader(fs::path folder) : folder_(std::move(folder)) {}

  WatchTarget Look() {
    // `latest` may be another run by now.
    const fs::path folder = fs::canonical(folder_);
    const auto written = fs::last_write_time(folder / "run.json");
    if (folder != read_ || written != written_) target_ = WatchTargetNow(folder);
    read_ = folder;
    written_ = written;
    return target_;
  }

 private:
  fs::path folder_, read_;
  fs::file_time_type written_;
  WatchTarget target_;
};

}  // namespace

FindWatchTarget WatchTargetAt(const BusPlace& place) {
  std::string text = fmt::format("Listening on {}. ", PlaceText(place));
  if (place.tag == kAttachTag)
    text +=
        "These are nodes that were started by hand. A run that starts its nodes itself has a tag of its "
        "own: ";
  text += "listen to it with `tiltproof node monitor --http --run results/latest`.";
  return [target = WatchTarget{place, std::move(text)}] { return target; };
}

FindWatchTarget WatchTargetOfRun(const fs::path& folder) {
  const auto reader = std::make_shared<RunReader>(folder);
  try {
    reader->Look();
  } catch (const std::exception& error) {
    throw UsageError(
        fmt::format("--run {}: no results of a run, as results/latest: {}", folder.string(), error.what()));
  }
  return [reader, last = WatchTarget()]() mutable {
    try {
      last = reader->Look();
    } catch (const std::exception&) {
      // Between two runs, or while it is written.
    }
    return last;
  };
}

}  // namespace tiltproof::harness
