#include "harness/scenario/scenario_checks.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>

#include "faults/registry.h"
#include "faults/signal_choice.h"
#include "faults/volume.h"
#include "harness/reference/trajectory.h"
#include "harness/scenario/board_line_checks.h"
#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/model_path.h"
#include "harness/scenario/protocol_file.h"
#include "harness/scenario/scenario_check.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> ModelNames(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".sdf") names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

class Checker : ScenarioCheck {
 public:
  Checker(const YamlNode& root, const ReadOptions& options, Scenario& scenario,
          std::vector<YamlProblem>& problems, std::size_t first_fault = 0)
      : ScenarioCheck(scenario, problems), root_(root), options_(options), first_fault_(first_fault) {}

  void Run() {
    scenario_.reference_place = PlaceInFile("reference");
    scenario_.initial_place = PlaceInFile("initial");
    scenario_.link_place = PlaceInFile("link");
    ReadProtocol();
    CheckPeriod();
    CheckAdapter();
    CheckGround();
    CheckModel();
    CheckProtocol();
    CheckFirmware();
    CheckGain();
    CheckClients();
    CheckBoardLines(root_, scenario_, problems_);
    CheckFirmwareParameters();
    CheckWatch();
    CheckReference();
    CheckFaults();
    CheckCriteria();
  }

 private:
  std::string PlaceInFile(std::string_view path) const {
    const YamlMark mark = PlaceOf(root_, path);
    return fmt::format("{}:{}:{}", scenario_.file.string(), mark.line, mark.column);
  }

  // The value of the key 'protocol', or of its other name.
  const YamlNode* ProtocolNode() const {
    const YamlNode* link = ValueOf(&root_, "link");
    const YamlNode* protocol = ValueOf(link, "protocol");
    return protocol == nullptr ? ValueOf(link, "dialect") : protocol;
  }

  void ReadProtocol() {
    if (const YamlNode* node = ProtocolNode(); node != nullptr && !Troubled(*node))
      if (auto protocol = UsersProtocol(*node, protocol_root_, protocol_, scenario_.protocol_file))
        scenario_.link.protocol = std::move(protocol);
  }

  // The flight's length and step against the protocol's control period.
  void CheckPeriod() {
    const TimeNs period_ns = scenario_.link.protocol->control_period_ns;
    if (const YamlNode* duration = Good(root_, "duration_s");
        duration != nullptr && scenario_.duration_ns < period_ns) {
      Complain(duration->mark, fmt::format("duration_s: {} is shorter than the control period of {} s",
                                           duration->text, ToSeconds(period_ns)));
    }
    // Rounding to nanoseconds must not turn a step that does not divide the period into one that does.
    const YamlNode* step = ValueOf(&root_, "step_s");
    if (step != nullptr && Troubled(*step)) return;
    const YamlMark place = step != nullptr ? step->mark : PlaceOf(root_, "link.protocol");
    const double seconds = step != nullptr ? step->Number().value_or(0.0) : ToSeconds(scenario_.step_ns);
    const std::string text = step != nullptr ? step->text : fmt::format("{}, the default,", seconds);
    const auto divides = [&](TimeNs whole_ns) {
      const std::int64_t count = scenario_.step_ns > 0 ? whole_ns / scenario_.step_ns : 0;
      return count > 0 && count * scenario_.step_ns == whole_ns &&
             std::abs(ToSeconds(scenario_.step_ns) - seconds) <= 1e-15;
    };
    if (!divides(period_ns))
      Complain(place, fmt::format("step_s: {} does not divide the control period of {} s", text,
                                  ToSeconds(period_ns)));
    for (const link::MessageType& type : scenario_.link.protocol->messages)
      if (type.period_ns != 0 && !divides(type.period_ns))
        Complain(place, fmt::format("step_s: {} does not divide the period of the message '{}', {} s", text,
                                    type.name, ToSeconds(type.period_ns)));
  }

  void CheckAdapter() {
    const YamlNode* link = Good(root_, "link");
    const YamlNode* latency = link == nullptr ? nullptr : Good(*link, "adapter_latency_ms");
    if (latency != nullptr && scenario_.link.adapter && scenario_.link.adapter_latency_ms > 0)
      Complain(latency->mark,
               "adapter_latency_ms: 'adapter' has a latency_ms of its own: give one of the two");
  }

