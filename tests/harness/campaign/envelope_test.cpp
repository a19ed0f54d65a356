#include "harness/campaign/envelope.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "faults/registry.h"
#include "harness/campaign/envelope_search.h"
#include "harness/report/files.h"
#include "tests/harness/campaign/tilt_rotor.h"

namespace tiltproof::harness {
namespace {

// A file as version 0.1.0 wrote it before the fields had names in one place.
constexpr const char* kFile = R"({
  "format": 1,
  "version": "VERSION",
  "scenario": "base",
  "clients": ["tolerant", "paper"],
  "columns": {"paper": {"scenario": "1", "flags": "", "build": "a"},
              "tolerant": {"scenario": "2", "flags": " --client host", "build": "b"}},
  "seed": 1, "repeats": 5, "tolerance": 0.01, "complete": true,
  "rows": [
    {"type": "frame.drop", "target": "both", "client": "paper", "parameter": "probability",
     "survives": 0.25, "fails": 0.5, "unit": "1", "first_criterion": "near", "seed": 3, "time_s": null,
     "reason": "near: too far", "harmless": 0.0, "mildest": 0.0, "severest": 1.0, "scale": "linear", "runs": 12,
     "levels": [[0.25, true], [0.5, false], [0.75, null]], "pockets": [[0.5, 0.5]],
     "survived_share": 0.25, "idle_levels": [0.25], "seeds": 5, "sure_share": 0.5},
    {"type": "sensor.bias", "signal": "z_m", "side": "negative", "client": "tolerant", "parameter": "offset",
     "survives": null, "fails": null, "unit": "m", "first_criterion": null, "harmless": null, "mildest": 0.0,
     "severest": -10.0, "scale": "logarithmic", "runs": 1, "levels": [], "pockets": [], "survived_share": null,
     "idle_levels": [], "seeds": 1, "sure_share": 1.0, "error": "the flight 'x' is an error: y"}],
  "not_applicable": [{"type": "device.stall", "place": "", "client": "paper", "reason": "no board"}],
  "map": [{"client": "paper", "x": {"type": "frame.drop", "target": "both", "parameter": "probability",
           "unit": "1", "levels": [0.1, 0.2]},
           "y": {"type": "actuator.lag", "actuator": "f_r", "parameter": "time_constant_s", "unit": "s",
           "levels": [1.0]}, "survived": [[true, null]]}]
})";

