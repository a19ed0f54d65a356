#include "harness/report/results.h"

#include <fmt/format.h>
#include <tinyxml2.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "harness/report/files.h"
#include "harness/report/flight_hashes.h"
#include "harness/report/json_fields.h"

namespace tiltproof::harness {
namespace {

using tinyxml2::XMLElement;

// Who opens the file looks for these first.
Json ToFile(const FlightResult& result) {
  Json json = {{"format", kResultsFormat}, {"name", {}}, {"verdict", {}}, {"expected", {}}};
  json["green"] = result.green();
  json["reason"] = nullptr;
  JsonWriter::PutFields(json, result);
  JsonWriter::PutFields(json, result.score);
  return json;
}

FlightResult ResultFromFile(const Json& json) {
  CheckFormat(json);
  FlightResult result;
  JsonReader::GetFields(json, result);
  JsonReader::GetFields(json, result.score);
  return result;
}

// XML 1.0 forbids most control characters, even escaped, and what is no UTF-8; the texts of a firmware may hold both.
std::string XmlSafe(std::string text) {
  text = Json::parse(JsonText(Json(text))).get<std::string>();
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 && c != '\t' && c != '\n') c = '?';
  return text;
}

std::string HostName() {
  char name[256] = {};
  return gethostname(name, sizeof name - 1) == 0 && name[0] != 0 ? name : "localhost";
}

std::string Decimal(double time_s) { return fmt::format("{:.3f}", time_s); }

// Elements and attributes in the order in which they are set. tinyxml2 escapes what XML does not allow in them.
XMLElement& Append(XMLElement& parent, const char* name) { return *parent.InsertNewChildElement(name); }

void Set(XMLElement& element, const char* name, const std::string& text) {
  element.SetAttribute(name, XmlSafe(text).c_str());
}

XMLElement& AddTestCase(XMLElement& suite, const std::string& suite_name, const std::string& name,
                        double time_s) {
  XMLElement& test = Append(suite, "testcase");
  Set(test, "classname", suite_name);
  Set(test, "name", name);
  Set(test, "time", Decimal(time_s));
  return test;
}

void AddFlight(XMLElement& suite, const std::string& suite_name, const FlightResult& result) {
  XMLElement& test = AddTestCase(suite, suite_name, result.name, result.wall_s);
  if (result.green()) return;
  const std::string verdict(Name(result.score.verdict));
  XMLElement& failure = Append(test, result.score.verdict == Verdict::kError ? "error" : "failure");
  Set(failure, "message",
      fmt::format("{}, expected {}: {}", verdict, Name(result.expected), result.score.reason));
  Set(failure, "type", verdict);
  std::string text = fmt::format("seed {}\nreplay: {}\n", result.seed, result.replay);
  for (const auto& criterion : result.score.criteria)
    text += fmt::format("{} {}: {}\n", Name(criterion.verdict), criterion.name, criterion.explanation);
  for (const std::string& cause : OtherCauses(result)) text += cause + "\n";
  failure.SetText(XmlSafe(text).c_str());
}

void AddSkipped(XMLElement& suite, const std::string& suite_name, const NotApplicable& scenario) {
  Set(Append(AddTestCase(suite, suite_name, scenario.name, 0.0), "skipped"), "message", scenario.reason);
}

// Elements, attributes and their order are what the schemas of Ant and Jenkins both know; a test holds that.
std::string JunitXml(const RunInfo& info, const std::vector<FlightResult>& results) {
  tinyxml2::XMLDocument document;
  document.InsertEndChild(document.NewDeclaration());
  auto* const suites = document.NewElement("testsuites");
  document.InsertEndChild(suites);
  XMLElement& suite = Append(*suites, "testsuite");
  unsigned failures = 0, errors = 0;
  double time_s = 0;
  for (const auto& result : results) {
    if (!result.green()) ++(result.score.verdict == Verdict::kError ? errors : failures);
    time_s += result.wall_s;
  }
  Set(suite, "name", info.suite);
  Set(suite, "package", info.suite);
  Set(suite, "id", "0");
  Set(suite, "hostname", HostName());
  // UTC. Ant's schema knows neither zone nor fractions of a second.
  Set(suite, "timestamp", info.started.substr(0, 19));
  Set(suite, "tests", std::to_string(results.size() + info.not_applicable.size()));
  Set(suite, "failures", std::to_string(failures));
  Set(suite, "errors", std::to_string(errors));
  Set(suite, "skipped", std::to_string(info.not_applicable.size()));
  Set(suite, "time", Decimal(time_s));
  XMLElement& properties = Append(suite, "properties");
  const auto add_property = [&properties](const char* key, const std::string& value) {
    XMLElement& property = Append(properties, "property");
    Set(property, "name", key);
    Set(property, "value", value);
  };
  add_property("version", std::string(Version()));
  add_property("seed", std::to_string(info.seed));
  add_property("mode", info.mode);
  add_property("client", info.client);
  for (const auto& result : results) AddFlight(suite, info.suite, result);
  for (const auto& scenario : info.not_applicable) AddSkipped(suite, info.suite, scenario);
  Append(suite, "system-out");
  Append(suite, "system-err");
  tinyxml2::XMLPrinter printer;
  document.Print(&printer);
  return printer.CStr();
}

}  // namespace