  void CheckGround() {
    if (const YamlNode* solid = ValueOf(ValueOf(&root_, "ground"), "solid");
        solid != nullptr && solid->kind == YamlNode::Kind::kBool && !solid->boolean())
      Complain(solid->mark, "solid: false is `ground: end`: write that");
    if (!scenario_.initial_on_ground) return;
    if (!scenario_.solid_ground && !Troubled(PlaceOf(root_, "ground")))
      Complain(root_, "initial.on_ground",
               "on_ground: the ground ends the flight at any touch: add `ground: {solid: true}`");
    if (scenario_.initial_position_m[2] != 0)
      Complain(
          root_, "initial.position_m",
          fmt::format("position_m: with `on_ground` the height follows from the vehicle's shapes: write 0 in "
                      "place of z = {}, or remove `on_ground`",
                      scenario_.initial_position_m[2]));
  }

  void CheckModel() {
    const YamlNode* node = ValueOf(&root_, "model");
    if (node != nullptr && Troubled(*node)) return;
    const YamlMark mark = PlaceOf(root_, "model");
    const std::string& model = scenario_.model;
    std::error_code error;
    if (IsModelPath(model)) {
      scenario_.model_file = RelativeToScenario(model);
      if (!fs::is_regular_file(scenario_.model_file, error)) {
        Complain(mark, fmt::format("model: there is no file {}", scenario_.model_file.string()));
        return;
      }
    } else {
      const std::vector<std::string> names = ModelNames(options_.models_folder);
      if (std::find(names.begin(), names.end(), model) == names.end()) {
        Complain(mark, fmt::format("model: unknown model '{}'{}", model, DidYouMeanOf(model, names)));
        return;
      }
      scenario_.model_file = fs::absolute(options_.models_folder / (model + ".sdf")).lexically_normal();
    }
    if (!options_.check_model) return;
    if (const auto trouble = options_.check_model(scenario_.model_file, scenario_.allow_invalid_inertia)) {
      Complain(mark, fmt::format("model: {}", *trouble));
    }
  }

  // The messages carry the signals of the vehicle.
  void CheckProtocol() {
    if (!options_.vehicle_signals) return;
    const std::optional<VehicleSignals> vehicle = options_.vehicle_signals(scenario_);
    if (!vehicle) return;
    scenario_.link.protocol = link::ForVehicle(scenario_.link.protocol, *vehicle);
    for (LineEntry& line : scenario_.lines)
      if (line.protocol != nullptr) line.protocol = link::ForVehicle(line.protocol, *vehicle);
    for (const link::MessageType& type : scenario_.link.protocol->messages)
      if (type.payload_bytes > link::kPayloadBytesMax)
        return ComplainProtocol(fmt::format(
            "the message '{}' of this vehicle has {} bytes, and a payload holds {}: write a protocol file "
            "that carries fewer signals (docs/protocol.md)",
            type.name, type.payload_bytes, link::kPayloadBytesMax));
    if (!options_.check_protocol) return;
    const auto trouble = options_.check_protocol(scenario_, *vehicle);
    if (!trouble) return;
    const std::optional<YamlMark> place =
        protocol_root_ == nullptr ? std::nullopt
                                  : PlaceOfField(*protocol_root_, trouble->message, trouble->signal);
    if (!place) return ComplainProtocol(trouble->reason);
    if (scenario_.protocol_file.empty()) return Complain(*place, fmt::format("signal: {}", trouble->reason));
    ComplainProtocol(ToString(Diagnostic{scenario_.protocol_file, place->line, place->column,
                                         fmt::format("signal: {}", trouble->reason)}));
  }

  void ComplainProtocol(const std::string& trouble) {
    const YamlNode* protocol = ProtocolNode();
    Complain(protocol == nullptr ? PlaceOf(root_, "model") : protocol->mark,
             fmt::format("{}: {}", protocol == nullptr ? "model" : "protocol", trouble));
  }

