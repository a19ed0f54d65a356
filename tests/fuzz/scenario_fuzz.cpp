// The reader of scenario files: any text is a scenario or a list of problems with their places; a scenario written out
// with all its defaults reads back as the same text.
//
// Input: the file.
#include <cstddef>
#include <cstdint>
#include <string>

#include "harness/formula/condition.h"
#include "harness/run/fault_conditions.h"
#include "harness/run/trace.h"
#include "harness/scenario/reader.h"
#include "harness/score/signals.h"
#include "harness/score/stl.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch.h"

namespace {

using namespace tiltproof::harness;
using tiltproof::testing::Require;
using tiltproof::testing::Tried;

// As the command line reads, with the built-in vehicle for every model.
ReadOptions Options() {
  ReadOptions options;
  options.models_folder = tiltproof::testing::TiltrotorFile().parent_path();
  options.vehicle_signals = [](const Scenario&) { return tiltproof::testing::Tiltrotor().signals(); };
  const auto problem = [](const auto& parse) -> std::optional<FormulaProblem> {
    try {
      parse();
      return std::nullopt;
    } catch (const stl::ParseError& error) {
      return FormulaProblem{error.column, error.what()};
    }
  };
  const auto columns = [](const Scenario& scenario) {
    return Trace(TraceLayout(tiltproof::testing::Tiltrotor().signals(), scenario).columns).columns();
  };
  options.check_formula = [=](std::string_view text, const Scenario& scenario) {
    std::vector<std::string> fault_ids;
    for (const auto& fault : scenario.faults) fault_ids.push_back(fault.id);
    const auto signals = SignalNames(columns(scenario));
    return problem([&] {
      stl::EarliestDecision(stl::Parse(text, {.signals = signals, .fault_ids = fault_ids}),
                            scenario.duration_ns);
    });
  };
  options.check_condition = [=](std::string_view text, const Scenario& scenario) {
    return problem([&] { stl::Condition(text, FaultConditions::SignalNames(columns(scenario))); });
  };
  return options;
}

void CheckPlaces(const ScenarioError& error) {
  Require(!error.diagnostics().empty(), "a refusal names its problems");
  for (const Diagnostic& diagnostic : error.diagnostics()) {
    Require(!diagnostic.message.empty(), "a problem is said");
    Require(diagnostic.line >= 0 && diagnostic.column >= 0, "a problem has a place");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ReadOptions options = Options();
  static const auto file = tiltproof::testing::ScratchFolder() / "fuzz.yaml";
  try {
    const Scenario scenario = ParseScenario(std::string(data, data + size), file, options);
    const std::string written = WriteResolved(scenario);
    const auto again = Tried<ScenarioError>([&] { return ParseScenario(written, file, options); });
    Require(again.has_value(), "what was written can be read");
    Require(WriteResolved(*again) == written, "what was read is what was written");
  } catch (const ScenarioError& error) {
    CheckPlaces(error);
  }
  return 0;
}