class EnvelopeFileTest : public ::testing::Test {
 protected:
  EnvelopeFileTest() {
    std::string name = (std::filesystem::temp_directory_path() / "tiltproof-envelope-XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~EnvelopeFileTest() override { std::filesystem::remove_all(folder_); }

  Envelope Read(const std::string& text) const {
    WriteFile(folder_ / "envelope.json", text);
    return ReadEnvelope(folder_ / "envelope.json");
  }
  static std::string Text(const std::string& from = "", const std::string& to = "") {
    std::string text = kFile;
    text.replace(text.find("VERSION"), 7, Version());
    if (!from.empty()) text.replace(text.find(from), from.size(), to);
    return text;
  }
  std::string ErrorOf(const std::string& text) const {
    try {
      Read(text);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "none";
  }

  std::filesystem::path folder_;
};

TEST_F(EnvelopeFileTest, ReadsEveryField) {
  const Envelope envelope = Read(Text());
  EXPECT_EQ(envelope.clients, (std::vector<std::string>{"tolerant", "paper"}));
  EXPECT_EQ(envelope.columns.at("tolerant").flags, " --client host");
  ASSERT_EQ(envelope.rows.size(), 2u);
  const EnvelopeEntry& drop = envelope.rows.at(0);
  EXPECT_EQ(drop.place(), "both");
  EXPECT_EQ(drop.seed, 3u);
  EXPECT_EQ(drop.time_s, std::nullopt);
  EXPECT_EQ(drop.levels, (std::vector<LevelAnswer>{{0.25, true}, {0.5, false}, {0.75, std::nullopt}}));
  EXPECT_EQ(drop.pockets, (std::vector<Pocket>{{0.5, 0.5}}));
  const EnvelopeEntry& bias = envelope.rows.at(1);
  EXPECT_EQ(bias.place() + bias.side.value(), "z_mnegative");
  EXPECT_EQ(bias.survives, std::nullopt);
  EXPECT_EQ(bias.error, "the flight 'x' is an error: y");
  EXPECT_EQ(envelope.map.at(0).y.actuator, "f_r");
  EXPECT_EQ(envelope.map.at(0).survived.at(0), (std::vector<std::optional<bool>>{true, std::nullopt}));
}

// Names and values stay. A row in which nothing fails has three keys more, which are null.
TEST_F(EnvelopeFileTest, WritesWhatItReads) {
  nlohmann::json expected = nlohmann::json::parse(Text());
  for (const char* key : {"seed", "time_s", "reason"}) expected["rows"][1][key] = nullptr;
  EXPECT_EQ(nlohmann::json::parse(ToJsonText(Read(Text()))), expected);
  Envelope without_map = Read(Text());
  without_map.map.clear();
  EXPECT_FALSE(nlohmann::json::parse(ToJsonText(without_map)).contains("map"));
}

TEST_F(EnvelopeFileTest, NamesTheRowAndTheFieldOfAnError) {
  EXPECT_EQ(ErrorOf(Text("\"survives\": null, ", "")),
            "row sensor.bias z_m negative, client tolerant: survives is missing");
  EXPECT_EQ(ErrorOf(Text("\"survives\": 0.25", "\"survives\": \"much\""))
                .rfind("row frame.drop both, client paper: survives: ", 0),
            0u);
  EXPECT_EQ(ErrorOf(Text("[0.25, true]", "[0.25]")).rfind("row frame.drop both, client paper: levels: ", 0),
            0u);
  EXPECT_EQ(ErrorOf(Text("[\"tolerant\", \"paper\"]", "{}")),
            "clients: a list is needed, and this is of type object");
  EXPECT_EQ(ErrorOf(Text("\"mildest\": 0.0", "\"mildest\": {}")),
            "row frame.drop both, client paper: mildest: a number is needed, and this is of type object");
  EXPECT_NE(ErrorOf(Text("\"format\": 1", "\"format\": 99")).find("99"), std::string::npos);
  EXPECT_NE(ErrorOf("{}"), "none");
}

TEST(EnvelopePlace, HasAKeyForThePlacesOfEveryFaultType) {
  for (const faults::FaultType& type : faults::FaultTypes())
    for (const EnvelopeRow& row : EnvelopeRows(type, TiltRotorSignals())) {
      EXPECT_EQ(PlaceOf(row).place(), row.place) << type.name;
      EXPECT_EQ(PlaceOf(row).side.value_or(""), row.side) << type.name;
    }
}

EnvelopeSearchRow SearchRow(const std::string& type, const std::string& place, const std::string& client) {
  for (const EnvelopeRow& row : EnvelopeRows(*faults::FindFaultType(type), TiltRotorSignals()))
    if (row.place == place) return {.row = row, .client = client, .task = {}, .found = {}};
  throw std::runtime_error("no such place: " + place);
}

// A search over two rows of `paper`, of which the file has one; it also has one of `tolerant`.
class EnvelopeResumeTest : public EnvelopeFileTest {
 protected:
  static EnvelopePlan Plan(const std::string& build = "a") {
    EnvelopePlan plan;
    EnvelopeFirmware& paper = plan.firmwares.emplace_back();
    paper.name = "paper";
    paper.column = {.scenario = "1", .flags = "", .build = build};
    paper.flight.scenario.name = "base";
    paper.flight.scenario.seed = 1;
    plan.rows = {SearchRow("frame.drop", "to_plant", "paper"), SearchRow("frame.drop", "both", "paper")};
    return plan;
  }
  static std::string DifferenceOf(const Envelope& earlier, EnvelopePlan plan,
                                  const EnvelopeSearch::Options& options = {}) {
    try {
      EnvelopeSearch(std::move(plan), options).Resume(earlier);
    } catch (const std::runtime_error& difference) {
      return difference.what();
    }
    return "none";
  }
};

TEST_F(EnvelopeResumeTest, TakesItsRowsAndKeepsTheOthers) {
  EnvelopeSearch search(Plan(), {});
  search.Resume(Read(Text()));
  EXPECT_EQ(search.resumed_count(), 1u);
  EXPECT_EQ(search.rows().at(0).found, std::nullopt);
  EXPECT_EQ(search.rows().at(1).found.value().survives, 0.25);
  EXPECT_EQ(search.others_count(), 1u);
  const Envelope now = search.envelope();
  EXPECT_EQ(now.clients, (std::vector<std::string>{"paper", "tolerant"}));
  EXPECT_EQ(now.columns.size(), 2u);
  ASSERT_EQ(now.rows.size(), 2u);
  EXPECT_EQ(now.rows.at(1).type, "sensor.bias");
  EXPECT_EQ(now.not_applicable.size(), 1u);
  EXPECT_EQ(now.map.size(), 1u);
  EXPECT_FALSE(now.complete) << "this search has not run";
}

TEST_F(EnvelopeResumeTest, FliesRowsAgainThatCouldNotBeJudged) {
  EnvelopePlan plan = Plan("b");
  plan.firmwares.front().name = "tolerant";
  plan.firmwares.front().column.scenario = "2";
  plan.rows = {SearchRow("sensor.bias", "z_m", "tolerant")};
  plan.rows.front().row.side = "negative";
  EnvelopeSearch search(std::move(plan), {});
  search.Resume(Read(Text()));
  EXPECT_EQ(search.rows().front().found, std::nullopt);
  EXPECT_EQ(search.envelope().rows.size(), 1u) << "only that of paper";
}

TEST_F(EnvelopeResumeTest, ReportsTheFirstDifference) {
  const Envelope earlier = Read(Text());
  EXPECT_EQ(DifferenceOf(earlier, Plan()), "none");
  EXPECT_EQ(DifferenceOf(earlier, Plan("c")),
            "paper was flown with another build of the program or the firmware");
  EXPECT_EQ(DifferenceOf(earlier, Plan(), {.repeat_count = 7}), "--repeats was 5 and is 7");
  EXPECT_EQ(DifferenceOf(earlier, Plan(), {.tolerance = 0.2}), "--tolerance was 0.01 and is 0.2");
  EnvelopePlan other = Plan();
  other.firmwares.front().flight.scenario.seed = 2;
  EXPECT_EQ(DifferenceOf(earlier, other), "the seed was 1 and is 2");
  other = Plan();
  other.firmwares.front().flight.scenario.name = "other";
  EXPECT_EQ(DifferenceOf(earlier, other), R"(the scenario was "base" and is "other")");
  other = Plan();
  other.firmwares.front().column.scenario = "9";
  EXPECT_EQ(DifferenceOf(earlier, other), "the scenario, or the vehicle, of paper was another one");
}

}  // namespace
}  // namespace tiltproof::harness