  void CheckGain() {
    const YamlNode* gain = Good(root_, "gain");
    if (gain == nullptr || scenario_.gain.empty() || scenario_.gain == "design") return;
    scenario_.gain_file = RelativeToScenario(scenario_.gain);
    std::error_code error;
    if (!fs::is_regular_file(scenario_.gain_file, error))
      Complain(gain->mark, fmt::format("gain: there is no file {}; `tiltproof design-lqr MODEL --csv FILE` "
                                       "writes one, and `design` designs the gain for the flight",
                                       scenario_.gain_file.string()));
  }

  void CheckFirmware() {
    CheckBuild("firmware", scenario_.firmware, PlaceOf(root_, "firmware"));
    for (const auto& [build, verdict] : scenario_.expect.by_firmware)
      CheckBuild("expect", build, ValueOf(&root_, "expect")->Find(build)->key_mark);
  }

  void CheckBuild(std::string_view key, const std::string& build, YamlMark mark) {
    const auto& names = options_.firmware_names;
    if (names.empty() || std::find(names.begin(), names.end(), build) != names.end()) return;
    const std::vector<std::string_view> views(names.begin(), names.end());
    Complain(mark, fmt::format("{}: {}", key, UnknownBuild(build, views)));
  }

  void CheckClients() {
    const YamlNode* list = ValueOf(&root_, "clients");
    if (scenario_.clients.size() > kClientsMax)
      Complain(list->mark, fmt::format("clients: more than {}", kClientsMax));
    std::map<std::string_view, YamlMark> ids;
    for (std::size_t i = 0; i < scenario_.clients.size(); ++i) {
      const ClientEntry& client = scenario_.clients[i];
      const YamlNode& node = list->items[i];
      const auto [first, is_new] = ids.try_emplace(client.id, PlaceOf(node, "id"));
      if (!is_new && !client.id.empty())
        Complain(node, "id",
                 fmt::format("id: '{}' is taken already on line {}", client.id, first->second.line));
      if (!client.firmware.empty()) CheckBuild("firmware", client.firmware, PlaceOf(node, "firmware"));
    }
    CheckArbiter();
  }

  // The protocol of the frames on which the fault acts.
  const link::Protocol& ProtocolOf(const faults::FaultSpec& fault) const {
    return scenario_.protocol_of(fault);
  }

  void CheckArbiter() {
    ArbiterSpec& arbiter = scenario_.arbiter;
    scenario_.arbiter_place = PlaceInFile("arbiter.type");
    CheckClientNamed(root_, "arbiter.client", arbiter.client);
    if (arbiter.type == ArbiterType::kSingle) return;
    const std::string type(Name(arbiter.type));
    if (!scenario_.has_several_clients())
      Complain(root_, "arbiter.type",
               fmt::format("type: {} needs several `clients`, and there is one", type));
    else if (arbiter.type == ArbiterType::kDuplexCompare && scenario_.client_count() != 2)
      Complain(root_, "arbiter.type",
               fmt::format("type: {} compares two clients, and there are {}; mid_value takes any number",
                           type, scenario_.client_count()));
    if (arbiter.on_disagreement != kHoldInput && arbiter.on_disagreement != kHoverInput)
      CheckClientNamed(root_, "arbiter.on_disagreement", arbiter.on_disagreement);
    if (const YamlNode* order = ValueOf(ValueOf(&root_, "arbiter"), "order"); order != nullptr)
      CheckOrder(*order);
    if (!arbiter.timeout_ms) arbiter.timeout_ms = static_cast<double>(scenario_.arbiter_timeout_ns()) / 1e6;
    if (arbiter.type == ArbiterType::kPrimaryBackup && arbiter.order.empty())
      for (const ClientEntry& client : scenario_.clients) arbiter.order.push_back(client.id);
  }

  void CheckOrder(const YamlNode& order) {
    if (order.kind == YamlNode::Kind::kSequence && order.items.empty())
      Complain(order.mark, "order: the list is empty; leave the key out for the order of `clients`");
    for (std::size_t i = 0; i < order.items.size(); ++i) {
      const YamlNode& item = order.items[i];
      if (Troubled(item)) continue;
      CheckClient("order", item.mark, item.text);
      for (std::size_t j = 0; j < i; ++j)
        if (order.items[j].text == item.text) {
          Complain(item.mark, fmt::format("order: '{}' is there already", item.text));
          break;
        }
    }
  }

