// A scenario: what is flown, over which line, with which faults, and what counts as success. Plain data; no
// YAML here.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "faults/fault.h"
#include "harness/reference/reference_spec.h"
#include "harness/scenario/shipped_protocols.h"
#include "link/character.h"
#include "link/protocol.h"
#include "link/time.h"

namespace tiltproof::harness {

// Verdicts in order of precedence, weakest first: error > fail > inconclusive > pass.
enum class Verdict : std::uint8_t { kPass, kInconclusive, kFail, kError };
std::string_view Name(Verdict verdict);
constexpr Verdict LastOf(Verdict) { return Verdict::kError; }

enum class AngularRates : std::uint8_t { kWorld, kBody, kEuler };
std::string_view Name(AngularRates rates);

// A USB-serial adapter that holds bytes in a buffer until it is full, or until this long after the first of them.
struct AdapterSpec {
  double latency_ms = 16;         // FTDI's default (AN232B-04)
  std::int64_t bytes_count = 62;  // a full-speed packet of 64 bytes without its two bytes of status
  friend bool operator==(const AdapterSpec&, const AdapterSpec&) = default;
};

struct LinkSpec {
  static constexpr std::int64_t kDefaultBaud = link::LineRate::kUsualBaud;

  bool ideal = false;  // zero byte time
  std::int64_t baud = kDefaultBaud;
  std::int64_t reference_baud = kDefaultBaud;
  link::CharacterFormat character;                                         // on both lines
  std::shared_ptr<const link::Protocol> protocol = FindProtocol("paper");  // never null
  double adapter_latency_ms = 0.0;
  std::optional<AdapterSpec> adapter;  // in both directions of the main line

