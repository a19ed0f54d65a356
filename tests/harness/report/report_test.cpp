// The files of a run: written whole, read back equal, damage named with its place.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <pugixml.hpp>
#include <sstream>

#include "harness/client/client.h"
#include "harness/report/build_id.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/results.h"
#include "harness/report/trace_csv.h"
#include "tests/harness/report/test_folder.h"
#include "tests/harness/score/still_flight.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class ReportTest : public FolderTest {};

Trace OddTrace() {
  Trace trace({"t_s", "x_m", "y_m"});
  const double odd[][3] = {
      {0.0, -0.0, 1e-310},
      {0.012, 0.1 + 0.2, std::numeric_limits<double>::quiet_NaN()},
      {0.024, std::numeric_limits<double>::max(), std::numeric_limits<double>::infinity()}};
  for (const auto& values : odd) {
    const auto row = trace.AppendRow();
    for (std::size_t i = 0; i < 3; ++i) row[i] = values[i];
  }
  return trace;
}

TEST_F(ReportTest, TraceSurvivesItsFileToTheBit) {
  const Trace trace = OddTrace();
  const Trace again = ReadTraceCsv(WriteTraceCsv(trace));
  ASSERT_EQ(again.columns(), trace.columns());
  ASSERT_EQ(again.row_count(), trace.row_count());
  EXPECT_EQ(TraceHash(again), TraceHash(trace));
  EXPECT_TRUE(std::signbit(again.at(0, 1)));
  EXPECT_EQ(again.at(1, 1), 0.1 + 0.2);
  EXPECT_TRUE(std::isnan(again.at(1, 2)));
}

TEST_F(ReportTest, TraceHashSeesEveryBitAndEveryName) {
  const Trace trace = OddTrace();
  Trace other_name({"t_s", "x_m", "z_m"});
  Trace other_value({"t_s", "x_m", "y_m"});
  for (std::size_t r = 0; r < trace.row_count(); ++r) {
    const auto a = other_name.AppendRow();
    const auto b = other_value.AppendRow();
    for (std::size_t c = 0; c < 3; ++c) a[c] = b[c] = trace.at(r, c);
    if (r == 0) b[1] = 0.0;  // was -0.0
  }
  EXPECT_NE(TraceHash(other_name), TraceHash(trace));
  EXPECT_NE(TraceHash(other_value), TraceHash(trace));
}

TEST_F(ReportTest, DamagedTraceIsNamedByLine) {
  EXPECT_THAT(ErrorOf([] { ReadTraceCsv("t_s,x_m\n0,1\n0.012\n"); }),
              HasSubstr("line 3: 1 values for 2 columns"));
  EXPECT_THAT(ErrorOf([] { ReadTraceCsv("t_s,x_m\n0,one\n"); }),
              HasSubstr("line 2: 'one' is not a number (column x_m)"));
  EXPECT_THAT(ErrorOf([] { ReadTraceCsv("t_s,x_m\n0,1"); }), HasSubstr("line 2: cut"));
}

TEST_F(ReportTest, RunFoldersAreNeverShared) {
  const fs::path first = CreateRunFolder(folder_, "paper", 7);
  const fs::path second = CreateRunFolder(folder_, "paper", 7);
  EXPECT_NE(first, second);
  EXPECT_THAT(first.filename().string(), ::testing::MatchesRegex("[0-9]+T[0-9]+\\.[0-9]+Z-paper-7"));
  EXPECT_EQ(fs::canonical(folder_ / "latest"), fs::canonical(second));
}

TEST_F(ReportTest, FileErrorsNameTheFileAndTheReason) {
  EXPECT_THAT(ErrorOf([&] { WriteFile(folder_ / "none" / "file", "x"); }),
              HasSubstr("none/file: No such file or directory"));
  EXPECT_THAT(ErrorOf([&] { ReadFile(folder_ / "missing"); }),
              HasSubstr("missing: No such file or directory"));
  // A full disk: /dev/full takes no byte. The half-written temporary must not stay.
  fs::create_symlink("/dev/full", folder_ / "full.part");
  EXPECT_THAT(ErrorOf([&] { WriteFile(folder_ / "full", "x"); }), HasSubstr("full: No space left on device"));
  EXPECT_FALSE(fs::exists(folder_ / "full"));
  EXPECT_FALSE(fs::is_symlink(folder_ / "full.part"));
}