  // An id that names one of the clients; empty: none.
  void CheckClientNamed(const YamlNode& mapping, std::string_view path, const std::string& id) {
    if (!id.empty()) CheckClient(path.substr(path.rfind('.') + 1), PlaceOf(mapping, path), id);
  }
  void CheckReference() {
    const YamlNode* node = ValueOf(&root_, "reference");
    if (node == nullptr || node->kind != YamlNode::Kind::kMapping) return;
    for (const char* key : {"type", "file", "points_m", "speed_m_s"}) {
      if (const YamlNode* value = ValueOf(node, key); value != nullptr && Troubled(*value)) return;
    }
    if (auto* recorded = std::get_if<RecordedReference>(&scenario_.reference.path)) {
      if (recorded->file.empty()) return;  // missing, and said so
      recorded->file = RelativeToScenario(recorded->file);
    }
    if (const auto* waypoints = std::get_if<WaypointsReference>(&scenario_.reference.path)) {
      if (waypoints->points_m.empty()) return;
    }
    try {
      const Trajectory trajectory(scenario_.reference);
      const double duration_s = ToSeconds(scenario_.duration_ns), first_s = trajectory.FirstSample_s();
      if (first_s >= duration_s && duration_s > 0) {
        Complain(
            *node, "file",
            fmt::format("file: {}: begins at t_s = {}, when the flight of {} s is over; subtract {} from t_s",
                        std::get<RecordedReference>(scenario_.reference.path).file.string(), first_s,
                        duration_s, first_s));
      }
      const YamlNode* initial = ValueOf(&root_, "initial");
      if (ValueOf(initial, "position_m") == nullptr) scenario_.initial_position_m = trajectory.Start();
      if (scenario_.initial_on_ground) scenario_.initial_position_m[2] = 0;
    } catch (const ReferenceError& error) {
      Complain(*node, "file", fmt::format("file: {}", error.what()));
    }
  }

  void CheckFirmwareParameters() {
    const YamlNode* list = ValueOf(&root_, "firmware_parameters");
    std::map<std::string_view, YamlMark> names;
    for (std::size_t i = 0; i < scenario_.firmware_parameters.size(); ++i) {
      const std::string& name = scenario_.firmware_parameters[i].name;
      const auto [first, is_new] = names.try_emplace(name, PlaceOf(list->items[i], "name"));
      if (!is_new && !name.empty())
        Complain(list->items[i], "name",
                 fmt::format("name: '{}' is taken already on line {}", name, first->second.line));
    }
  }

  void CheckWatch() {
    const YamlNode* list = ValueOf(&root_, "watch");
    scenario_.watch_places.clear();
    std::map<std::string, std::string> columns;
    for (std::size_t i = 0; list != nullptr && i < std::min(scenario_.watch.size(), list->items.size());
         ++i) {
      const YamlMark place = list->items[i].mark;
      scenario_.watch_places.push_back(
          fmt::format("{}:{}:{}", scenario_.file.string(), place.line, place.column));
      const std::string& variable = scenario_.watch[i];
      const auto [first, is_new] = columns.try_emplace(WatchColumn(variable), variable);
      if (!is_new)
        Complain(place, fmt::format("watch: the column {} of '{}' is that of '{}' already", first->first,
                                    variable, first->second));
    }
  }

 public:
  // Those from `first_fault_` on, which the root has.
  void CheckFaults() {
    const YamlNode* list = ValueOf(&root_, "faults");
    std::map<std::string_view, YamlMark> ids;
    scenario_.fault_places.resize(first_fault_);
    for (std::size_t i = 0; i < first_fault_; ++i)
      if (scenario_.faults[i].id == scenario_.faults.back().id)
        ids.try_emplace(scenario_.faults[i].id, YamlMark{0, 0});
    for (std::size_t i = first_fault_; i < scenario_.faults.size(); ++i) CheckFault(i, NodeOf(i, *list), ids);
    if (list == nullptr) return;
    CheckVolume(*list);
    for (std::size_t i = first_fault_; i < scenario_.faults.size(); ++i) CheckWaiting(i, NodeOf(i, *list));
    CheckSignals(*list);
    CheckFields(*list);
    CheckFaultsSuit(*list);
  }