  link::LineRate main_rate() const { return {ideal ? 0 : baud, character}; }
  link::LineRate reference_rate() const { return {ideal ? 0 : reference_baud, character}; }
  // The rates to which serial ports are set; on an ideal line they do not matter.
  std::int64_t port_baud() const { return ideal ? kDefaultBaud : baud; }
  std::int64_t reference_port_baud() const { return ideal ? kDefaultBaud : reference_baud; }
  friend bool operator==(const LinkSpec&, const LinkSpec&) = default;
};

// Version of scenario files. It is increased when a file of the previous format would be misread.
inline constexpr std::int64_t kScenarioFormat = 1;

// Criteria that every scenario has without listing them; no other criterion takes these names.
inline constexpr std::string_view kSurvivalCriterion = "survival";
inline constexpr std::string_view kControlPeriodCriterion = "control_period";
inline constexpr std::string_view kCleanLineCriterion = "clean_line";
inline constexpr std::array kImplicitCriteria = {kSurvivalCriterion, kControlPeriodCriterion,
                                                 kCleanLineCriterion};

// Files next to the scenarios' folders in the folder of a run; no scenario takes these names.
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

// A client with its own serial line.
struct ClientEntry {
  std::string id;
  std::string firmware;  // build; empty: the scenario's
  friend bool operator==(const ClientEntry&, const ClientEntry&) = default;
};
inline constexpr std::size_t kClientsMax = 16;

// A serial line between two clients, 8N1. It carries bytes as they are.
struct LineEntry {
  std::string id;
  std::vector<std::string> between;  // the ids of its two ends
  std::int64_t baud = LinkSpec::kDefaultBaud;
  std::shared_ptr<const link::Protocol> protocol =
      {};  // of the frames on it, for faults; null: nothing is known of them
  link::LineRate rate() const { return {.baud = baud, .character = {}}; }
  friend bool operator==(const LineEntry&, const LineEntry&) = default;
};
inline constexpr std::size_t kLinesMax = 64;
// Lets the fault act on this line in place of the clients' own: towards the client at that end of `between`, or both ways.
void PutOnLine(const LineEntry& line, std::optional<std::size_t> end, faults::FaultSpec& fault);
inline constexpr std::string_view kBytesAsTheyAre = "bytes";  // the protocol of a line without

// One end of such a line.
struct LineEndId {
  std::size_t line = 0;  // its place in the scenario
  std::size_t end = 0;   // in `between`
  friend bool operator==(const LineEndId&, const LineEndId&) = default;
};

inline constexpr std::string_view kOnlyClient = "main";  // id of the client of a scenario that names none

// A number that a firmware takes from the scenario.
struct FirmwareParameter {
  std::string name;
  double value = 0;
  friend bool operator==(const FirmwareParameter&, const FirmwareParameter&) = default;
};

// The way in which the commands of several clients become the vehicle's input: docs/redundancy.md.
enum class ArbiterType : std::uint8_t {
  kSingle,         // those of one client, named beforehand
  kPrimaryBackup,  // those of the first in an order that is not silent
  kActiveClaims,   // those of the client that claims to be active
  kMidValue,       // the median of each input
  kDuplexCompare   // those of the first of two that agree
};
std::string_view Name(ArbiterType type);
struct ArbiterSpec {
  ArbiterType type = ArbiterType::kSingle;
  std::string client = {};  // single: whose actuators are in force; empty: the first one's
  // All but single: the age up to which a client's last accepted command counts; none: three control periods.
  std::optional<double> timeout_ms = {};
  std::vector<std::string> order = {};  // primary_backup; empty: the scenario's order
  std::optional<double> return_ms =
      {};  // primary_backup: gapless messages before an earlier one returns; none: never
  double tolerance_percent = 0;          // duplex_compare: of an input's range
  std::string on_disagreement = "hold";  // duplex_compare: hold, hover, or a client
  friend bool operator==(const ArbiterSpec&, const ArbiterSpec&) = default;
};
// Words of on_disagreement that are no client.
inline constexpr std::string_view kHoldInput = "hold", kHoverInput = "hover";

// The verdict that makes a flight green: the same for every build of the firmware, or some builds have their own.
struct Expectation {
  Verdict verdict = Verdict::kPass;                          // of builds that are not named
  std::vector<std::pair<std::string, Verdict>> by_firmware;  // as written
  Verdict Of(std::string_view firmware) const;
  friend bool operator==(const Expectation&, const Expectation&) = default;
};

// Ground on which the vehicle may start, stand and land.
struct SolidGround {
  double touch_down_max_m_s = 1;  // normal speed of a touching point; a harder touch ends the flight
  friend bool operator==(const SolidGround&, const SolidGround&) = default;
};

struct Scenario {
  std::filesystem::path file;  // where it was read from
  std::int64_t format = kScenarioFormat;
  std::string name;
  std::string description;
  std::vector<std::string> tags;
  std::string model = "tiltrotor";   // as written
  std::filesystem::path model_file;  // resolved
  std::string firmware = "paper";
  // The gain of a firmware that flies any vehicle, as written: a CSV file of design-lqr, or `design`. Empty is
  // `design`, too.
  std::string gain;
  std::filesystem::path gain_file;  // empty: the gain is designed
  // For a library or program that takes parameters. Of the shipped builds only `lqr` takes one, compute_us.
  std::vector<FirmwareParameter> firmware_parameters;
  Expectation expect;
  TimeNs start_within_ns = 10 * kNsPerS;  // from power-on: no firmware is hung before, unless it has started
  bool allow_restarts = false;            // of the firmware, that no fault asked for
  bool held = false;                      // on a test stand: the vehicle does not move
  bool sensor_noise = true;               // of the sensors of the vehicle's file; not that of faults
  double control_period_tolerance_percent = 1.0;
  std::int64_t clean_line_periods_count = 1;  // that may be unclean, of each kind
  std::uint64_t seed = 1;
  TimeNs duration_ns = 0;
  TimeNs stop_ns = kNever;  // the flight is stopped before its duration
  TimeNs end_ns() const { return std::min(duration_ns, stop_ns); }
  TimeNs step_ns = 4 * kNsPerMs;
  // The delay that the loop of vehicle and firmware tolerates, in addition to its own. The default is that of
  // the paper's vehicle and gain, rounded: tests/plant/lqr_design_test.cpp computes 8.99 ms.
  TimeNs delay_margin_ns = 9 * kNsPerMs;
  // In real time, whatever is later than this is the machine's fault.
  TimeNs late_after_ns() const { return delay_margin_ns / 3; }
  // From power-on, the time that a client has to start; it may boot for longer than a short flight lasts.
  TimeNs start_wait_ns() const { return std::max(start_within_ns, duration_ns); }
  AngularRates angular_rates = AngularRates::kWorld;  // of the sensors sent; the trace's are world rates
  bool allow_invalid_inertia = false;
  std::array<double, 3> initial_position_m{};  // default: the reference's start
  std::array<double, 3> initial_attitude_rad{};
  bool initial_on_ground = false;           // at the height at which it stands; initial_position_m[2] is 0
  std::optional<SolidGround> solid_ground;  // none: any touch ends the flight
  LinkSpec link;
  ReferenceSpec reference;
  std::vector<faults::FaultSpec> faults;
  std::vector<std::string> fault_places;  // "file:line:column" of each fault's type, when read from a file
  std::vector<CriterionSpec> criteria;
  std::vector<std::string>
      criterion_places;            // "file:line:column" of each formula or metric, when read from a file
  std::vector<std::string> watch;  // variables of the firmware's image
  std::vector<std::string> watch_places;  // "file:line:column" of each, when read from a file
  std::vector<std::string> line_places;   // "file:line:column" of each line's id, likewise
  // "file:line:column" of these keys, or of what stands for them, when read from a file.
  std::string reference_place, initial_place, arbiter_place, link_place;
  std::filesystem::path protocol_file;  // empty: the protocol is a shipped one, or in this file