FlightResult Result(Verdict verdict, Verdict expected) {
  FlightResult result;
  result.name = "name";
  result.expected = expected;
  result.seed = 18446744073709551615ULL;
  result.trace_hash = "0123456789abcdef";
  result.score.verdict = verdict;
  result.score.reason = "because <of> \x01 this";
  result.score.metrics["tracking.rmse_m"] = 0.1;
  result.score.criteria.push_back(
      {"c", verdict, -std::numeric_limits<double>::infinity(), std::nullopt, "x_m = nan"});
  result.score.faults.push_back({"f", "frame.drop", 3});
  result.score.histograms["request_period_ms"] = {{10.0, 10.1, 14.0}, {0, 1, 2, 3}};
  return result;
}

TEST_F(ReportTest, ResultSurvivesItsJson) {
  const FlightResult result = Result(Verdict::kFail, Verdict::kPass);
  const std::string text = ToJsonText(result);
  EXPECT_EQ(ToJsonText(ResultFromJsonText(text)), text);
  EXPECT_THAT(text, HasSubstr("\"robustness\": null"));
  EXPECT_EQ(ResultFromJsonText(text).score.histograms, result.score.histograms);
}

TEST_F(ReportTest, AResultOfANewerFormatIsRefused) {
  std::string text = ToJsonText(Result(Verdict::kPass, Verdict::kPass));
  ASSERT_THAT(text, HasSubstr("\"format\": 1,"));
  std::string older = text;
  older.erase(older.find("\"format\""), std::string("\"format\": 1,").size());
  EXPECT_NO_THROW(ResultFromJsonText(older));  // of the time before there was one
  text.replace(text.find("\"format\": 1"), std::string("\"format\": 1").size(), "\"format\": 2");
  EXPECT_THAT(ErrorOf([&] { ResultFromJsonText(text); }),
              HasSubstr("written by a newer tiltproof (format 2; this one reads formats up to 1)"));
}

TEST_F(ReportTest, WhatIsNoResultSaysSo) {
  for (const char* text : {"", "{", "[]", "{\"name\": 7}"})
    EXPECT_THAT(ErrorOf([&] { ResultFromJsonText(text); }), HasSubstr("not the result of a flight: "))
        << text;
}

TEST_F(ReportTest, ExitCodesFollowTheirPrecedence) {
  const auto pass = Result(Verdict::kPass, Verdict::kPass), fail = Result(Verdict::kFail, Verdict::kPass),
             expected_fail = Result(Verdict::kFail, Verdict::kFail),
             surprise = Result(Verdict::kPass, Verdict::kFail),
             undecided = Result(Verdict::kInconclusive, Verdict::kPass),
             error = Result(Verdict::kError, Verdict::kPass);
  EXPECT_EQ(ExitCode({pass, expected_fail}), 0);
  EXPECT_EQ(ExitCode({pass, fail}), 1);
  EXPECT_EQ(ExitCode({surprise}), 1);
  EXPECT_EQ(ExitCode({pass, undecided}), 4);
  EXPECT_EQ(ExitCode({undecided, fail}), 1);
  EXPECT_EQ(ExitCode({fail, error, undecided}), 3);
  EXPECT_EQ(ExitCode({Result(Verdict::kInconclusive, Verdict::kInconclusive)}), 0);
}

TEST_F(ReportTest, JunitKeepsItsXmlWellFormed) {
  RunInfo info;
  info.suite = "s";
  info.started = UtcNow();
  WriteResults(folder_, info,
               {Result(Verdict::kFail, Verdict::kPass), Result(Verdict::kPass, Verdict::kPass)});
  const std::string xml = ReadFile(folder_ / "junit.xml");
  EXPECT_THAT(xml, HasSubstr("because &lt;of"));
  EXPECT_THAT(xml, HasSubstr("tests=\"2\" failures=\"1\" errors=\"0\""));
  EXPECT_EQ(xml.find('\x01'), std::string::npos);
}

std::vector<std::string> ChildNames(const pugi::xml_node& node) {
  std::vector<std::string> names;
  for (const auto& child : node.children()) names.emplace_back(child.name());
  return names;
}

void ExpectAttributes(const pugi::xml_node& node, const std::map<std::string, std::string>& patterns) {
  for (const auto& [name, pattern] : patterns)
    EXPECT_THAT(node.attribute(name.c_str()).value(), ::testing::MatchesRegex(pattern))
        << node.name() << " " << name;
  for (const auto& attribute : node.attributes())
    EXPECT_TRUE(patterns.contains(attribute.name())) << node.name() << " " << attribute.name();
}