 private:
  const YamlNode& NodeOf(std::size_t fault, const YamlNode& list) const {
    return list.items.at(fault - first_fault_);
  }

  // `ids`: of the faults before it, with their lines.
  void CheckFault(std::size_t i, const YamlNode& node, std::map<std::string_view, YamlMark>& ids) {
    const faults::FaultSpec& fault = scenario_.faults[i];
    const YamlMark place = PlaceOf(node, "type");
    scenario_.fault_places.push_back(
        fmt::format("{}:{}:{}", scenario_.file.string(), place.line, place.column));
    if (!fault.id.empty()) {
      const auto [first, is_new] = ids.try_emplace(fault.id, PlaceOf(node, "id"));
      if (!is_new)
        Complain(node, "id",
                 fmt::format("id: '{}' is taken already{}", fault.id,
                             first->second.line == 0 ? "" : fmt::format(" on line {}", first->second.line)));
    }
    if (scenario_.duration_ns > 0 && fault.start_ns != kPowerOn && fault.start_ns >= scenario_.duration_ns) {
      Complain(node, "start_s", "start_s: the flight is over by then (duration_s)");
    }
    if (const auto* other = DriftsWith(i))
      Complain(place,
               fmt::format("type: drifts at the same time as fault '{}': let their windows not overlap",
                           other->id));
    CheckClientNamed(node, "client", fault.client);
    if (fault.type.empty()) return;  // unknown, and said so
    FindBoardLine(scenario_.faults[i], node, scenario_, problems_);
    CheckMessage(scenario_.faults[i], node);
    for (const faults::Problem& problem : faults::Validate(fault)) {
      // The reader has reported missing and unreadable values already.
      // Unknown lines were reported above.
      if (problem.key == "target" && !fault.line.empty()) continue;
      const bool is_bound = problem.key == "start_s" || problem.key == "end_s";
      if (problem.key == "parameters" || (is_bound && Good(node, problem.key) == nullptr)) continue;
      Complain(node, problem.key, fmt::format("{}: {}", problem.key, problem.message));
    }
  }

  // Gives the message its name in the protocol.
  void CheckMessage(faults::FaultSpec& fault, const YamlNode& node) {
    const faults::FaultType& type = *faults::FindFaultType(fault.type);
    const std::string problem = faults::MessageProblem(fault, type, ProtocolOf(fault));
    if (!problem.empty()) Complain(node, "message", fmt::format("message: {}", problem));
    if (const auto* message = faults::FindMessage(ProtocolOf(fault), fault.message))
      fault.message = message->name;
  }

  // A fault on a part of a frame, or on a value, is for a protocol that has these.
  void CheckFaultsSuit(const YamlNode& list) {
    for (std::size_t i = first_fault_; i < scenario_.faults.size(); ++i) {
      if (!faults::Validate(scenario_.faults[i]).empty()) continue;  // reported already
      if (const auto problem = faults::ProtocolProblem(scenario_.faults[i], ProtocolOf(scenario_.faults[i])))
        Complain(NodeOf(i, list), problem->key, fmt::format("{}: {}", problem->key, problem->message));
    }
  }

  // The fields that faults on frames name are those of messages that pass there.
  void CheckFields(const YamlNode& list) {
    for (std::size_t i = first_fault_; i < scenario_.faults.size(); ++i) {
      const faults::FaultSpec& fault = scenario_.faults[i];
      const faults::FaultType* type = faults::FindFaultType(fault.type);
      const YamlNode* parameters = ValueOf(&NodeOf(i, list), "parameters");
      if (type == nullptr || parameters == nullptr) continue;
      for (const faults::ParameterInfo& info : type->parameters) {
        const YamlNode* name =
            info.kind == faults::ParameterKind::kField ? Good(*parameters, info.name) : nullptr;
        if (name == nullptr) continue;
        const std::vector<std::string> valid =
            faults::FieldNames(ProtocolOf(fault), faults::ResolvedTarget(fault, *type), fault.message);
        if (std::find(valid.begin(), valid.end(), name->text) == valid.end())
          Complain(name->mark, fmt::format("{}: unknown value '{}'{}", info.name, name->text,
                                           DidYouMeanOf(name->text, valid)));
      }
    }
  }