  // As written; empty: one, whose id is kOnlyClient.
  std::vector<ClientEntry> clients;
  std::vector<LineEntry> lines;  // between the clients
  ArbiterSpec arbiter;

  std::size_t client_count() const { return clients.empty() ? 1 : clients.size(); }
  bool has_several_clients() const { return clients.size() > 1; }
  // `client`: the client's place among them.
  std::string client_id(std::size_t client) const;
  const std::string& firmware_of(std::size_t client) const;
  // Every client flies this build, whatever the file says.
  void FlyFirmware(const std::string& build);
  // The verdict that makes the flight green: that of the build that moves the vehicle, or is the first to move it.
  Verdict expected() const { return expect.Of(firmware_of(selected_client())); }
  // Seed for the faults on this client's line and board. For a flight's only client it is the scenario's.
  std::uint64_t seed_of(std::size_t client) const;
  // single: whose actuators are in force, and whose `start` is t = 0. primary_backup: the first in its order. Otherwise the
  // scenario's first client.
  std::size_t selected_client() const;
  // Seed for the faults on this line between boards.
  std::uint64_t seed_of_line(std::size_t line) const;
  // The ends of lines at this client, in the order of `lines`: its UARTs from 2 on.
  std::vector<LineEndId> line_ends_of(std::size_t client) const;
  // Protocol of the frames on which the fault acts: that of the link, or of a line between boards.
  const link::Protocol& protocol_of(const faults::FaultSpec& fault) const;
  // Id of a wire's client, or of its line: `place` counts the clients and then the lines (WireId).
  std::string wire_owner_id(std::size_t place) const;
  // Its place; none: there is no client of this id.
  std::optional<std::size_t> FindClient(std::string_view id) const;
  // True if the flight has a choice of clients: several, and an arbiter that chooses in flight.
  bool is_redundant() const { return has_several_clients() && arbiter.type != ArbiterType::kSingle; }
  // After so long without an accepted command a client no longer counts.
  TimeNs arbiter_timeout_ns() const;
};

// Adds a client's id to a name in a flight with several clients: ("link.", 0, "resync_max_ms") is
// "link.a.resync_max_ms". In a flight with one client the name has no id: "link.resync_max_ms". `separator`
// follows the id.
std::string ClientName(const Scenario& scenario, std::string_view before, std::size_t client, char separator,
                       std::string_view after);

// The trace's column of a watched variable in a flight with one client: watch_controller_gains_3 of
// controller.gains[3]. A formula must be able to read it, so all but letters and digits becomes '_'.
std::string WatchColumn(std::string_view variable);

// The metrics that a flight of this scenario has, from those of a flight with one client.
std::vector<std::string> MetricNamesOf(const Scenario& scenario,
                                       const std::vector<std::string>& metric_names);

}  // namespace tiltproof::harness
