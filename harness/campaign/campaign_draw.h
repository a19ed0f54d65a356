// The draws of a campaign: from its plan and a run's number to the scenario of that run. Pure: run N needs only the plan,
// in which the seed is, and N. So runs may be flown in any order, on any machine, and again.
//
//   CampaignPlan plan = {.spec = spec, .bases = {base}};
//   plan.bases.front().types = PrepareTypes(plan.spec.draw, base.scenario, signals, rows);
//   const DrawnRun run = DrawRun(plan, 17);
//   Print(stdout, "{}\n", WriteResolved(run.scenario));
//
// Swarm testing (Groce, Zhang, Eide, Chen, Regehr: Swarm Testing, ISSTA 2012): each run first draws a random subset of the
// fault types, and then its faults from this subset. A fault that hides others is so left out of many runs. The subset's
// size is drawn on a logarithmic scale, because a flight has few faults: with half of 80 types each, two faults would
// hardly ever be of the same type.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "harness/campaign/campaign_file.h"
#include "harness/campaign/campaign_store.h"
#include "harness/campaign/campaign_summary.h"
#include "harness/campaign/envelope_rows.h"
#include "harness/campaign/fault_level.h"
#include "harness/scenario/scenario.h"
#include "plant/vehicle_model.h"

namespace tiltproof::harness {

// A fault type at one place.
struct DrawPlace {
  // "to_client", "z_m", "a:to_client", "cross"; empty: the type has one place only.
  std::string name;
  faults::FaultSpec fault;           // there, with the parameters of the type's example
  std::optional<Severity> severity;  // none: the length of the window measures it, or nothing does
};
struct DrawType {
  const faults::FaultType* type = nullptr;
  std::vector<DrawPlace> places;
};

// A scenario to which faults are added.
struct DrawBase {
  Scenario scenario;
  std::shared_ptr<const plant::VehicleModel> model;
  std::vector<DrawType> types;
};

struct CampaignPlan {
  CampaignSpec spec;
  std::vector<DrawBase> bases;
};

// True if faults of this type are drawn. Without patterns these are all types but those of the harness itself, which change
// nothing, and frame.script, which says by itself what it does.
bool IsDrawn(const DrawSpec& spec, const faults::FaultType& type);

// The rows that the spec's patterns select, by type, in order. `signals`: of the scenario's vehicle.
std::vector<DrawType> PrepareTypes(const DrawSpec& spec, const Scenario& scenario,
                                   const VehicleSignals& signals, std::span<const EnvelopeRow> rows);

// The scenario in which each criterion `always(X)` must hold only at the end: in the last quarter of recover_s. Criteria of
// another form stay as they are.
Scenario WithRecovery(const Scenario& scenario, double recover_s);

struct DrawnRun {
  std::uint64_t number = 0;
  std::size_t base = 0;  // its place in the plan
  Scenario scenario;
  std::vector<CampaignFault> faults;  // that were added, in the scenario's order; `activations` is 0
};
// Numbers count from 0. With several builds of the firmware, run N is flown by build N modulo their count, and runs whose
// number divided by their count is equal have equal draws. So have their scenarios, in turn.
DrawnRun DrawRun(const CampaignPlan& plan, std::uint64_t number);
// The place of a run's base in the plan.
std::size_t BaseOf(const CampaignPlan& plan, std::uint64_t number);

// The level at this share, from 0 to 1, of the way from the mildest level to the most severe one. On a logarithmic scale,
// and where the range ends only at the largest number allowed, levels are from a hundredth of the typical distance to a
// hundred times that.
double LevelAt(const LevelRange& range, double share);

// The frame of the campaign's summary: the bands of each severity have equal shares of the way.
CampaignFrame MakeFrame(const CampaignPlan& plan);

}  // namespace tiltproof::harness
