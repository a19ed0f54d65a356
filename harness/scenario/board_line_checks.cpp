#include "harness/scenario/board_line_checks.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "faults/registry.h"
#include "harness/scenario/scenario_check.h"

namespace tiltproof::harness {
namespace {

class BoardLineCheck : ScenarioCheck {
 public:
  BoardLineCheck(Scenario& scenario, std::vector<YamlProblem>& problems)
      : ScenarioCheck(scenario, problems) {}

  void CheckAll(const YamlNode& root) {
    const YamlNode* list = ValueOf(&root, "lines");
    scenario_.line_places.clear();
    if (scenario_.lines.empty() || list == nullptr) return;
    for (const YamlNode& line : list->items) {
      const YamlMark place = PlaceOf(line, "id");
      scenario_.line_places.push_back(
          fmt::format("{}:{}:{}", scenario_.file.string(), place.line, place.column));
    }
    if (scenario_.lines.size() > kLinesMax)
      Complain(list->mark, fmt::format("lines: more than {}", kLinesMax));
    if (!scenario_.has_several_clients())
      return Complain(list->mark, "lines: a line is between two of several `clients`, and there is one");
    // Targets of faults, each with the line that it means.
    std::map<std::string, std::string> targets;
    for (const faults::Target target : {faults::Target::kToClient, faults::Target::kToPlant,
                                        faults::Target::kBoth, faults::Target::kReference})
      targets.emplace(Name(target), "every client's own lines");
    // Words of --client.
    for (const char* taken : {"main", "console", "hse", "reset"}) targets.emplace(taken, "a part of a board");
    for (std::size_t i = 0; i < scenario_.lines.size(); ++i)
      CheckLine(scenario_.lines[i], list->items[i], targets);
  }

  void FindLineOf(faults::FaultSpec& fault, const YamlNode& node) {
    if (fault.line.empty()) return;
    const std::string text = TargetText(fault);
    std::vector<std::string> valid;
    const faults::FaultType* type = faults::FindFaultType(fault.type);
    if (type == nullptr) return;
    for (const faults::Target target : faults::AcceptedTargets(*type))
      if (target != faults::Target::kNone) valid.emplace_back(Name(target));
    for (const LineEntry& line : scenario_.lines) {
      faults::FaultSpec found = fault;
      const auto is_it = [&](std::optional<std::size_t> end) {
        PutOnLine(line, end, found);
        valid.push_back(TargetText(found));
        return valid.back() == text;
      };
      bool is_found = is_it({});
      for (std::size_t end = 0; end < line.between.size() && !is_found; ++end) is_found = is_it(end);
      if (!is_found) continue;
      fault = found;
      if (const auto problem = faults::LineProblem(*type, line.protocol != nullptr))
        Complain(node, "type", fmt::format("type: {}", *problem));
      if (!fault.client.empty())
        Complain(
            node, "client",
            fmt::format(
                "client: the fault acts on the line '{}' between two clients; `target: {}_to_{}` is one way",
                line.id, line.id, fault.client));
      return;
    }
    Complain(node, "target", fmt::format("target: unknown value '{}'{}", text, DidYouMeanOf(text, valid)));
  }

 private:
  void CheckLine(LineEntry& line, const YamlNode& node, std::map<std::string, std::string>& targets) {
    if (const YamlNode* between = Good(node, "between");
        between != nullptr && between->kind == YamlNode::Kind::kSequence) {
      const std::vector<YamlNode>& ends = between->items;
      if (ends.size() != 2)
        Complain(between->mark, fmt::format("between: a line has two ends, and there are {}", ends.size()));
      else if (ends[0].text == ends[1].text)
        Complain(between->mark,
                 fmt::format("between: both ends are '{}': a line is between two clients", ends[0].text));
      for (const YamlNode& item : between->items)
        if (!Troubled(item)) CheckClient("between", item.mark, item.text);
    }
    if (const YamlNode* protocol = Good(node, "protocol");
        protocol != nullptr &&
        (protocol->kind == YamlNode::Kind::kMapping || protocol->text != kBytesAsTheyAre)) {
      const YamlNode* root = nullptr;
      ProtocolFile loaded;
      std::filesystem::path file;
      if (auto users = UsersProtocol(*protocol, root, loaded, file)) line.protocol = std::move(users);
    }
    if (line.id.empty()) return;
    std::vector<std::string> own = {line.id};
    for (const std::string& client : line.between) own.push_back(line.id + "_to_" + client);
    if (scenario_.FindClient(line.id))
      return Complain(node, "id", fmt::format("id: '{}' is a client", line.id));
    for (const std::string& target : own) {
      const auto [other, is_new] = targets.try_emplace(target, fmt::format("the line '{}'", line.id));
      if (is_new || other->second == fmt::format("the line '{}'", line.id)) {
        if (target != line.id || is_new) continue;
        return Complain(node, "id", fmt::format("id: '{}' is taken already", line.id));
      }
      return Complain(node, "id",
                      fmt::format("id: the target '{}' of faults already means {}: take another id", target,
                                  other->second));
    }
  }
};

}  // namespace

void CheckBoardLines(const YamlNode& root, Scenario& scenario, std::vector<YamlProblem>& problems) {
  BoardLineCheck(scenario, problems).CheckAll(root);
}

void FindBoardLine(faults::FaultSpec& fault, const YamlNode& node, Scenario& scenario,
                   std::vector<YamlProblem>& problems) {
  BoardLineCheck(scenario, problems).FindLineOf(fault, node);
}

}  // namespace tiltproof::harness
