// Content of reports: extremes survive decimation and packing, frames are paired with what went on in their place,
// limits hold, and no name becomes markup.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "harness/report/decimation.h"
#include "harness/report/files.h"
#include "harness/report/flight_files.h"
#include "harness/report/flight_pack.h"
#include "harness/report/line_frames.h"
#include "harness/report/report_page.h"
#include "harness/report/results.h"
#include "tests/harness/score/still_flight.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;
using link::Direction;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kInf = std::numeric_limits<double>::infinity();
const std::string kEvil = "<img src=x onerror=\"alert(1)\"></script><script>alert(1)</script>";

// Values of a flight that nothing smooths: jumps, plateaus, peaks of one row, gaps, infinities.
std::vector<double> Wild(std::mt19937_64& random, std::size_t count, bool gaps) {
  std::vector<double> values(count);
  double value = 0;
  for (double& v : values) {
    const auto draw = random() % 100;
    if (draw < 60) value += static_cast<double>(random() % 1000) / 500 - 1;
    v = draw >= 97 ? value * 50 : value;
    if (gaps && draw == 96) v = std::nan("");
    if (gaps && draw == 95) v = random() % 2 == 0 ? kInf : -kInf;
  }
  return values;
}

TEST(Decimation, KeepsTheExtremesOfEveryStretch) {
  std::mt19937_64 random(1);
  for (const std::size_t count : {0U, 1U, 7U, 1500U, 1501U, 2999U, 5001U, 20'003U}) {
    for (const bool gaps : {false, true}) {
      const std::vector<double> values = Wild(random, count, gaps);
      const std::vector<std::size_t> rows = DecimatedRows(values, 1500);
      ASSERT_LE(rows.size(), 1500U);
      ASSERT_TRUE(std::is_sorted(rows.begin(), rows.end(), std::less_equal<>()));
      if (count == 0) continue;
      ASSERT_EQ(rows.front(), 0U);
      ASSERT_EQ(rows.back(), count - 1);
      if (count <= 1500) {
        ASSERT_EQ(rows.size(), count);
      }
      // The extremes of all rows.
      double low = kInf, high = -kInf, kept_low = kInf, kept_high = -kInf;
      for (const double v : values)
        if (!std::isnan(v)) low = std::min(low, v), high = std::max(high, v);
      for (const std::size_t r : rows)
        if (!std::isnan(values[r]))
          kept_low = std::min(kept_low, values[r]), kept_high = std::max(kept_high, values[r]);
      ASSERT_EQ(kept_low, low);
      ASSERT_EQ(kept_high, high);
      // By brute force for every row: within the length of a bucket one kept row is at least as high, one as low.
      const std::size_t reach = count / 370 + 2;
      for (std::size_t r = 0; r < count; ++r) {
        if (std::isnan(values[r])) continue;
        bool above = false, below = false;
        for (auto k = std::lower_bound(rows.begin(), rows.end(), r < reach ? 0 : r - reach);
             k != rows.end() && *k <= r + reach; ++k) {
          above |= values[*k] >= values[r];
          below |= values[*k] <= values[r];
        }
        ASSERT_TRUE(above && below) << "row " << r << " of " << count;
      }
    }
  }
}

TEST(Decimation, AMissingValueIsSeen) {
  std::vector<double> values(5000, 1.0);
  values[3333] = std::nan("");
  const auto rows = DecimatedRows(values, 1500);
  EXPECT_TRUE(std::binary_search(rows.begin(), rows.end(), std::size_t{3333}));
}

TEST(Decimation, PackedValuesAreWithinHalfALevel) {
  std::mt19937_64 random(2);
  for (int round = 0; round < 50; ++round) {
    const std::vector<double> values = Wild(random, 3000, round % 2 == 1);
    const auto rows = DecimatedRows(values, 1500);
    const PackedSeries packed = PackSeries(values, rows);
    const auto points = UnpackSeries(packed);
    ASSERT_EQ(points.size(), rows.size());
    const double half_level = (packed.high - packed.low) / kLevelMax / 2 * 1.0001;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      ASSERT_EQ(points[i].row, rows[i]);
      const double value = values[rows[i]];
      if (!std::isfinite(value)) {
        ASSERT_TRUE(points[i].value == value || (std::isnan(value) && std::isnan(points[i].value)));
      } else {
        ASSERT_NEAR(points[i].value, value, half_level);
        if (value == packed.low || value == packed.high) {
          ASSERT_EQ(points[i].value, value);
        }
      }
    }
  }
}