TEST_F(ReportTest, JunitNamesPossibleCauses) {
  FlightResult lost = Result(Verdict::kFail, Verdict::kPass);
  lost.events.push_back({1.5, kSlowAdapterEvent, std::nullopt, "8.0 ms between reply and actuators"});
  lost.events.push_back({1.6, "note", std::nullopt, "something else"});
  lost.events.push_back({1.7, kStackOverflowEvent, std::nullopt, "stack 'main' (64 bytes) overflowed"});
  lost.stacks = {{std::nullopt, "main", 64, 64, true},
                 {std::nullopt, "idle", 256, 252, false},
                 {std::nullopt, "control", 256, 256, false}};
  WriteResults(folder_, RunInfo{}, {lost});
  const std::string xml = ReadFile(folder_ / "junit.xml");
  EXPECT_THAT(
      xml,
      HasSubstr("\nstack 'control' is full: all of its 256 bytes were used, so it may have overflowed\n"));
  EXPECT_THAT(xml, ::testing::Not(::testing::AnyOf(HasSubstr("'main' is full"), HasSubstr("'idle'"))));
  EXPECT_THAT(xml, HasSubstr("\n8.0 ms between reply and actuators\n"));
  EXPECT_THAT(xml, HasSubstr("\nstack 'main' (64 bytes) overflowed, at 1.700 s\n"));
  EXPECT_THAT(xml, ::testing::Not(HasSubstr("something else")));
}

// All elements and attributes that the schemas of Ant and of Jenkins require; both schemas know each of them.
TEST_F(ReportTest, JunitHasTheFormThatAntAndJenkinsKnow) {
  RunInfo info;
  info.suite = "s";
  info.started = UtcNow();
  info.not_applicable = {{"n", "why <not>"}};
  WriteResults(folder_, info,
               {Result(Verdict::kFail, Verdict::kPass), Result(Verdict::kPass, Verdict::kPass),
                Result(Verdict::kError, Verdict::kPass), Result(Verdict::kInconclusive, Verdict::kPass)});
  pugi::xml_document document;
  ASSERT_TRUE(document.load_file((folder_ / "junit.xml").c_str()));
  const auto root = document.document_element();
  EXPECT_STREQ(root.name(), "testsuites");
  ExpectAttributes(root, {});
  const auto suite = root.child("testsuite");
  ExpectAttributes(suite, {{"name", "s"},
                           {"package", "s"},
                           {"id", "0"},
                           {"hostname", ".+"},
                           {"timestamp", "20..-..-..T..:..:.."},
                           {"tests", "5"},
                           {"skipped", "1"},
                           {"failures", "2"},
                           {"errors", "1"},
                           {"time", "[0-9]+\\.[0-9]+"}});
  EXPECT_THAT(ChildNames(suite), ::testing::ElementsAre("properties", "testcase", "testcase", "testcase",
                                                        "testcase", "testcase", "system-out", "system-err"));
  EXPECT_NE(suite.child("properties").first_child(), nullptr);
  for (const auto& property : suite.child("properties").children())
    ExpectAttributes(property, {{"name", ".+"}, {"value", ".*"}});
  std::vector<std::string> outcomes;
  for (const auto& test : suite.children("testcase")) {
    ExpectAttributes(test, {{"name", ".+"}, {"classname", "s"}, {"time", "[0-9]+\\.[0-9]+"}});
    for (const auto& outcome : test.children()) {
      if (outcome.name() == std::string("skipped")) {
        ExpectAttributes(outcome, {{"message", "why <not>"}});
        outcomes.emplace_back(outcome.name());
        continue;
      }
      ExpectAttributes(outcome, {{"message", ".+"}, {"type", "fail|error|inconclusive"}});
      outcomes.push_back(fmt::format("{} {}", outcome.name(), outcome.attribute("type").value()));
    }
  }
  EXPECT_THAT(outcomes,
              ::testing::ElementsAre("failure fail", "error error", "failure inconclusive", "skipped"));
}