  // The signals and parts that faults name are the vehicle's, and suit the faults.
  void CheckSignals(const YamlNode& list) {
    if (!options_.vehicle_signals) return;
    const std::optional<VehicleSignals> vehicle = options_.vehicle_signals(scenario_);
    if (!vehicle) return;  // its model has its own message
    for (std::size_t i = first_fault_; i < scenario_.faults.size(); ++i) {
      const faults::FaultType* type = faults::FindFaultType(scenario_.faults[i].type);
      const YamlNode* parameters = ValueOf(&NodeOf(i, list), "parameters");
      if (type == nullptr || parameters == nullptr) continue;
      if (const auto reason = faults::Unsuited(scenario_.faults[i], *type, *vehicle))
        Complain(NodeOf(i, list), "type", fmt::format("type: {} {}", type->name, *reason));
      for (const faults::ParameterInfo& info : type->parameters) {
        const bool names = NamesSignal(info.kind) || NamesPart(info.kind);
        const YamlNode* name = names ? Good(*parameters, info.name) : nullptr;
        if (name == nullptr) continue;
        const std::vector<std::string> valid = faults::SignalNames(*vehicle, info.kind);
        if (std::find(valid.begin(), valid.end(), name->text) == valid.end())
          Complain(name->mark, fmt::format("{}: unknown value '{}'{}", info.name, name->text,
                                           DidYouMeanOf(name->text, valid)));
      }
    }
  }

  // Checks what a fault waits for.
  void CheckWaiting(std::size_t i, const YamlNode& node) {
    const faults::FaultSpec& fault = scenario_.faults[i];
    if (const YamlNode* condition = Good(node, "when"); condition != nullptr && options_.check_condition)
      ComplainFormula("when", *condition, options_.check_condition(condition->text, scenario_));
    if (!fault.after || fault.after->fault.empty() || fault.after->fault == fault.id) return;
    const faults::FaultSpec* followed = FaultNamed(fault.after->fault);
    if (followed == nullptr) {
      std::vector<std::string> ids;
      for (const auto& other : scenario_.faults)
        if (other.id != fault.id) ids.push_back(other.id);
      Complain(node, "after.fault",
               fmt::format("after: there is no fault '{}'{}", fault.after->fault,
                           DidYouMeanOf(fault.after->fault, ids)));
      return;
    }
    // Each waits for one other at most, so a circle comes back to where it began.
    std::string chain = fmt::format("'{}'", fault.id);
    for (std::size_t step = 0; followed != nullptr && step < scenario_.faults.size(); ++step) {
      chain += fmt::format(" waits for '{}'", followed->id);
      if (followed == &fault) {
        Complain(node, "after.fault", fmt::format("after: {}: none of them would ever begin", chain));
        return;
      }
      followed = followed->after ? FaultNamed(followed->after->fault) : nullptr;
      if (followed != nullptr) chain += ", which";
    }
  }

  const faults::FaultSpec* FaultNamed(std::string_view id) const {
    for (const auto& fault : scenario_.faults)
      if (fault.id == id) return &fault;
    return nullptr;
  }

  void CheckVolume(const YamlNode& list) {
    const auto& faults = scenario_.faults;
    const std::span added = std::span(faults).subspan(first_fault_);
    const auto is_valid = [](const faults::FaultSpec& fault) { return faults::Validate(fault).empty(); };
    if (!std::ranges::all_of(added, is_valid) || std::ranges::none_of(added, faults::DoublesBytes)) return;
    const auto too_much = faults::CertainOverfull(faults, scenario_.duration_ns, *scenario_.link.protocol);
    if (!too_much) return;
    std::vector<std::string> ids;
    for (const std::size_t fault : too_much->faults) ids.push_back(fmt::format("'{}'", faults[fault].id));
    Complain(
        NodeOf(std::max(too_much->faults.back(), first_fault_), list), "id",
        fmt::format("id: together {} make more than {} MiB of each frame {}, which is all that a line holds",
                    fmt::join(ids, ", "), link::kLineBytesMax >> 20, link::Name(too_much->direction)));
  }