TEST(Decimation, HugeAndConstantValuesPack) {
  const double most = std::numeric_limits<double>::max();
  for (const std::vector<double>& values :
       {std::vector<double>{-most, most, 0}, {5, 5, 5}, {kInf, kInf, std::nan("")}}) {
    const auto points = UnpackSeries(PackSeries(values, DecimatedRows(values, 8)));
    ASSERT_EQ(points.size(), 3U);
    EXPECT_EQ(points[0].value, values[0]);
    EXPECT_EQ(points[1].value, values[1]);
  }
}

constexpr WireId kMain{0, Direction::kToClient};

struct LineBuilder {
  LinkLog log;
  void Sent(TimeNs begin_ns, std::vector<std::uint8_t> bytes) {
    log.Append({begin_ns, std::move(bytes)}, kMain, false);
  }
  void WentOn(TimeNs begin_ns, std::vector<std::uint8_t> bytes) {
    log.Append({begin_ns, std::move(bytes)}, kMain, true);
  }
  std::vector<FrameFate> Fates() const {
    std::vector<FrameFate> fates;
    for (const LineFrame& frame : FramesOf(log)) fates.push_back(frame.fate);
    return fates;
  }
};

TEST(LineFrames, EachHasItsFate) {
  LineBuilder line;
  line.Sent(0, {1, 1}), line.WentOn(0, {1, 1});                                // intact
  line.Sent(100, {2, 2}), line.WentOn(150, {2, 2});                            // late
  line.Sent(200, {3, 3}), line.WentOn(200, {3, 9});                            // damaged
  line.Sent(300, {4, 4});                                                      // lost
  line.Sent(400, {5, 5}), line.WentOn(400, {5}), line.WentOn(450, {5});        // in pieces
  line.Sent(500, {6, 6}), line.WentOn(500, {6, 6}), line.WentOn(560, {6, 6});  // and again
  EXPECT_THAT(line.Fates(),
              ElementsAre(FrameFate::kIntact, FrameFate::kLate, FrameFate::kDamaged, FrameFate::kLost,
                          FrameFate::kLate, FrameFate::kIntact, FrameFate::kExtra));
}

TEST(LineFrames, ARequestThatIsLostIsNotTheNextOne) {
  LineBuilder line;  // all requests look the same
  for (const TimeNs t : {0, 100, 200}) {
    line.Sent(t, {7});
    if (t != 100) line.WentOn(t, {7});
  }
  EXPECT_THAT(line.Fates(), ElementsAre(FrameFate::kIntact, FrameFate::kLost, FrameFate::kIntact));
}

TEST(LineFrames, ReorderedFramesAreLate) {
  LineBuilder line;
  line.Sent(0, {1}), line.Sent(100, {2}), line.Sent(200, {3});
  line.WentOn(100, {2}), line.WentOn(150, {1}), line.WentOn(200, {3});
  EXPECT_THAT(line.Fates(), ElementsAre(FrameFate::kLate, FrameFate::kIntact, FrameFate::kIntact));
}

TEST(SignalBounds, AreThoseOfUnconditionalComparisons) {
  Scenario scenario;
  scenario.criteria = {
      {.name = "path",
       .stl = "always[5,60](position_error_m <= 1.0 and 0.2 <= z_m)",
       .metric = "",
       .min = {},
       .max = {}},
      {.name = "upright", .stl = "always(abs(roll_rad) < 0.6)", .metric = "", .min = {}, .max = {}},
      {.name = "later", .stl = "always[1,2](always[3,4](x_m > -2))", .metric = "", .min = {}, .max = {}},
      {.name = "some time", .stl = "eventually(z_m >= 5)", .metric = "", .min = {}, .max = {}},
      {.name = "if", .stl = "always(x_m > 1 implies y_m > 1)", .metric = "", .min = {}, .max = {}}};
  const auto bounds = BoundsOf(scenario, testing::TiltrotorTrace().columns());
  std::vector<std::string> texts;
  for (const SignalBound& b : bounds)
    texts.push_back(fmt::format("{} {}{} {} {:g} [{:g},{}]", b.criterion, b.of_magnitude ? "|" : "", b.signal,
                                b.upper ? "<=" : ">=", b.value, b.begin_s,
                                b.end_s ? fmt::format("{:g}", *b.end_s) : ""));
  EXPECT_THAT(texts, ElementsAre("path position_error_m <= 1 [5,60]", "path z_m >= 0.2 [5,60]",
                                 "upright |roll_rad <= 0.6 [0,]", "later x_m >= -2 [4,6]"));
}

