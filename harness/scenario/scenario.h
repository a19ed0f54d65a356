// A scenario: what is flown, through which line, with which faults, and what counts as success. Plain data,
// no YAML here.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "faults/fault.h"
#include "harness/reference/reference_spec.h"
#include "link/messages.h"
#include "link/time.h"

namespace tiltproof::harness {

// Verdicts in order of precedence, weakest first: error > fail > inconclusive > pass.
enum class Verdict : std::uint8_t { kPass, kInconclusive, kFail, kError };
std::string_view Name(Verdict verdict);

enum class AngularRates : std::uint8_t { kWorld, kBody, kEuler };
std::string_view Name(AngularRates rates);

struct LinkSpec {
  bool ideal = false;  // zero byte time
  std::int64_t baud = 921'600;
  link::Dialect dialect = link::Dialect::kPaper;
  double adapter_latency_ms = 0.0;

  // The second serial line keeps the paper's rate whatever the first one's is.
  static constexpr std::int64_t kReferenceBaud = 921'600;
  // What a serial port is set to; on an ideal line the port's rate does not matter.
  std::int64_t port_baud() const { return ideal ? 921'600 : baud; }
  friend bool operator==(const LinkSpec&, const LinkSpec&) = default;
};

// Criteria that every scenario has without listing them; no other criterion takes these names.
inline constexpr std::string_view kSurvivalCriterion = "survival";
inline constexpr std::string_view kControlPeriodCriterion = "control_period";
inline constexpr std::array kImplicitCriteria = {kSurvivalCriterion, kControlPeriodCriterion};

// Files that lie beside the scenarios' folders in that of a run; no scenario takes these names.
inline constexpr std::array<std::string_view, 5> kRunFiles = {"run.json", "results.json", "events.jsonl",
                                                              "junit.xml", "report.html"};

struct CriterionSpec {
  std::string name;
  // Either a formula...
  std::string stl;
  // ... or a metric with bounds.
  std::string metric;
  std::optional<double> min, max;
  friend bool operator==(const CriterionSpec&, const CriterionSpec&) = default;
};

struct Scenario {
  std::filesystem::path file;  // where it was read from
  std::string name;
  std::string description;
  std::vector<std::string> tags;
  std::string model = "tiltrotor";   // as written
  std::filesystem::path model_file;  // resolved
  std::string firmware = "paper";
  Verdict expect = Verdict::kPass;
  TimeNs start_within_ns = 10 * kNsPerS;  // from power-on: no firmware is hung before, unless it has started
  bool allow_restarts = false;            // of the firmware, that no fault asked for
  double control_period_tolerance_percent = 1.0;
  std::uint64_t seed = 1;
  TimeNs duration_ns = 0;
  TimeNs step_ns = 4 * kNsPerMs;
  AngularRates angular_rates = AngularRates::kWorld;  // of the sensors sent; the trace's are world rates
  bool allow_invalid_inertia = false;
  std::array<double, 3> initial_position_m{};  // default: the reference's start
  std::array<double, 3> initial_attitude_rad{};
  LinkSpec link;
  ReferenceSpec reference;
  std::vector<faults::FaultSpec> faults;
  std::vector<std::string> fault_places;  // "file:line:column" of each fault's type, when read from a file
  std::vector<CriterionSpec> criteria;
};

}  // namespace tiltproof::harness
