#include "harness/scenario/set_keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "harness/scenario/did_you_mean.h"

namespace tiltproof::harness {
namespace {

// No line of a file is below 1.
YamlMark MarkOf(std::size_t setting) { return {-1 - static_cast<int>(setting), 1}; }

void SetMarks(YamlNode& node, YamlMark mark) {
  node.mark = mark;
  node.text_begin.reset();
  for (YamlNode& item : node.items) SetMarks(item, mark);
  for (YamlEntry& entry : node.entries) {
    entry.key_mark = mark;
    SetMarks(entry.value, mark);
  }
}

std::string_view NameOf(const YamlNode& item) {
  for (const char* key : {"id", "name"})
    if (const YamlEntry* entry = item.Find(key)) return entry->value.text;
  return {};
}

// One setting on its way down the tree.
class Setter {
 public:
  Setter(const KeySetting& setting, YamlMark mark, std::vector<YamlProblem>& problems)
      : setting_(setting), rest_(setting.path), mark_(mark), problems_(problems) {}

  void Set(YamlNode& root, const YamlNode& resolved) {
    YamlNode* node = &root;
    const YamlNode* all = &resolved;
    while (!rest_.empty() && node != nullptr) {
      const bool has_part = rest_.front() != '.' && rest_.back() != '.';
      node = !has_part                                 ? Complain("a part of the path is empty")
             : node->kind == YamlNode::Kind::kSequence ? Item(*node, all)
             : node->kind == YamlNode::Kind::kMapping
                 ? Key(*node, all)
                 : Complain(fmt::format("'{}' is one value: it has no keys", done_));
    }
    if (node == nullptr) return;
    std::vector<YamlProblem> found;
    std::optional<YamlNode> list = ParseYaml("[" + setting_.value + "]", found);
    if (!found.empty() || !list || list->items.size() != 1) {
      Complain(fmt::format("'{}' is no value{}", setting_.value,
                           found.empty() ? std::string() : ": " + found.front().message));
      return;
    }
    *node = std::move(list->items.front());
    SetMarks(*node, mark_);
  }

 private:
  YamlNode* Complain(std::string message) {
    problems_.push_back({mark_, std::move(message)});
    return nullptr;
  }

  void Advance(std::size_t length) {
    if (!done_.empty()) done_ += '.';
    done_ += rest_.substr(0, length);
    rest_.remove_prefix(std::min(length + 1, rest_.size()));
  }

  // The ids of faults may have dots: the longest one counts.
  YamlNode* Item(YamlNode& list, const YamlNode*& all) {
    std::vector<std::string_view> names;
    std::optional<std::size_t> found;
    for (std::size_t i = 0; i < list.items.size(); ++i) {
      const std::string_view name = NameOf(list.items[i]);
      if (name.empty()) continue;
      names.push_back(name);
      const bool is_next = rest_ == name || (rest_.starts_with(name) && rest_[name.size()] == '.');
      if (is_next && (!found || name.size() > NameOf(list.items[*found]).size())) found = i;
    }
    std::size_t length = found ? NameOf(list.items[*found]).size() : std::min(rest_.find('.'), rest_.size());
    const std::string_view part = rest_.substr(0, length);
    if (!found) {
      std::size_t number = 0;
      const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), number);
      if (error == std::errc() && end == part.data() + part.size() && number < list.items.size())
        found = number;
    }
    if (!found)
      return Complain(names.empty() ? fmt::format("{} has no item '{}': it is a list of {}, from 0", done_,
                                                  part, list.items.size())
                                    : fmt::format("{} has no '{}'{}", done_, part, DidYouMean(part, names)));
    all = all != nullptr && *found < all->items.size() ? &all->items[*found] : nullptr;
    Advance(length);
    return &list.items[*found];
  }

  YamlNode* Key(YamlNode& mapping, const YamlNode*& all) {
    const std::size_t length = std::min(rest_.find('.'), rest_.size());
    const std::string key(rest_.substr(0, length));
    all = ValueOf(all, key);
    Advance(length);
    const auto entry = std::ranges::find(mapping.entries, key, &YamlEntry::key);
    if (entry != mapping.entries.end()) return &entry->value;
    YamlNode value;
    value.kind = YamlNode::Kind::kMapping;  // unless it is the last part, and replaced
    if (!rest_.empty() && all != nullptr && all->kind == YamlNode::Kind::kSequence) value = *all;
    SetMarks(value, mark_);
    return &mapping.entries.emplace_back(YamlEntry{key, mark_, std::move(value)}).value;
  }

  const KeySetting& setting_;
  std::string_view rest_;
  std::string done_;
  YamlMark mark_;
  std::vector<YamlProblem>& problems_;
};

}  // namespace

std::vector<std::string> SplitValues(std::string_view text) {
  std::vector<std::string> values(1);
  int depth = 0;
  char quote = 0;
  for (const char c : text) {
    if (quote != 0)
      quote = c == quote ? '\0' : quote;
    else if (c == '"' || c == '\'')
      quote = c;
    else if (c == '[' || c == '{')
      ++depth;
    else if (c == ']' || c == '}')
      --depth;
    if (c == ',' && depth == 0 && quote == 0)
      values.emplace_back();
    else
      values.back() += c;
  }
  for (std::string& value : values) {
    const std::size_t begin = std::min(value.find_first_not_of(' '), value.size());
    value = value.substr(begin, value.find_last_not_of(' ') + 1 - begin);
  }
  return values;
}

void SetKeys(std::span<const KeySetting> settings, const YamlNode& resolved, YamlNode& root,
             std::vector<YamlProblem>& problems) {
  for (std::size_t i = 0; i < settings.size(); ++i)
    Setter(settings[i], MarkOf(i), problems).Set(root, resolved);
}

std::optional<std::size_t> SettingOfLine(int line) {
  return line < 0 ? std::optional(static_cast<std::size_t>(-1 - line)) : std::nullopt;
}

}  // namespace tiltproof::harness
