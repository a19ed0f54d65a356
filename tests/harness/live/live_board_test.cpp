#include "harness/live/live_board.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "harness/live/live_server.h"
#include "tests/support/tiltrotor_signals.h"

namespace tiltproof::harness {
namespace {

using Json = nlohmann::json;

constexpr double kPeriod_s = 0.012;

LivePlan Plan(double duration_s = 60) {
  LivePlan plan{.name = "hover", .scenario = {}, .vehicle = testing::TiltrotorSignals(), .shape = {}};
  plan.scenario.name = "hover";
  plan.scenario.duration_ns = FromSeconds(duration_s);
  return plan;
}

// A row at `time_s`: each number of it is its column's place plus the time.
std::vector<double> Row(const LiveBoard& board, double time_s) {
  std::vector<double> row(board.column_count());
  for (std::size_t i = 0; i < row.size(); ++i) row[i] = static_cast<double>(i) + time_s;
  row[0] = time_s;
  row.back() = std::numeric_limits<double>::quiet_NaN();
  return row;
}

struct Event {
  std::string name;
  Json data;
};
std::vector<Event> Events(const std::string& text) {
  std::vector<Event> events;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t line = text.find('\n', at), end = text.find("\n\n", at);
    EXPECT_EQ(text.substr(at, 7), "event: ");
    EXPECT_EQ(text.substr(line + 1, 6), "data: ");
    events.push_back(
        {text.substr(at + 7, line - at - 7), Json::parse(text.substr(line + 7, end - line - 7))});
    at = end + 2;
  }
  return events;
}
std::vector<double> Times(const std::vector<Event>& events) {
  std::vector<double> times;
  for (const Event& event : events)
    if (event.name == "rows")
      for (const Json& row : event.data["rows"]) times.push_back(row[0]);
  return times;
}

TEST(LiveBoard, TellsAFlightAndItsRowsOnce) {
  LiveBoard board;
  LiveBoard::Seen seen;
  EXPECT_TRUE(board.TakeUpdate(seen).empty());
  board.Begin(Plan());
  for (int i = 0; i < 8; ++i) board.AddRow(Row(board, i * kPeriod_s));
  const auto events = Events(board.TakeUpdate(seen));
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].name, "flight");
  EXPECT_EQ(events[0].data["name"], "hover");
  EXPECT_EQ(events[0].data["row"].size(), events[1].data["rows"][0].size());
  // Every fourth row.
  EXPECT_EQ(Times(events), (std::vector<double>{0, 0.048}));
  const Json row = events[1].data["rows"][1];
  for (std::size_t i = 1; i < board.column_count() - 1; ++i)
    EXPECT_NEAR(row[i].get<double>(), static_cast<double>(i) + 0.048, 1e-5);
  EXPECT_TRUE(row[board.column_count() - 1].is_null());  // no state of a supervisor
  EXPECT_TRUE(board.TakeUpdate(seen).empty());
  board.Note(0.1, "reset", "by \"hand\"\nof <b>");
  board.Finish("hover", R"({"name":"hover"})");
  const auto rest = Events(board.TakeUpdate(seen));
  ASSERT_EQ(rest.size(), 3U);
  EXPECT_EQ(rest[0].name, "finished");
  EXPECT_EQ(rest[1].data["text"], "by \"hand\"\nof <b>");
  EXPECT_EQ(rest[2].name, "over");
  EXPECT_TRUE(board.TakeUpdate(seen).empty());
}

TEST(LiveBoard, StaysSmallHoweverLongTheFlight) {
  LiveBoard board;
  board.Begin(Plan(14'400));
  const int rows = static_cast<int>(7200 / kPeriod_s);
  for (int i = 0; i < rows; ++i) board.AddRow(Row(board, i * kPeriod_s));
  LiveBoard::Seen seen;
  std::vector<double> times;
  for (std::string text = board.TakeUpdate(seen); !text.empty(); text = board.TakeUpdate(seen)) {
    // A row more than asked for, and the head.
    EXPECT_LT(text.size(), 100'000U);
    for (const double time : Times(Events(text))) times.push_back(time);
  }
  EXPECT_LE(times.size(), LiveBoard::kRowsMax);
  EXPECT_GE(times.size(), LiveBoard::kRowsMax / 2 - 1);
  EXPECT_EQ(times.front(), 0.0);
  EXPECT_GT(times.back(), 7190);
  const double spacing = times[1] - times[0];
  for (std::size_t i = 1; i < times.size(); ++i) EXPECT_NEAR(times[i] - times[i - 1], spacing, 1e-6);
}

TEST(LiveBoard, WhoWasAwayGetsWhatIsThereNow) {
  LiveBoard board;
  LiveBoard::Seen seen;
  board.Begin(Plan());
  board.AddRow(Row(board, 0));
  board.TakeUpdate(seen);
  // Two flights, and the third flies.
  for (const char* entry : {"{\"n\":1}", "{\"n\":2}"}) {
    board.Finish("hover", entry);
    board.Begin(Plan());
  }
  board.AddRow(Row(board, 0.5));
  const auto events = Events(board.TakeUpdate(seen));
  std::vector<std::string> names;
  for (const Event& event : events) names.push_back(event.name);
  EXPECT_EQ(names, (std::vector<std::string>{"finished", "finished", "flight", "rows"}));
  EXPECT_EQ(Times(events), std::vector<double>{0.5});
  // Rows that come again, of another flight, or without a time.
  board.AddRow(Row(board, 0.5));
  board.AddRow(Row(board, 0.2));
  board.AddRow(Row(board, std::nan("")));
  board.AddRow(std::vector<double>(3, 1.0));
  EXPECT_TRUE(board.TakeUpdate(seen).empty());
}

// A page that hears that the run has ended listens no longer.
TEST(LiveBoard, TheEndOfTheRunIsTheLastEvent) {
  LiveBoard board;
  board.Begin(Plan());
  for (int i = 0; i < 2000; ++i) board.AddRow(Row(board, i * kPeriod_s));
  board.Note(1, "reset", "a");
  board.Finish("hover", R"({"name":"hover"})");
  board.SetStatus(R"({"phase":"ended","text":""})");
  for (const std::size_t bytes_max : {std::size_t{1000}, std::size_t{1} << 30}) {
    LiveBoard::Seen seen;
    std::vector<std::string> names;
    for (std::string text = board.TakeUpdate(seen, bytes_max); !text.empty();
         text = board.TakeUpdate(seen, bytes_max))
      for (const Event& event : Events(text)) names.push_back(event.name);
    ASSERT_GE(names.size(), 6U);
    EXPECT_EQ(std::vector(names.end() - 3, names.end()),
              (std::vector<std::string>{"rows", "over", "status"}));
    EXPECT_EQ(std::count(names.begin(), names.end(), "status"), 1);
  }
}

TEST(ListenOnLoopback, SaysWhatToDoWhenAPortIsTaken) {
  const LiveSocket first = ListenOnLoopback(0);
  EXPECT_GT(first.port, 0);
  try {
    ListenOnLoopback(first.port);
    FAIL() << "the port is taken";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("is in use by another program"), std::string::npos);
  }
}

}  // namespace
}  // namespace tiltproof::harness