  // A node has one clock: two drifts at once would add up to more than a drift may be.
  const faults::FaultSpec* DriftsWith(std::size_t i) const {
    constexpr std::string_view kDrift = "clock.drift";
    const auto& all = scenario_.faults;
    for (std::size_t other = 0; other < i; ++other)
      if (all[i].type == kDrift && all[other].type == kDrift && OnOneNode(all[i], all[other]) &&
          all[other].start_ns < all[i].end_ns && all[i].start_ns < all[other].end_ns)
        return &all[other];
    return nullptr;
  }

  static bool OnOneNode(const faults::FaultSpec& a, const faults::FaultSpec& b) {
    const auto node = [](const faults::FaultSpec& fault) {
      const auto found = fault.parameters.find("node");
      return found == fault.parameters.end() ? faults::ParameterValue("client") : found->second;
    };
    if (node(a) != node(b)) return false;
    return a.client.empty() || b.client.empty() || a.client == b.client;
  }

  void CheckCriteria() {
    const YamlNode* list = ValueOf(&root_, "criteria");
    std::map<std::string_view, YamlMark> names;
    scenario_.criterion_places.clear();
    for (std::size_t i = 0; i < scenario_.criteria.size(); ++i) {
      const CriterionSpec& criterion = scenario_.criteria[i];
      const YamlNode& node = list->items[i];
      const YamlMark place = PlaceOf(node, criterion.stl.empty() ? "metric" : "stl");
      scenario_.criterion_places.push_back(
          fmt::format("{}:{}:{}", scenario_.file.string(), place.line, place.column));
      if (node.kind != YamlNode::Kind::kMapping) continue;
      if (!criterion.name.empty()) {
        const auto [first, is_new] = names.try_emplace(criterion.name, PlaceOf(node, "name"));
        if (!is_new) {
          Complain(node, "name",
                   fmt::format("name: '{}' is taken already on line {}", criterion.name, first->second.line));
        }
      }
      if (criterion.min && criterion.max && *criterion.min > *criterion.max)
        Complain(node, "max", fmt::format("max: {} is less than min, {}", *criterion.max, *criterion.min));
      if (const YamlNode* formula = Good(node, "stl")) CheckFormula(*formula);
      if (const YamlNode* metric = Good(node, "metric")) CheckMetric(*metric);
    }
  }

  void CheckFormula(const YamlNode& node) {
    if (!options_.check_formula) return;
    ComplainFormula("stl", node, options_.check_formula(node.text, scenario_));
  }

  void ComplainFormula(std::string_view key, const YamlNode& formula,
                       const std::optional<FormulaProblem>& problem) {
    if (!problem) return;
    YamlMark mark = formula.text_begin.value_or(formula.mark);
    if (formula.text_begin) {
      const std::string_view before = std::string_view(formula.text).substr(0, problem->column - 1);
      mark.column += static_cast<int>(CharacterCount(before));
      Complain(mark, fmt::format("{}: {}", key, problem->message));
    } else {
      Complain(mark, fmt::format("{}: column {} of the formula: {}", key, problem->column, problem->message));
    }
  }

  void CheckMetric(const YamlNode& node) {
    const std::vector<std::string> names = MetricNamesOf(scenario_, options_.metric_names);
    if (names.empty() || std::find(names.begin(), names.end(), node.text) != names.end()) return;
    Complain(node.mark,
             fmt::format("metric: unknown metric '{}'{}", node.text, DidYouMeanOf(node.text, names)));
  }

  const YamlNode& root_;
  const ReadOptions& options_;
  const std::size_t first_fault_;  // in the root
  ProtocolFile protocol_;
  const YamlNode* protocol_root_ = nullptr;  // of the user's protocol
};

}  // namespace

void CheckScenario(const YamlNode& root, const ReadOptions& options, Scenario& scenario,
                   std::vector<YamlProblem>& problems) {
  Checker(root, options, scenario, problems).Run();
}

void CheckLastFault(const YamlNode& fault, const ReadOptions& options, Scenario& scenario,
                    std::vector<YamlProblem>& problems) {
  YamlNode list, root;
  list.kind = YamlNode::Kind::kSequence;
  list.items = {fault};
  root.kind = YamlNode::Kind::kMapping;
  root.entries = {{"faults", {}, std::move(list)}};
  Checker(root, options, scenario, problems, scenario.faults.size() - 1).CheckFaults();
}

}  // namespace tiltproof::harness