std::string_view Name(Keep keep) {
  switch (keep) {
    case Keep::kAll:
      return "all";
    case Keep::kFailing:
      return "failing";
    case Keep::kVerdicts:
      return "verdicts";
  }
  return "unknown";
}

FlightResult NotFlown(const PlannedFlight& flight, const std::string& reason) {
  FlightResult result;
  result.name = flight.name;
  result.expected = flight.expected;
  result.seed = flight.seed;
  result.outcome = Outcome::kError;
  result.score.verdict = Verdict::kError;
  result.score.cause = VerdictCause::kNotFlown;
  result.score.reason = reason;
  return result;
}

std::string ToJsonText(const FlightResult& result) { return JsonText(ToFile(result), 2) + "\n"; }

FlightResult ResultFromJsonText(const std::string& text) {
  try {
    return ResultFromFile(Json::parse(text));
  } catch (const std::exception& error) {
    throw std::runtime_error(std::string("not the result of a flight: ") + error.what());
  }
}

void WriteRunInfo(const std::filesystem::path& folder, const RunInfo& info) {
  Json json = {{"format", kResultsFormat}};
  JsonWriter::PutFields(json, info);
  WriteFile(folder / "run.json", JsonText(json, 2) + "\n");
}

RunInfo ReadRunInfo(const std::filesystem::path& folder) {
  const auto file = folder / "run.json";
  const std::string text = ReadFile(file);
  try {
    const Json json = Json::parse(text);
    CheckFormat(json);
    return FromJson<RunInfo>(json);
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

void WriteResults(const std::filesystem::path& folder, const RunInfo& info,
                  const std::vector<FlightResult>& results) {
  Json json = {{"format", kResultsFormat}};
  json["suite"] = info.suite;
  json["started"] = info.started;
  json["version"] = Version();
  json["seed"] = info.seed;
  json["interrupted"] = info.interrupted;
  json["scenarios"] = Json::array();
  for (const auto& result : results) json["scenarios"].push_back(ToFile(result));
  json["not_applicable"] = ToJson(info.not_applicable);
  // Hash of all that precedes it: a reader notices a change by hand.
  json["hash"] = HashOf(JsonText(json, 2));
  WriteFile(folder / "results.json", JsonText(json, 2) + "\n");
  WriteFile(folder / "junit.xml", JunitXml(info, results));
}

std::vector<FlightResult> ReadResults(const std::filesystem::path& folder) {
  const auto file = folder / "results.json";
  const std::string text = ReadFile(file);
  try {
    Json json = Json::parse(text);
    CheckFormat(json);
    if (const auto recorded = json.find("hash"); recorded != json.end()) {
      const Json hash = *recorded;
      json.erase(recorded);
      if (hash != HashOf(JsonText(json, 2)))
        throw std::runtime_error(
            "it has changed since it was written; `tiltproof score` writes it again from the flights that "
            "were "
            "kept");
    }
    std::vector<FlightResult> results;
    for (const Json& entry : json.at("scenarios")) results.push_back(ResultFromFile(entry));
    return results;
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

int ExitCode(const std::vector<FlightResult>& results) {
  bool error = false, decided = false, undecided = false;
  for (const auto& result : results) {
    if (result.green()) continue;
    error |= result.score.verdict == Verdict::kError;
    decided |= result.score.verdict == Verdict::kPass || result.score.verdict == Verdict::kFail;
    undecided |= result.score.verdict == Verdict::kInconclusive;
  }
  return error ? 3 : decided ? 1 : undecided ? 4 : 0;
}

std::string_view Version() { return TILTPROOF_VERSION; }

}  // namespace tiltproof::harness
