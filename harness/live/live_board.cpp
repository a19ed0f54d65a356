#include "harness/live/live_board.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "harness/reference/trajectory.h"
#include "harness/report/flight_pack.h"
#include "harness/report/json_fields.h"
#include "harness/run/supervisor_states.h"
#include "harness/score/signals.h"

namespace tiltproof::harness {
namespace {

// Signals that follow from a row.
constexpr std::array kComputed = {"position_error_m", "speed_m_s", "tilt_rad"};
constexpr int kReferencePointsCount = 400;

std::string Event(std::string_view name, std::string_view json) {
  return fmt::format("event: {}\ndata: {}\n\n", name, json);
}

void Append(std::string& json, double value) {
  if (std::isfinite(value))
    fmt::format_to(std::back_inserter(json), "{:.7g},", value);
  else
    json += "null,";
}

// The whole path that the vehicle is asked to fly, for the picture.
Json PathJson(const Scenario& scenario) {
  Json path = Json::array();
  try {
    const Trajectory trajectory(scenario.reference);
    for (int i = 0; i <= kReferencePointsCount; ++i) {
      const auto at = trajectory.At(scenario.duration_ns / kReferencePointsCount * i).position_m;
      path.push_back({at[0], at[1], at[2]});
    }
  } catch (const ReferenceError&) {
    // Recorded on another host.
  }
  return path;
}

}  // namespace

void LiveBoard::Begin(const LivePlan& plan) {
  ++flight_;
  flying_ = true;
  name_ = plan.name;
  FlightView view;
  view.scenario = plan.scenario;
  view.vehicle = plan.shape;
  std::vector<std::string> columns = Trace(TraceLayout(plan.vehicle, plan.scenario).columns).columns();
  for (std::size_t client = 0; client < plan.scenario.client_count(); ++client)
    columns.push_back(SupervisorStateColumn(plan.scenario, client));
  trace_ = Trace(columns);
  view.trace = trace_;
  view.bounds = BoundsOf(plan.scenario, columns);
  column_count_ = columns.size();
  columns.insert(columns.end(), kComputed.begin(), kComputed.end());
  Json json = HeadJson(view);
  json["flight"] = flight_;
  json["name"] = plan.name;
  json["expected"] = Name(plan.scenario.expected());
  json["seed"] = plan.scenario.seed;
  json["row"] = columns;
  json["path"] = PathJson(plan.scenario);
  head_ = JsonText(json);
  injected_.clear();
  rows_.clear();
  times_s_.clear();
  latest_.clear();
  notes_begin_ += notes_.size();
  notes_.clear();
  spacing_s_ = kSpacing_s;
}

void LiveBoard::AddRow(std::span<const double> row) {
  if (!flying_ || row.size() != column_count_ || !std::isfinite(row[0])) return;
  // In real time rows may come again, or from another flight's end.
  if (!latest_.empty() && row[0] <= latest_[0]) return;
  latest_.assign(row.begin(), row.end());
  // Times are on a grid: half a nanosecond is rounding.
  if (!times_s_.empty() && row[0] < times_s_.back() + spacing_s_ - 5e-10) return;
  Trace trace = trace_;
  std::copy(row.begin(), row.end(), trace.AppendRow().begin());
  std::string json = "[";
  for (const double value : row) Append(json, value);
  for (const char* name : kComputed) Append(json, ReadSignal(trace, name).front());
  json.back() = ']';
  times_s_.push_back(row[0]);
  rows_.push_back(std::move(json));
  if (rows_.size() > kRowsMax) Thin();
}

void LiveBoard::Thin() {
  for (std::size_t i = 0; 2 * i < rows_.size(); ++i) {
    std::swap(rows_[i], rows_[2 * i]);
    times_s_[i] = times_s_[2 * i];
  }
  rows_.resize((rows_.size() + 1) / 2);
  times_s_.resize(rows_.size());
  spacing_s_ *= 2;
}

void LiveBoard::Note(double time_s, std::string_view kind, std::string_view text) {
  notes_.push_back(JsonText(Json{{"time_s", time_s}, {"kind", kind}, {"text", text}}));
  if (notes_.size() <= kNotesMax) return;
  notes_.erase(notes_.begin());
  ++notes_begin_;
}

void LiveBoard::Inject(std::string_view id, std::string_view type, std::string_view target, double begin_s,
                       double end_s) {
  injected_.push_back(JsonText({{"flight", flight_},
                                {"fault", {{"id", id}, {"type", type}, {"target", target}}},
                                {"begin_s", begin_s},
                                {"end_s", end_s}}));
}

void LiveBoard::Finish(const std::string& name, const std::string& entry) {
  if (name == name_) flying_ = false;
  if (finished_.size() < kFinishedMax) finished_.push_back(entry);
}

void LiveBoard::SetStatus(const std::string& json) {
  if (json == status_) return;
  status_ = json;
  ++status_count_;
}

std::string LiveBoard::TakeUpdate(Seen& seen, std::size_t bytes_max) const {
  std::string text;
  for (; seen.finished < finished_.size() && text.size() < bytes_max; ++seen.finished)
    text += Event("finished", finished_[seen.finished]);
  if (seen.flight != flight_) {
    seen.flight = flight_;
    seen.until_s = -std::numeric_limits<double>::infinity();
    seen.over = false;
    seen.injected = 0;
    text += Event("flight", head_);
  }
  for (; seen.injected < injected_.size(); ++seen.injected)
    text += Event("injected", injected_[seen.injected]);
  seen.notes = std::max(seen.notes, notes_begin_);
  for (; seen.notes < notes_begin_ + notes_.size() && text.size() < bytes_max; ++seen.notes)
    text += Event("note", notes_[seen.notes - notes_begin_]);
  auto at = static_cast<std::size_t>(std::upper_bound(times_s_.begin(), times_s_.end(), seen.until_s) -
                                     times_s_.begin());
  if (at < rows_.size() && text.size() < bytes_max) {
    text += fmt::format("event: rows\ndata: {{\"flight\":{},\"rows\":[", flight_);
    for (; at < rows_.size() && text.size() < bytes_max; ++at) {
      text += rows_[at];
      text += ',';
      seen.until_s = times_s_[at];
    }
    text.back() = ']';
    text += "}\n\n";
  }
  if (flight_ > 0 && !flying_ && !seen.over && at == rows_.size()) {
    seen.over = true;
    text += Event("over", fmt::format("{{\"flight\":{}}}", flight_));
  }
  // A page that hears of the end listens no longer: everything else comes first.
  const bool is_all =
      at == rows_.size() && seen.notes == notes_begin_ + notes_.size() && seen.finished == finished_.size();
  if (is_all && seen.status != status_count_) {
    seen.status = status_count_;
    text += Event("status", status_);
  }
  return text;
}

}  // namespace tiltproof::harness