std::string Inflate(std::string_view bytes) {
  std::string text(std::size_t{64} << 20, '\0');
  uLongf size = text.size();
  EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(text.data()), &size,
                       reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()),
            Z_OK);
  text.resize(size);
  return text;
}

std::size_t U32(std::string_view bytes) {
  std::size_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value |= std::size_t{static_cast<std::uint8_t>(bytes.at(i))} << (8 * i);
  return value;
}

nlohmann::json JsonOf(std::string_view part) { return nlohmann::json::parse(part.substr(4, U32(part))); }

// A minute with noise on every column and a line whose every frame is damaged: the most that there can be to show.
FlightView WorstFlight() {
  RunLog log = StillFlight(5001);
  std::mt19937_64 random(3);
  for (std::size_t r = 0; r < log.trace.row_count(); ++r)
    for (std::size_t c = 1; c < log.trace.columns().size(); ++c)
      log.trace.mutable_row(r)[c] = static_cast<double>(random()) / 1e18;
  FlightView view;
  view.scenario = ScenarioOf(log);
  view.scenario.faults = {Fault("evil", 0, kNever)};
  for (std::size_t r = 0; r < log.trace.row_count(); ++r) {
    const TimeNs t = static_cast<TimeNs>(r) * kControlPeriodNs;
    view.times_ns.push_back(t);
    std::vector<std::uint8_t> bytes(140);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    view.link.Append({t, bytes}, kMain, false);
    bytes[random() % bytes.size()] ^= 1;
    view.link.Append({t, bytes}, kMain, true);
  }
  view.trace = std::move(log.trace);
  view.frames = FramesOf(view.link);
  for (int i = 0; i < 10'000 && view.ticks.size() < kTicksMax; ++i) view.ticks.push_back({0, i * 0.006, ""});
  return view;
}

TEST(FlightPack, CloseUpsKeepTheirLimitAndAreExact) {
  const FlightView view = WorstFlight();
  for (const std::size_t bytes_max : {0U, 20'000U, 100'000U}) {
    const std::string bytes = PackFlight(view, {.points_max = 1500, .close_up_bytes_max = bytes_max});
    const std::size_t first = U32(bytes);
    const std::size_t places = U32(std::string_view(bytes).substr(4 + first));
    const std::size_t close_ups_at = 8 + first + places;
    ASSERT_LE(bytes.size() - close_ups_at, bytes_max);
    const nlohmann::json json = JsonOf(Inflate(std::string_view(bytes).substr(4, first)));
    const nlohmann::json entries =
        JsonOf(Inflate(std::string_view(bytes).substr(8 + first, places)))["close_ups"];
    EXPECT_EQ(json["line_error_count"], 5001);
    EXPECT_EQ(json["line_errors"].size(), kLineErrorsMax);
    for (const auto& series : json["series"]) EXPECT_LE(series["count"].get<std::size_t>(), 1500U);
    EXPECT_EQ(entries.empty(), bytes_max == 0);
    for (const auto& entry : entries) {
      const std::string part = Inflate(std::string_view(bytes).substr(
          close_ups_at + entry["at"].get<std::size_t>(), entry["size"].get<std::size_t>()));
      const nlohmann::json close = JsonOf(part);
      const std::string_view numbers = std::string_view(part).substr(4 + U32(part));
      const auto from = close["first_row"].get<std::size_t>(), count = close["row_count"].get<std::size_t>();
      ASSERT_GE(count, 20U);
      EXPECT_EQ(close["frames"].size(), count);
      // The last column of the last row, to the bit.
      const std::size_t column = json["columns"].size() - 1;
      std::uint64_t bits = 0;
      for (std::size_t b = 0; b < 8; ++b)
        bits |=
            std::uint64_t{static_cast<std::uint8_t>(numbers.at(8 * count * column + b * count + count - 1))}
            << (8 * b);
      double value;
      std::memcpy(&value, &bits, sizeof value);
      const auto in_trace = view.trace.Find(json["columns"].back().get<std::string>());
      EXPECT_EQ(value, view.trace.at(from + count - 1, *in_trace));
    }
  }
}

TEST(ReportPage, Base64IsThatOfRfc4648) {
  EXPECT_EQ(Base64(""), "");
  EXPECT_EQ(Base64("f"), "Zg==");
  EXPECT_EQ(Base64("fo"), "Zm8=");
  EXPECT_EQ(Base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(Base64("\xff\xfe"), "//4=");
}

class ReportPageTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / (std::string("tiltproof-view-") +
                                           ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // A run with one flight for each name, of which the first has its files.
  void WriteRun(const std::vector<std::string>& names) {
    RunInfo info;
    info.suite = kEvil;
    info.client = kEvil;
    std::vector<FlightResult> results;
    for (const std::string& name : names) {
      info.flights.push_back({name, Verdict::kPass, 1});
      FlightResult& result = results.emplace_back(NotFlown(info.flights.back(), kEvil));
      result.replay = kEvil;
      result.score.criteria = {{kEvil, Verdict::kFail, kInf, std::nan(""), kEvil, -kInf}};
      result.score.metrics[kEvil] = std::nan("");
      result.score.faults = {{kEvil, kEvil, 10'000}};
    }
    WriteRunInfo(folder_, info);
    WriteResults(folder_, info, results);
    if (names.empty()) return;
    const RunLog log = StillFlight(100);
    const fs::path flight = folder_ / names.front();
    fs::create_directories(flight);
    WriteFile(flight / "scenario.resolved.yaml", kEvil);
    WriteFlight(flight, ScenarioOf(log), log);
    WriteFile(flight / "faults.jsonl", "{\"fault\": 7}\n[]\nnot json\n");
    WriteFile(flight / "link.bin", "nonsense");
  }

  std::string Page(const PageLimits& limits = {}) const {
    const auto load = [](const fs::path&) {
      FlownFlight flown;
      flown.scenario.description = kEvil;
      flown.scenario.tags = {kEvil};
      flown.vehicle =
          VehicleShape{.name = kEvil, .body_size_m = {1, 1, 1}, .body_position_m = {0, 0, 0}, .rotors = {}};
      return flown;
    };
    return ReportPage(ViewRuns({{folder_, ""}}), load, limits);
  }

  // The page holds its data as they are, and everything else of it is the template.
  static nlohmann::json DataOf(const std::string& page) {
    const std::string_view all = PageTemplate();
    const std::size_t place = all.find(kDataPlace);
    EXPECT_EQ(page.substr(0, place), all.substr(0, place));
    const std::size_t behind = all.size() - place - kDataPlace.size();
    const std::string data = page.substr(place, page.size() - behind - place);
    EXPECT_EQ(page.substr(page.size() - behind), all.substr(place + kDataPlace.size()));
    // The only markup in it are the elements that hold it.
    std::size_t opened = 0, tags = 0;
    for (std::size_t at = data.find('<'); at != std::string::npos; at = data.find('<', at + 1)) {
      ++tags;
      if (data.compare(at, 13, "<script type=") == 0) ++opened;
    }
    EXPECT_EQ(tags, 2 * opened);
    const std::string begin = "<script type=\"application/json\" id=\"run\">";
    EXPECT_EQ(data.rfind(begin, 0), 0U);
    return nlohmann::json::parse(data.substr(begin.size(), data.find("</script>") - begin.size()));
  }

  fs::path folder_;
};

TEST_F(ReportPageTest, HostileNamesAreDataOnly) {
  WriteRun({"first", kEvil});
  const nlohmann::json run = DataOf(Page());
  ASSERT_EQ(run["flights"].size(), 2U);
  EXPECT_EQ(run["runs"][0]["suite"], kEvil);
  EXPECT_EQ(run["flights"][1]["name"], kEvil);
  EXPECT_EQ(run["flights"][0]["details"], "flight-0");
  EXPECT_FALSE(run["flights"][1].contains("details"));
  EXPECT_TRUE(run["flights"][0]["margin"].is_null());
}

TEST_F(ReportPageTest, DamagedFilesAreNamed) {
  WriteRun({"first"});
  const FlightView view =
      ViewFlight(folder_ / "first", FlightResult{}, ScenarioOf(StillFlight(100)), std::nullopt);
  EXPECT_EQ(view.trace.row_count(), 100U);
  ASSERT_EQ(view.problems.size(), 2U);
  EXPECT_THAT(view.problems[0], HasSubstr("faults.jsonl"));
  EXPECT_THAT(view.problems[1], HasSubstr("link.bin"));
}

// A distance that 32 bits cannot hold became a shorter one, and all later rows came too early.
TEST_F(ReportPageTest, RowsTooFarApartAreNamed) {
  WriteRun({"first"});
  RunLog log = StillFlight(100);
  Set(log, 99, "t_s", 8.0);
  WriteFlight(folder_ / "first", ScenarioOf(log), log);
  const FlightView view = ViewFlight(folder_ / "first", FlightResult{}, ScenarioOf(log), std::nullopt);
  ASSERT_FALSE(view.problems.empty());
  EXPECT_EQ(
      view.problems[0],
      "trace.csv: row 99 is 6.824 s after the one before; a shown trace has a row every 4.295 s at least");
  EXPECT_EQ(DataOf(Page())["flights"].size(), 1U);
}

// A log without a client was read beyond its end.
TEST_F(ReportPageTest, AFlightWithOtherClientsThanItsScenarioIsNamed) {
  WriteRun({"first"});
  Scenario two = ScenarioOf(StillFlight(100));
  two.clients.resize(2);
  two.clients[0].id = "a";
  two.clients[1].id = "b";
  const FlightView view = ViewFlight(folder_ / "first", FlightResult{}, two, std::nullopt);
  ASSERT_FALSE(view.problems.empty());
  EXPECT_THAT(
      view.problems[0],
      HasSubstr("flight.json: clients: has 1, and the flight's scenario has 2; was one of the two changed?"));
}

TEST_F(ReportPageTest, AnEmptyRunAndOneWithoutResultsHaveAPage) {
  WriteRun({});
  EXPECT_TRUE(DataOf(Page())["flights"].empty());
  WriteRun({"first", "second"});
  fs::remove(folder_ / "results.json");
  const nlohmann::json run = DataOf(Page());
  ASSERT_EQ(run["flights"].size(), 2U);
  EXPECT_EQ(run["flights"][1]["verdict"], "error");
  EXPECT_THAT(run["runs"][0]["problem"].get<std::string>(), HasSubstr("results.json"));
}

TEST_F(ReportPageTest, LimitsHold) {
  WriteRun({"first", "second", "third"});
  const nlohmann::json run =
      DataOf(Page({.flights_max = 2, .details_bytes_max = 0, .results_bytes_max = 0, .bytes_aim = 0}));
  EXPECT_EQ(run["flights"].size(), 2U);
  EXPECT_EQ(run["left_out_count"], 1);
  EXPECT_TRUE(run["flights"][0].contains("result"));
  EXPECT_FALSE(run["flights"][1].contains("result"));
  EXPECT_THAT(run["flights"][0]["problem"].get<std::string>(), HasSubstr("tiltproof report"));
}

TEST_F(ReportPageTest, ABaselineSaysWhatEachFlightWas) {
  WriteRun({"first", "second"});
  RunView view = ViewRuns({{folder_, ""}});
  const fs::path before = folder_ / "before";
  fs::create_directories(before);
  FlightResult result;
  result.name = "first";
  result.score.criteria = {{"c", Verdict::kPass, 0.5, std::nullopt, "", 0.5}};
  FlightResult gone;
  gone.name = "gone";
  WriteResults(before, {}, {result, gone});
  CompareWith(view, before);
  ASSERT_TRUE(view.flights[0].before);
  EXPECT_EQ(view.flights[0].before->margin, 0.5);
  EXPECT_FALSE(view.flights[1].before);
  EXPECT_THAT(view.only_in_baseline, ElementsAre("gone"));
}

TEST_F(ReportPageTest, TheLeastMarginIsFirst) {
  RunInfo info;
  std::vector<FlightResult> results;
  for (const auto& [name, margin] : std::vector<std::pair<std::string, std::optional<double>>>{
           {"a", 0.5}, {"b", std::nullopt}, {"c", -2}, {"d", 0.1}}) {
    FlightResult& result = results.emplace_back();
    result.name = name;
    result.score.verdict = Verdict::kPass;
    result.score.criteria = {{"x", Verdict::kPass, margin, std::nullopt, "", margin}};
  }
  WriteRunInfo(folder_, info);
  WriteResults(folder_, info, results);
  std::string order;
  for (const FlightEntry& flight : ViewRuns({{folder_, ""}}).flights) order += flight.result.name;
  EXPECT_EQ(order, "cdab");
}

TEST(ReportPageTemplate, LoadsNothingAndAllowsOnlyItself) {
  const std::string page(PageTemplate());
  EXPECT_THAT(page, HasSubstr("Content-Security-Policy\" content=\"default-src 'none'; script-src 'sha256-"));
  EXPECT_THAT(page, Not(HasSubstr("unsafe-inline")));
  EXPECT_THAT(page, Not(HasSubstr("<script src")));
  EXPECT_THAT(page, Not(HasSubstr("<link")));
  EXPECT_THAT(page, HasSubstr("Copyright"));
}

}  // namespace
}  // namespace tiltproof::harness
