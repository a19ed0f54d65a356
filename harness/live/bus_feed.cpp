#include "harness/live/bus_feed.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <limits>
#include <optional>
#include <utility>

#include "harness/dds/messages.h"
#include "harness/report/json_fields.h"

namespace tiltproof::harness {

struct BusFeed::Impl {
  Impl(boost::asio::io_context& loop_in, const dds::BusConfig& config, LiveBoard& board_in,
       std::function<void()> changed_in)
      : loop(loop_in),
        board(board_in),
        changed(std::move(changed_in)),
        bus(config),
        rows(bus, dds::Onlooker{}, Wake()),
        events(bus, dds::Onlooker{}, Wake()) {}

  std::function<void()> Wake() {
    return [this, alive = std::weak_ptr(alive)] {
      boost::asio::post(loop, [this, alive] {
        if (!alive.expired()) Look();
      });
    };
  }

  void Begin(const std::string& id, const LivePlan& flight) {
    run_id = id;
    plan = flight;
    layout.emplace(plan.vehicle, plan.scenario);
    counts.clear();
    board.Begin(plan);
  }

  void Look() {
    if (announced) {
      for (const auto& message : announced->Take()) Hear(message);
    }
    for (const auto& message : rows.Take()) Hear(message);
    for (const auto& event : events.Take()) {
      if (event.run_id == run_id && event.kind != "firmware_log")
        board.Note(ToSeconds(event.time_ns), event.kind, event.text);
    }
    if (scores) {
      for (const auto& score : scores->Take())
        if (score.run_id == run_id && board.is_flying()) board.Finish(plan.name, finish(plan, score));
    }
    changed();
  }

  void Hear(const dds::RunScenario& message) {
    if (message.run_id == run_id) return;
    try {
      Begin(message.run_id, load(message.scenario_yaml));
      board.SetStatus(JsonText({{"phase", "flying"}, {"text", ""}}));
    } catch (const std::exception& error) {
      // The scenario is of another version, or of a vehicle that this host does not have.
      board.SetStatus(
          JsonText({{"phase", "flying"},
                    {"text", std::string("a flight that cannot be shown here: ") + error.what()}}));
    }
  }

  void Hear(const dds::TraceRows& message) {
    if (!layout || message.run_id != run_id || message.column_count == 0) return;
    const auto columns = static_cast<std::size_t>(message.column_count);
    const std::size_t counters = layout->active - layout->link_counters;
    const bool of_plant = columns == layout->columns.size();
    for (std::size_t at = 0; at + columns <= message.values.size(); at += columns) {
      const auto begin = message.values.begin() + static_cast<std::ptrdiff_t>(at);
      const auto end = begin + static_cast<std::ptrdiff_t>(columns);
      if (!of_plant) {
        // The link node's: the time, and its counters.
        if (columns == 1 + counters) counts.assign(begin + 1, end);
        continue;
      }
      row.assign(begin, end);
      std::copy(counts.begin(), counts.end(),
                row.begin() + static_cast<std::ptrdiff_t>(layout->link_counters));
      row.resize(board.column_count(), std::numeric_limits<double>::quiet_NaN());
      board.AddRow(row);
    }
  }

  boost::asio::io_context& loop;
  LiveBoard& board;
  const std::function<void()> changed;
  Loader load;
  Finisher finish;
  std::string run_id;  // of the flight that is shown
  LivePlan plan;
  std::optional<TraceLayout> layout;
  std::vector<double> counts, row;
  std::shared_ptr<char> alive = std::make_shared<char>();
  dds::Bus bus;
  dds::Subscriber<dds::TraceRows> rows;
  dds::Subscriber<dds::RunEvent> events;
  std::optional<dds::Subscriber<dds::RunScenario>> announced;
  std::optional<dds::Subscriber<dds::Score>> scores;
};

BusFeed::BusFeed(boost::asio::io_context& loop, const dds::BusConfig& config, LiveBoard& board,
                 std::function<void()> changed)
    : impl_(std::make_unique<Impl>(loop, config, board, std::move(changed))) {}
BusFeed::~BusFeed() = default;

void BusFeed::Follow(const std::string& run_id, const LivePlan& plan) { impl_->Begin(run_id, plan); }

void BusFeed::FollowAnnounced(Loader load, Finisher finish) {
  impl_->load = std::move(load);
  impl_->finish = std::move(finish);
  impl_->scores.emplace(impl_->bus, impl_->Wake());
  impl_->announced.emplace(impl_->bus, impl_->Wake());
  impl_->Look();
}

}  // namespace tiltproof::harness