// Lines of a file, each a JSON object.
std::vector<nlohmann::json> LinesOf(const fs::path& file) {
  std::vector<nlohmann::json> lines;
  std::istringstream text(ReadFile(file));
  for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

TEST_F(ReportTest, TheFaultsLogSaysHowManyActivationsItLeavesOut) {
  Scenario scenario;
  scenario.faults.resize(4);
  for (std::size_t i = 0; i < scenario.faults.size(); ++i) {
    scenario.faults[i].id = std::string(1, static_cast<char>('a' + i));
    scenario.faults[i].type = "frame.drop";
  }
  RunLog log;
  // The log keeps all activations of the second fault. The third never acted. No record of the fourth came.
  log.fault_activation_counts = {1005, 1, 0, 7};
  log.activations = {{.time_ns = 1, .fault = 0, .what = "dropped", .before = {}, .after = {}},
                     {.time_ns = 2, .fault = 1, .what = "dropped", .before = {}, .after = {}},
                     {.time_ns = 3, .fault = 0, .what = "dropped", .before = {}, .after = {}}};
  WriteFlight(folder_, scenario, log);
  const auto lines = LinesOf(folder_ / "faults.jsonl");
  ASSERT_EQ(lines.size(), 5U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(lines[i].at("what"), "dropped");
  EXPECT_EQ(lines[3], (nlohmann::json{{"fault", "a"}, {"type", "frame.drop"}, {"left_out_count", 1003}}));
  EXPECT_EQ(lines[4], (nlohmann::json{{"fault", "d"}, {"type", "frame.drop"}, {"left_out_count", 7}}));
}

TEST_F(ReportTest, AFaultsLogWithoutTotalsLeavesNothingOut) {
  Scenario scenario;
  scenario.faults.resize(1);
  scenario.faults[0].id = "a";
  RunLog log;  // of a flight whose nodes were lost: no counts came, a record did
  log.activations = {{.time_ns = 1, .fault = 0, .what = "dropped", .before = {}, .after = {}}};
  WriteFlight(folder_, scenario, log);
  EXPECT_EQ(LinesOf(folder_ / "faults.jsonl").size(), 1U);
}

TEST_F(ReportTest, BuildIdFollowsTheFirmware) {
  WriteFile(folder_ / "a.so", "one");
  WriteFile(folder_ / "b.so", "one");
  const std::string build = BuildId(folder_ / "a.so");
  EXPECT_THAT(build, ::testing::MatchesRegex("[0-9a-f]+"));
  EXPECT_EQ(build.size(), 16u);
  EXPECT_EQ(BuildId(folder_ / "b.so"), build);
  WriteFile(folder_ / "b.so", "onf");
  EXPECT_NE(BuildId(folder_ / "b.so"), build);
  EXPECT_THAT(ErrorOf([&] { BuildId(folder_ / "missing.so"); }), HasSubstr("missing.so: No such file"));
}

TEST_F(ReportTest, RunInfoKeepsItsPlan) {
  RunInfo info;
  info.flights = {{"a", Verdict::kFail, 7}, {"b", Verdict::kPass, 8}};
  info.not_applicable = {{"c", "needs a board"}};
  WriteRunInfo(folder_, info);
  const RunInfo again = ReadRunInfo(folder_);
  ASSERT_EQ(again.flights.size(), 2U);
  EXPECT_EQ(again.flights[0].name, "a");
  EXPECT_EQ(again.flights[0].expected, Verdict::kFail);
  EXPECT_EQ(again.flights[1].seed, 8U);
  ASSERT_EQ(again.not_applicable.size(), 1U);
  EXPECT_EQ(again.not_applicable[0].name, "c");
  EXPECT_EQ(again.not_applicable[0].reason, "needs a board");
}

TEST_F(ReportTest, RunInfoKeepsItsBuild) {
  RunInfo info;
  info.build = "0123456789abcdef";
  info.machine = {{"compiler", "GCC 12.2.0"}, {"libc", "glibc 2.36"}};
  WriteRunInfo(folder_, info);
  EXPECT_EQ(ReadRunInfo(folder_).build, info.build);
  EXPECT_EQ(ReadRunInfo(folder_).machine, info.machine);
}

TEST_F(ReportTest, LatestIsOnlyEverALink) {
  EXPECT_FALSE(LatestIsTaken(folder_));
  CreateRunFolder(folder_, "paper", 7);
  EXPECT_FALSE(LatestIsTaken(folder_));
  // A link to nowhere is a link.
  fs::remove_all(fs::canonical(folder_ / "latest"));
  EXPECT_FALSE(LatestIsTaken(folder_));
  fs::remove(folder_ / "latest");
  WriteFile(folder_ / "latest", "mine");
  EXPECT_TRUE(LatestIsTaken(folder_));
  CreateRunFolder(folder_, "paper", 7);
  EXPECT_EQ(ReadFile(folder_ / "latest"), "mine");
}

TEST_F(ReportTest, EveryEndOfAFlightSurvivesItsFolder) {
  for (int i = 0; i <= static_cast<int>(EndReason::kHarnessError); ++i) {
    RunLog log;
    log.end_reason = static_cast<EndReason>(i);
    EXPECT_NE(Name(log.end_reason), "unknown") << i;
    WriteFlight(folder_, Scenario{}, log);
    const RunLog again = ReadFlight(folder_);
    EXPECT_EQ(again.end_reason, log.end_reason);
    // Lockstep: nothing can be late, which is not the same as 0 times late.
    EXPECT_EQ(again.harness_overrun_count, std::nullopt);
    EXPECT_EQ(again.harness_late_max_ns, std::nullopt);
  }
}

TEST_F(ReportTest, FlightSurvivesItsFolder) {
  RunLog log;
  log.end_reason = EndReason::kGroundStrike;
  log.end_text = "struck";
  log.end_ns = 123456789012345;
  log.clients[0].counts[1].frames_rejected = 5;
  log.clients[0].failsafe_entered_count = 2;
  log.clients[0].request_times_ns = {86806, 12086806};
  log.clients[0].sent_request_times_ns = {6, 12000006};
  log.clients[0].restarts = {{1234567890123, "reset by \"pin\""}};
  log.clients[0].client_round_trip_ns = {5, 1234567890123};
  log.harness_overrun_count = 3;
  log.harness_late_max_ns = 40'000'001;
  log.fault_activation_counts = {};
  log.events.push_back({-86806, "kind", "text"});
  WriteFlight(folder_, Scenario{}, log);
  const RunLog again = ReadFlight(folder_);
  EXPECT_EQ(again.end_reason, log.end_reason);
  EXPECT_EQ(again.end_ns, log.end_ns);
  EXPECT_EQ(again.clients[0].counts[1].frames_rejected, 5);
  EXPECT_EQ(again.clients[0].failsafe_entered_count, log.clients[0].failsafe_entered_count);
  EXPECT_EQ(again.clients[0].request_times_ns, log.clients[0].request_times_ns);
  EXPECT_EQ(again.clients[0].sent_request_times_ns, log.clients[0].sent_request_times_ns);
  EXPECT_EQ(again.clients[0].restarts, log.clients[0].restarts);
  EXPECT_EQ(again.clients[0].client_round_trip_ns, log.clients[0].client_round_trip_ns);
  EXPECT_EQ(again.harness_overrun_count, log.harness_overrun_count);
  EXPECT_EQ(again.harness_late_max_ns, log.harness_late_max_ns);
  EXPECT_EQ(again.events.at(0).time_ns, -86806);
  WriteFile(folder_ / "flight.json", "{\"end_reason\": \"completed\"");
  EXPECT_THAT(ErrorOf([&] { ReadFlight(folder_); }), HasSubstr("flight.json: "));
}

TEST_F(ReportTest, WhatThisMachineTookFromABoardIsScoredFromTheFiles) {
  // Every interval is 13 ms long: wrong, unless a tick was lost in each.
  RunLog log = StillFlight(101);
  for (TimeNs i = 0; i <= 80; ++i) log.clients[0].sent_request_times_ns.push_back(i * 13 * kNsPerMs);
  const Scenario scenario = ScenarioOf(log);
  const auto scored = [&] {
    WriteFlight(folder_, scenario, log);
    const RunLog again = ReadFlight(folder_);
    EXPECT_EQ(again.board_disturbed, log.board_disturbed);
    EXPECT_EQ(again.harness_late, log.harness_late);
    return ScoreRun(scenario, again);
  };
  EXPECT_EQ(scored().verdict, Verdict::kFail);
  for (TimeNs i = 0; i < 80; ++i)
    log.board_disturbed.push_back({(13 * i + 5) * kNsPerMs, (13 * i + 6) * kNsPerMs});
  log.harness_late = {{7 * kNsPerMs, 11 * kNsPerMs}};
  const Score score = scored();
  EXPECT_EQ(score.verdict, Verdict::kInconclusive);
  EXPECT_THAT(score.reason,
              HasSubstr("control_period: in 80 of 80 intervals this machine took time from the board"));
}

}  // namespace
}  // namespace tiltproof::harness
