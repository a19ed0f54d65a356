#include "harness/scenario/compound.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "faults/registry.h"
#include "harness/scenario/fault_keys.h"
#include "harness/scenario/mapping_reader.h"

namespace tiltproof::harness {
namespace {

constexpr std::string_view kCompound = "compound";

// True if a fault with this `type` can have that end of a window; other code reports an unknown type.
bool MayState(const YamlNode& fault, std::string_view key) {
  const YamlEntry* type_entry = fault.Find("type");
  const faults::FaultType* type =
      type_entry == nullptr ? nullptr : faults::FindFaultType(type_entry->value.text);
  return type == nullptr || (key == "start_s" ? type->start : type->end) != faults::Bound::kRefused;
}

class Resolver {
 public:
  explicit Resolver(std::vector<YamlProblem>& problems) : problems_(problems) {}

  void Run(YamlNode& list) {
    std::vector<YamlNode> faults;
    for (YamlNode& item : list.items) {
      const YamlEntry* members = item.Find(kCompound);
      if (members == nullptr) {
        faults.push_back(std::move(item));
      } else {
        Resolve(item, *members, faults);
      }
    }
    for (const YamlNode& fault : faults) CheckId(fault);
    list.items = std::move(faults);
  }

 private:
  void Complain(YamlMark mark, std::string message) { problems_.push_back({mark, std::move(message)}); }

  void Resolve(const YamlNode& item, const YamlEntry& members, std::vector<YamlNode>& faults) {
    YamlNode head = item;
    std::erase_if(head.entries, [](const YamlEntry& entry) { return entry.key == kCompound; });
    MappingReader reader(head, problems_);
    Compound compound;
    DescribeCompound(reader, compound);
    reader.Finish();
    if (const YamlEntry* id = head.Find("id"); id != nullptr && !compound.id.empty()) {
      CheckId(head);
      ids_.emplace(compound.id, id->value.mark);
    }
    if (members.value.kind != YamlNode::Kind::kSequence || members.value.items.empty()) {
      Complain(members.value.mark,
               fmt::format("compound: expected a list of faults, found {}",
                           members.value.items.empty() && members.value.kind == YamlNode::Kind::kSequence
                               ? "an empty one"
                               : Describe(members.value)));
      return;
    }
    for (const YamlNode& member : members.value.items) {
      if (const YamlEntry* inner = member.Find(kCompound)) {
        Complain(inner->key_mark, "compound: a compound has no compound inside; list its faults instead");
        continue;
      }
      faults.push_back(WithDefaults(member, head));
    }
  }

  static YamlNode WithDefaults(YamlNode member, const YamlNode& head) {
    if (member.kind != YamlNode::Kind::kMapping) return member;
    for (const std::string_view key : {"start_s", "end_s"}) {
      const YamlEntry* fallback = head.Find(key);
      if (fallback != nullptr && member.Find(key) == nullptr && MayState(member, key))
        member.entries.push_back(*fallback);
    }
    return member;
  }

  void CheckId(const YamlNode& fault) {
    const YamlEntry* id = fault.Find("id");
    if (id == nullptr) return;
    if (const auto taken = ids_.find(id->value.text); taken != ids_.end())
      Complain(id->value.mark,
               fmt::format("id: '{}' is taken already on line {}", id->value.text, taken->second.line));
  }

  std::vector<YamlProblem>& problems_;
  std::map<std::string, YamlMark, std::less<>> ids_;  // of compounds
};

}  // namespace

void ResolveCompounds(YamlNode& root, std::vector<YamlProblem>& problems) {
  const auto faults = std::find_if(root.entries.begin(), root.entries.end(),
                                   [](const YamlEntry& entry) { return entry.key == "faults"; });
  if (faults != root.entries.end()) Resolver(problems).Run(faults->value);
}

}  // namespace tiltproof::harness
