#include "harness/live/bus_observer.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <limits>
#include <optional>
#include <utility>

#include "harness/dds/messages.h"
#include "harness/report/json_fields.h"
#include "harness/run/record_stream.h"

namespace tiltproof::harness {

struct BusObserver::Impl final : RecordSink {
  Impl(boost::asio::io_context& loop_in, const dds::BusConfig& config, LiveBoard& board_in,
       std::function<void()> changed_in)
      : loop(loop_in),
        board(board_in),
        changed(std::move(changed_in)),
        bus(config),
        records(bus, dds::Onlooker{}, Wake()) {}

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
    counts.assign(plan.scenario.client_count(), {});
    board.Begin(plan);
  }

  void Look() {
    if (announced) {
      for (const auto& message : announced->Take()) Hear(message);
    }
    for (const auto& message : records.Take()) Hear(message);
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

  void Hear(const dds::Records& message) {
    if (!layout || message.run_id != run_id) return;
    try {
      ReadPacked(message.payload, *this);
    } catch (const std::exception&) {
      // A node of another version wrote it: what could be read is shown.
    }
  }

  void Write(const Record& record) override {
    const std::size_t client = record.client.value_or(0);
    if (client >= counts.size()) return;
    if (const auto* event = std::get_if<record::Event>(&record.body)) {
      board.Note(ToSeconds(record.time_ns), event->kind, event->text);
    } else if (const auto* counters = std::get_if<record::Counters>(&record.body)) {
      counts[client] = counters->counts;
    } else if (const auto* of_plant = std::get_if<record::Row>(&record.body)) {
      if (of_plant->values.size() != layout->columns.size()) return;
      row = of_plant->values;
      for (std::size_t i = 0; i < counts.size(); ++i)
        PutCounters(counts[i], std::span(row).subspan(layout->link_counters + i * kLineCounters));
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
  AllCounts counts;  // as last heard
  std::vector<double> row;
  std::shared_ptr<char> alive = std::make_shared<char>();
  dds::Bus bus;
  dds::Subscriber<dds::Records> records;
  std::optional<dds::Subscriber<dds::RunScenario>> announced;
  std::optional<dds::Subscriber<dds::Score>> scores;
};

BusObserver::BusObserver(boost::asio::io_context& loop, const dds::BusConfig& config, LiveBoard& board,
                         std::function<void()> changed)
    : impl_(std::make_unique<Impl>(loop, config, board, std::move(changed))) {}
BusObserver::~BusObserver() = default;

void BusObserver::Follow(const std::string& run_id, const LivePlan& plan) { impl_->Begin(run_id, plan); }

void BusObserver::FollowAnnounced(Loader load, Finisher finish) {
  impl_->load = std::move(load);
  impl_->finish = std::move(finish);
  impl_->scores.emplace(impl_->bus, impl_->Wake());
  impl_->announced.emplace(impl_->bus, impl_->Wake());
  impl_->Look();
}

}  // namespace tiltproof::harness
