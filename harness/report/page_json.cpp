#include "harness/report/page_json.h"

#include <utility>

#include "harness/score/headline.h"

namespace tiltproof::harness {
namespace {

// The criterion that failed first, for the table.
const CriterionResult* FirstOf(const Score& score) {
  const CriterionResult* first = nullptr;
  for (const CriterionResult& criterion : score.criteria) {
    if (criterion.verdict != score.verdict || criterion.verdict == Verdict::kPass) continue;
    if (first == nullptr || criterion.time_s.value_or(1e300) < first->time_s.value_or(1e300))
      first = &criterion;
  }
  return first;
}

}  // namespace

Json EntryJson(const RunView& view, const FlightEntry& flight) {
  const FlightResult& result = flight.result;
  Json json = {{"name", result.name},
               {"run", flight.run},
               {"verdict", Name(result.score.verdict)},
               {"expected", Name(result.expected)},
               {"green", result.green()},
               {"seed", result.seed},
               {"reason", result.score.reason},
               {"replay", result.replay},
               {"trace_hash", result.trace_hash}};
  JsonWriter::Put(json["margin"], flight.margin);
  if (const CriterionResult* least = HeadlineCriterion(result.score)) json["margin_of"] = least->name;
  for (const auto& [key, metric] :
       {std::pair{"flown_s", "survival.time_s"}, std::pair{"rmse_m", "tracking.rmse_m"}}) {
    const auto found = result.score.metrics.find(metric);
    if (found != result.score.metrics.end()) JsonWriter::Put(json[key], found->second);
  }
  if (const CriterionResult* first = FirstOf(result.score)) {
    json["criterion"] = first->name;
    JsonWriter::Put(json["time_s"], first->time_s);
  }
  JsonWriter::Put(json["faults"], result.score.faults);
  if (flight.before) {
    json["before"] = {{"verdict", Name(flight.before->verdict)}};
    JsonWriter::Put(json["before"]["margin"], flight.before->margin);
  } else if (!view.baseline.empty()) {
    json["before"] = nullptr;
  }
  return json;
}

void PutResult(Json& json, const FlightResult& result) {
  JsonWriter::PutFields(json["result"], result);
  JsonWriter::PutFields(json["result"], result.score);
}

Json RunJson(const RunEntry& run) {
  Json json = {{"folder", run.folder.string()}};
  JsonWriter::PutFields(json, run.info);
  json.erase("flights");
  if (!run.problem.empty()) json["problem"] = run.problem;
  return json;
}

}  // namespace tiltproof::harness
