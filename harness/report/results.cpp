#include "harness/report/results.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <pugixml.hpp>
#include <sstream>

#include "harness/report/files.h"
#include "harness/report/json_text.h"

namespace tiltproof::harness {
namespace {

using Json = nlohmann::ordered_json;

// JSON has no infinity: the robustness of a formula that no number bounds is null, like one that there is none of.
Json OptionalNumber(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}
std::optional<double> OptionalFrom(const Json& json) {
  if (json.is_null()) return std::nullopt;
  return json.get<double>();
}

Verdict VerdictNamed(const std::string& name) { return EnumNamed("verdict", name, Verdict::kError); }

// Of a name that may be absent, or null.
template <class Enum>
std::optional<Enum> MaybeNamed(const Json& json, const char* key, Enum last) {
  const Json name = json.value(key, Json());
  if (name.is_null()) return std::nullopt;
  return EnumNamed(key, name.get<std::string>(), last);
}

Json ToJson(const FlightResult& result) {
  Json json = {{"format", kResultsFormat}};
  json["name"] = result.name;
  json["verdict"] = Name(result.score.verdict);
  json["expected"] = Name(result.expected);
  json["green"] = result.green();
  json["reason"] = result.score.reason;
  json["seed"] = result.seed;
  json["trace_hash"] = result.trace_hash;
  json["end_reason"] = result.end_reason ? Json(Name(*result.end_reason)) : Json(nullptr);
  json["outcome"] = result.outcome ? Json(Name(*result.outcome)) : Json(nullptr);
  json["wall_s"] = result.wall_s;
  json["real_time_factor"] = result.real_time_factor;
  json["metrics"] = Json::object();
  for (const auto& [name, value] : result.score.metrics) json["metrics"][name] = value;
  json["histograms"] = Json::object();
  for (const auto& [name, histogram] : result.score.histograms)
    json["histograms"][name] = {{"edges", histogram.edges_ms}, {"counts", histogram.counts}};
  json["criteria"] = Json::array();
  for (const auto& criterion : result.score.criteria)
    json["criteria"].push_back({{"name", criterion.name},
                                {"verdict", Name(criterion.verdict)},
                                {"robustness", OptionalNumber(criterion.robustness)},
                                {"margin", OptionalNumber(criterion.margin)},
                                {"time_s", OptionalNumber(criterion.time_s)},
                                {"explanation", criterion.explanation}});
  json["faults"] = Json::array();
  for (const auto& fault : result.score.faults)
    json["faults"].push_back({{"id", fault.id}, {"type", fault.type}, {"activations", fault.activations}});
  json["restarts"] = result.score.restarts_count;
  json["replay"] = result.replay;
  return json;
}

FlightResult ResultFromJson(const Json& json) {
  CheckFormat(json);
  FlightResult result;
  json.at("name").get_to(result.name);
  result.expected = VerdictNamed(json.at("expected").get<std::string>());
  json.at("seed").get_to(result.seed);
  json.at("trace_hash").get_to(result.trace_hash);
  // Absent from the files of older versions, like others below.
  result.end_reason = MaybeNamed(json, "end_reason", EndReason::kHarnessError);
  result.outcome = MaybeNamed(json, "outcome", Outcome::kUnaffected);
  json.at("wall_s").get_to(result.wall_s);
  json.at("real_time_factor").get_to(result.real_time_factor);
  json.at("replay").get_to(result.replay);
  result.score.verdict = VerdictNamed(json.at("verdict").get<std::string>());
  json.at("reason").get_to(result.score.reason);
  for (const auto& [name, value] : json.at("metrics").items())
    result.score.metrics[name] = value.get<double>();
  // Absent from the files of older versions.
  if (json.contains("histograms"))
    for (const auto& [name, histogram] : json["histograms"].items())
      result.score.histograms[name] = {histogram.at("edges").get<std::vector<double>>(),
                                       histogram.at("counts").get<std::vector<std::int64_t>>()};
  result.score.restarts_count = json.value("restarts", std::int64_t{0});
  for (const auto& c : json.at("criteria"))
    result.score.criteria.push_back(
        {c.at("name").get<std::string>(), VerdictNamed(c.at("verdict").get<std::string>()),
         OptionalFrom(c.at("robustness")), OptionalFrom(c.at("time_s")),
         c.at("explanation").get<std::string>(), OptionalFrom(c.value("margin", Json()))});
  for (const auto& f : json.at("faults"))
    result.score.faults.push_back({f.at("id").get<std::string>(), f.at("type").get<std::string>(),
                                   f.at("activations").get<std::int64_t>()});
  return result;
}

Json ToJson(const std::vector<NotApplicable>& scenarios) {
  Json json = Json::array();
  for (const auto& scenario : scenarios)
    json.push_back({{"name", scenario.name}, {"reason", scenario.reason}});
  return json;
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

void AddTestCase(pugi::xml_node suite, const std::string& suite_name, const FlightResult& result) {
  auto test = suite.append_child("testcase");
  test.append_attribute("classname") = suite_name.c_str();
  test.append_attribute("name") = XmlSafe(result.name).c_str();
  test.append_attribute("time") = Decimal(result.wall_s).c_str();
  if (result.green()) return;
  const std::string verdict(Name(result.score.verdict));
  auto failure = test.append_child(result.score.verdict == Verdict::kError ? "error" : "failure");
  failure.append_attribute("message") =
      XmlSafe(fmt::format("{}, expected {}: {}", verdict, Name(result.expected), result.score.reason))
          .c_str();
  failure.append_attribute("type") = verdict.c_str();
  std::string text = fmt::format("seed {}\nreplay: {}\n", result.seed, result.replay);
  for (const auto& criterion : result.score.criteria)
    text += fmt::format("{} {}: {}\n", Name(criterion.verdict), criterion.name, criterion.explanation);
  failure.append_child(pugi::node_pcdata).set_value(XmlSafe(text).c_str());
}

void AddSkipped(pugi::xml_node suite, const std::string& suite_name, const NotApplicable& scenario) {
  auto test = suite.append_child("testcase");
  test.append_attribute("classname") = suite_name.c_str();
  test.append_attribute("name") = XmlSafe(scenario.name).c_str();
  test.append_attribute("time") = Decimal(0.0).c_str();
  test.append_child("skipped").append_attribute("message") = XmlSafe(scenario.reason).c_str();
}

// Elements, attributes and their order are what the schemas of Ant and Jenkins both know; a test holds that.
std::string JunitXml(const RunInfo& info, const std::vector<FlightResult>& results) {
  pugi::xml_document document;
  auto suite = document.append_child("testsuites").append_child("testsuite");
  const std::string name = XmlSafe(info.suite);
  unsigned failures = 0, errors = 0;
  double time_s = 0;
  for (const auto& result : results) {
    if (!result.green()) ++(result.score.verdict == Verdict::kError ? errors : failures);
    time_s += result.wall_s;
  }
  suite.append_attribute("name") = name.c_str();
  suite.append_attribute("package") = name.c_str();
  suite.append_attribute("id") = 0;
  suite.append_attribute("hostname") = HostName().c_str();
  // UTC. Ant's schema knows neither zone nor fractions of a second.
  suite.append_attribute("timestamp") = info.started.substr(0, 19).c_str();
  suite.append_attribute("tests") = static_cast<unsigned>(results.size() + info.not_applicable.size());
  suite.append_attribute("failures") = failures;
  suite.append_attribute("errors") = errors;
  suite.append_attribute("skipped") = static_cast<unsigned>(info.not_applicable.size());
  suite.append_attribute("time") = Decimal(time_s).c_str();
  auto properties = suite.append_child("properties");
  const auto add_property = [&properties](const char* key, const std::string& value) {
    auto property = properties.append_child("property");
    property.append_attribute("name") = key;
    property.append_attribute("value") = XmlSafe(value).c_str();
  };
  add_property("version", std::string(Version()));
  add_property("seed", std::to_string(info.seed));
  add_property("mode", info.mode);
  add_property("client", info.client);
  for (const auto& result : results) AddTestCase(suite, name, result);
  for (const auto& scenario : info.not_applicable) AddSkipped(suite, name, scenario);
  suite.append_child("system-out");
  suite.append_child("system-err");
  std::ostringstream out;
  document.save(out, "  ");
  return out.str();
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

Keep KeepNamed(std::string_view name) { return EnumNamed("keep", name, Keep::kVerdicts); }

FlightResult NotFlown(const PlannedFlight& flight, const std::string& reason) {
  FlightResult result;
  result.name = flight.name;
  result.expected = flight.expected;
  result.seed = flight.seed;
  result.outcome = Outcome::kError;
  result.score.verdict = Verdict::kError;
  result.score.reason = reason;
  return result;
}

std::string ToJsonText(const FlightResult& result) { return JsonText(ToJson(result), 2) + "\n"; }

FlightResult ResultFromJsonText(const std::string& text) { return ResultFromJson(Json::parse(text)); }

void WriteRunInfo(const std::filesystem::path& folder, const RunInfo& info) {
  Json json = {{"format", kResultsFormat}};
  json["suite"] = info.suite;
  json["started"] = info.started;
  json["version"] = Version();
  json["build"] = info.build;
  json["machine"] = info.machine;
  json["seed"] = info.seed;
  json["mode"] = info.mode;
  json["client"] = info.client;
  if (!info.clients.empty()) json["clients"] = info.clients;
  json["command"] = info.command;
  json["interrupted"] = info.interrupted;
  json["keep"] = Name(info.keep);
  json["flights"] = Json::array();
  for (const auto& flight : info.flights) {
    Json entry = {{"name", flight.name}, {"expected", Name(flight.expected)}, {"seed", flight.seed}};
    if (flight.bus)
      entry["bus"] = {
          {"domain", flight.bus->domain}, {"tag", flight.bus->tag}, {"run_id", flight.bus->run_id}};
    json["flights"].push_back(std::move(entry));
  }
  json["not_applicable"] = ToJson(info.not_applicable);
  if (!info.realtime_rights.empty()) json["realtime_rights"] = info.realtime_rights;
  WriteFile(folder / "run.json", JsonText(json, 2) + "\n");
}

RunInfo ReadRunInfo(const std::filesystem::path& folder) {
  const auto file = folder / "run.json";
  const std::string text = ReadFile(file);
  try {
    const Json json = Json::parse(text);
    CheckFormat(json);
    RunInfo info;
    json.at("suite").get_to(info.suite);
    json.at("started").get_to(info.started);
    json.at("seed").get_to(info.seed);
    info.mode = json.value("mode", "lockstep");
    json.at("client").get_to(info.client);
    if (json.contains("clients")) json["clients"].get_to(info.clients);
    info.build = json.value("build", "");
    info.machine = json.value("machine", Machine());
    json.at("command").get_to(info.command);
    json.at("interrupted").get_to(info.interrupted);
    // Absent from the files of older versions.
    info.keep = KeepNamed(json.value("keep", "all"));
    for (const Json& flight : json.value("flights", Json::array()))
      info.flights.push_back({flight.at("name").get<std::string>(),
                              VerdictNamed(flight.at("expected").get<std::string>()),
                              flight.at("seed").get<std::uint64_t>()});
    for (const Json& scenario : json.value("not_applicable", Json::array()))
      info.not_applicable.push_back(
          {scenario.at("name").get<std::string>(), scenario.at("reason").get<std::string>()});
    return info;
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
  for (const auto& result : results) json["scenarios"].push_back(ToJson(result));
  json["not_applicable"] = ToJson(info.not_applicable);
  WriteFile(folder / "results.json", JsonText(json, 2) + "\n");
  WriteFile(folder / "junit.xml", JunitXml(info, results));
}

std::vector<FlightResult> ReadResults(const std::filesystem::path& folder) {
  const auto file = folder / "results.json";
  const std::string text = ReadFile(file);
  try {
    const Json json = Json::parse(text);
    CheckFormat(json);
    std::vector<FlightResult> results;
    for (const Json& entry : json.at("scenarios")) results.push_back(ResultFromJson(entry));
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
