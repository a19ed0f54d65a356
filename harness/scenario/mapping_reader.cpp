#include "harness/scenario/mapping_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <system_error>
#include <utility>

#include "harness/scenario/did_you_mean.h"
#include "link/posix_regex.h"

namespace tiltproof::harness {
namespace {

std::string OutOfRange(std::string_view key, const YamlNode& node, Range range) {
  return fmt::format("{}: {} is out of range; must be from {} to {}", key, node.text, range.min, range.max);
}

bool Within(double value, Range range) { return value >= range.min && value <= range.max; }

bool HasControlCharacter(std::string_view text) {
  return std::any_of(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7F;
  });
}

// True when the whole text matches. Compiling an expression takes longer than matching a name.
bool Matches(std::string_view text, std::string_view regex) {
  thread_local std::map<std::string, PosixRegex, std::less<>> known;
  auto found = known.find(regex);
  if (found == known.end()) found = known.try_emplace(std::string(regex), fmt::format("^({})$", regex)).first;
  return found->second.Find(text).has_value();
}

}  // namespace

void MappingReader::Finish() {
  for (const YamlEntry& entry : mapping_.entries) {
    if (keys_unknowable_ || std::find(known_.begin(), known_.end(), entry.key) != known_.end()) continue;
    const std::string_view closest = ClosestName(entry.key, known_), section = SectionOf(entry.key);
    if (closest.empty() && !section.empty())
      Complain(entry.key_mark,
               fmt::format("'{0}' belongs into '{1}': {1}: {{{0}: ...}}", entry.key, section));
    else
      Complain(entry.key_mark, fmt::format("unknown key '{}'{}", entry.key, DidYouMean(entry.key, known_)));
    // A key that was mistyped, or stands elsewhere, is not missing as well.
    std::erase(missing_, closest.empty() ? section : closest);
  }
  for (const std::string_view key : missing_) Complain(mapping_.mark, fmt::format("missing key '{}'", key));
}

std::string_view MappingReader::SectionOf(std::string_view name) const {
  for (const auto& [section, keys] : sections_)
    if (std::find(keys.begin(), keys.end(), name) != keys.end()) return section;
  return {};
}

const YamlNode* MappingReader::Take(const Key& key) {
  known_.push_back(key.name);
  const YamlEntry* entry = mapping_.Find(key.name);
  if (!key.other_name.empty()) {
    known_.push_back(key.other_name);
    const YamlEntry* other = mapping_.Find(key.other_name);
    if (entry != nullptr && other != nullptr)
      Complain(other->key_mark,
               fmt::format("'{}' and '{}' are two names of one key: give one", key.name, key.other_name));
    if (entry == nullptr) entry = other;
  }
  if (entry == nullptr) {
    if (key.presence == Presence::kRequired) missing_.push_back(key.name);
    return nullptr;
  }
  if (entry->value.kind == YamlNode::Kind::kNull) {
    Complain(entry->key_mark, fmt::format("{}: the value is missing", key.name));
    return nullptr;
  }
  return &entry->value;
}

void MappingReader::ComplainKind(std::string_view key, const YamlNode& node, std::string_view expected) {
  if (node.kind == YamlNode::Kind::kAmbiguous) {
    Complain(node.mark, fmt::format("{}: {}: {}", key, Describe(node), node.complaint));
  } else {
    Complain(node.mark, fmt::format("{}: expected {}, found {}", key, expected, Describe(node)));
  }
}

constexpr Range kAnyNumber = {std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()};

std::optional<double> MappingReader::ReadNumber(std::string_view key, const YamlNode& node, Range range) {
  if (node.kind != YamlNode::Kind::kNumber) {
    ComplainKind(key, node, "a number");
    return std::nullopt;
  }
  const std::optional<double> value = node.Number();
  if (!value || !Within(*value, range)) {
    Complain(node.mark, OutOfRange(key, node, range));
    return std::nullopt;
  }
  return value;
}

std::optional<std::string> MappingReader::ReadText(std::string_view key, const YamlNode& node,
                                                   const TextRule& rule) {
  switch (node.kind) {
    case YamlNode::Kind::kText:
      break;
    case YamlNode::Kind::kBool:
    case YamlNode::Kind::kNumber:
      Complain(node.mark, fmt::format("{}: expected text, found {}; put quotes around it if text is meant",
                                      key, Describe(node)));
      return std::nullopt;
    case YamlNode::Kind::kAmbiguous:
      Complain(node.mark, fmt::format("{}: {}: {}; put quotes around it if text is meant", key,
                                      Describe(node), node.complaint));
      return std::nullopt;
    case YamlNode::Kind::kNull:
    case YamlNode::Kind::kSequence:
    case YamlNode::Kind::kMapping:
      ComplainKind(key, node, "text");
      return std::nullopt;
  }
  if (node.text.empty()) {
    Complain(node.mark, fmt::format("{}: the text is empty", key));
  } else if (node.text.size() > rule.length_max) {
    Complain(node.mark, fmt::format("{}: longer than {} bytes", key, rule.length_max));
  } else if (HasControlCharacter(node.text)) {
    Complain(node.mark, fmt::format("{}: contains a control character", key));
  } else if (!rule.regex.empty() && !Matches(node.text, rule.regex)) {
    Complain(node.mark, fmt::format("{}: {} must be {}", key, Describe(node), rule.meaning));
  } else if (std::find(rule.reserved.begin(), rule.reserved.end(), node.text) != rule.reserved.end()) {
    Complain(node.mark, fmt::format("{}: {} is {}; choose another", key, Describe(node), rule.reserved_for));
  } else {
    return node.text;
  }
  return std::nullopt;
}

const std::vector<YamlNode>* MappingReader::ReadItems(std::string_view key, const YamlNode& node) {
  if (node.kind != YamlNode::Kind::kSequence) {
    ComplainKind(key, node, "a list");
    return nullptr;
  }
  if (node.items.size() > kListItemsMax) {
    Complain(node.mark, fmt::format("{}: more than {} items", key, kListItemsMax));
    return nullptr;
  }
  return &node.items;
}

std::optional<std::array<double, 3>> MappingReader::ReadPoint(std::string_view key, const YamlNode& node,
                                                              Range range) {
  std::array<double, 3> value{};
  if (node.kind != YamlNode::Kind::kSequence || node.items.size() != value.size()) {
    const std::string found = node.kind == YamlNode::Kind::kSequence
                                  ? fmt::format("a list of {}", node.items.size())
                                  : Describe(node);
    Complain(node.mark, fmt::format("{}: expected a list of three numbers, found {}", key, found));
    return std::nullopt;
  }
  bool good = true;
  for (std::size_t i = 0; i < value.size(); ++i) {
    const auto number = ReadNumber(key, node.items[i], range);
    good = good && number.has_value();
    value[i] = number.value_or(0.0);
  }
  return good ? std::optional(value) : std::nullopt;
}

void MappingReader::ReadBody(std::string_view key, const YamlNode& node, const Body& body) {
  if (node.kind != YamlNode::Kind::kMapping) {
    ComplainKind(key, node, "a mapping");
    return;
  }
  MappingReader reader(node, problems_);
  body(reader);
  reader.Finish();
  sections_.emplace_back(key, std::move(reader.known_));
}

void MappingReader::Refuse(const Key& key) {
  const YamlEntry* entry = mapping_.Find(key.name);
  if (entry == nullptr) return;
  known_.push_back(key.name);  // and said so
  Complain(entry->key_mark, fmt::format("{}: {}", key.name, key.doc));
}

void MappingReader::ExactlyOne(std::string_view mapping, std::span<const KeyGroup> groups) {
  std::vector<std::string> keys;
  const KeyGroup* chosen = nullptr;
  std::size_t count = 0;
  for (const KeyGroup& group : groups) {
    keys.push_back(fmt::format("'{}'", group.key));
    if (mapping_.Find(group.key) == nullptr) continue;
    chosen = &group;
    ++count;
  }
  if (count == 0) {
    Complain(mapping_.mark, fmt::format("{} needs {}", mapping, fmt::join(keys, " or ")));
  } else if (count > 1) {
    Complain(mapping_.mark, fmt::format("{} has either {}, not both", mapping, fmt::join(keys, " or ")));
  } else {
    for (const KeyGroup& group : groups) &group == chosen ? RequireCompanion(group) : RefuseCompanions(group);
  }
}

void MappingReader::RequireCompanion(const KeyGroup& group) {
  const auto has = [this](std::string_view key) { return mapping_.Find(key) != nullptr; };
  if (group.companions.empty() || std::any_of(group.companions.begin(), group.companions.end(), has)) return;
  std::vector<std::string> keys;
  for (const std::string_view key : group.companions) keys.push_back(fmt::format("'{}'", key));
  Complain(mapping_.Find(group.key)->value.mark,
           fmt::format("{}: needs {} or both", group.key, fmt::join(keys, ", ")));
}

void MappingReader::RefuseCompanions(const KeyGroup& group) {
  for (const std::string_view key : group.companions) {
    const YamlEntry* entry = mapping_.Find(key);
    if (entry == nullptr) continue;
    Complain(entry->value.mark, std::string(group.companions_refused));
    return;
  }
}

void MappingReader::Bool(const Key& key, bool& value) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::kBool) {
    value = node->boolean();
  } else {
    ComplainKind(key.name, *node, "true or false");
  }
}

void MappingReader::Number(const Key& key, double& value, Range range) {
  const YamlNode* node = Take(key);
  if (node != nullptr) value = ReadNumber(key.name, *node, range).value_or(value);
}

void MappingReader::MaybeNumber(const Key& key, std::optional<double>& value, Range range) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  if (const auto number = ReadNumber(key.name, *node, range)) value = number;
}

void MappingReader::Integer(const Key& key, std::int64_t& value, Range range) {
  const YamlNode* node = Take(key);
  if (node == nullptr || !ReadNumber(key.name, *node, range)) return;
  if (const auto integer = node->Integer()) {
    value = *integer;
  } else {
    Complain(node->mark, fmt::format("{}: expected a whole number without point and exponent, found {}",
                                     key.name, node->text));
  }
}

void MappingReader::Seconds(const Key& key, TimeNs& value_ns, Range range_s) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  if (const auto seconds = ReadNumber(key.name, *node, range_s)) value_ns = FromSeconds(*seconds);
}

void MappingReader::Text(const Key& key, std::string& value, const TextRule& rule) {
  const YamlNode* node = Take(key);
  if (node != nullptr) value = ReadText(key.name, *node, rule).value_or(value);
}

void MappingReader::Texts(const Key& key, std::vector<std::string>& value, const TextRule& rule) {
  const YamlNode* node = Take(key);
  const std::vector<YamlNode>* items = node == nullptr ? nullptr : ReadItems(key.name, *node);
  if (items == nullptr) return;
  value.clear();
  for (const YamlNode& item : *items) {
    if (auto text = ReadText(key.name, item, rule)) value.push_back(*std::move(text));
  }
}

void MappingReader::Values(const Key& key, std::vector<NumberOrWord>& value) {
  const YamlNode* node = Take(key);
  const std::vector<YamlNode>* items = node == nullptr ? nullptr : ReadItems(key.name, *node);
  if (items == nullptr) return;
  if (items->empty()) Complain(node->mark, fmt::format("{}: the list is empty", key.name));
  value.clear();
  for (const YamlNode& item : *items) {
    if (item.kind == YamlNode::Kind::kText) {
      value.emplace_back(item.text);
    } else if (const auto number = ReadNumber(key.name, item, kAnyNumber)) {
      value.emplace_back(*number);
    }
  }
}

void MappingReader::Point(const Key& key, std::array<double, 3>& value, Range range) {
  const YamlNode* node = Take(key);
  if (node != nullptr) value = ReadPoint(key.name, *node, range).value_or(value);
}

void MappingReader::Points(const Key& key, std::vector<std::array<double, 3>>& value, Range range) {
  const YamlNode* node = Take(key);
  const std::vector<YamlNode>* items = node == nullptr ? nullptr : ReadItems(key.name, *node);
  if (items == nullptr) return;
  if (items->empty()) Complain(node->mark, fmt::format("{}: the list is empty", key.name));
  value.clear();
  for (const YamlNode& item : *items) {
    if (const auto point = ReadPoint(key.name, item, range)) value.push_back(*point);
  }
}

std::optional<std::size_t> MappingReader::ReadWord(std::string_view written, const YamlNode& node,
                                                   const Key& key, std::span<const std::string_view> words) {
  // Where the words are known, `y` and `nan` are words like others.
  const bool is_word =
      node.kind == YamlNode::Kind::kText || (node.kind == YamlNode::Kind::kAmbiguous &&
                                             std::find(words.begin(), words.end(), node.text) != words.end());
  if (!is_word) {
    Complain(node.mark, fmt::format("{}: expected one of {}, found {}", written, fmt::join(words, ", "),
                                    Describe(node)));
    return std::nullopt;
  }
  const auto found = std::find(words.begin(), words.end(), node.text);
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  const std::string_view why = key.why_no_longer == nullptr ? "" : key.why_no_longer(node.text);
  Complain(node.mark, why.empty() ? fmt::format("{}: unknown value {}{}", written, Describe(node),
                                                DidYouMean(node.text, words))
                                  : fmt::format("{}: {} {}", written, Describe(node), why));
  return std::nullopt;
}

void MappingReader::Choice(const Key& key, std::span<const std::string_view> words,
                           std::optional<std::size_t>& index) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  const std::string_view written = mapping_.Find(key.name) == nullptr ? key.other_name : key.name;
  if (const auto place = ReadWord(written, *node, key, words)) index = place;
}

void MappingReader::WordOrName(const Key& key, std::span<const std::string_view> words, std::string& text,
                               const TextRule& rule) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::kText) {
    text = ReadText(key.name, *node, rule).value_or(text);
  } else if (const auto word = ReadWord(key.name, *node, key, words)) {
    text = words[*word];
  }
}

void MappingReader::Bytes(const Key& key, std::vector<std::uint8_t>& value, std::size_t count_max) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::kNumber || node->kind == YamlNode::Kind::kAmbiguous)
    return Complain(node->mark, fmt::format("{}: expected a list of bytes: [{}]", key.name, node->text));
  const std::vector<YamlNode>* items = ReadItems(key.name, *node);
  if (items == nullptr) return;
  if (items->empty() || items->size() > count_max)
    Complain(node->mark,
             fmt::format("{}: expected 1 to {} bytes, found {}", key.name, count_max, items->size()));
  value.clear();
  for (const YamlNode& item : *items) {
    const bool is_hexadecimal = item.kind == YamlNode::Kind::kAmbiguous && item.text.starts_with("0x");
    const std::string_view digits = std::string_view(item.text).substr(is_hexadecimal ? 2 : 0);
    std::uint8_t byte = 0;
    const auto [end, error] =
        std::from_chars(digits.data(), digits.data() + digits.size(), byte, is_hexadecimal ? 16 : 10);
    const bool is_number = is_hexadecimal || item.kind == YamlNode::Kind::kNumber;
    if (!is_number || error != std::errc() || end != digits.data() + digits.size())
      Complain(item.mark, fmt::format("{}: expected a byte such as 170 or 0xAA, found {}", key.name,
                                      is_number ? item.text : Describe(item)));
    value.push_back(byte);
  }
}

void MappingReader::ChoiceByName(const Key& key, std::span<const std::string_view> words, NamedChoices& value,
                                 const TextRule& name_rule) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  if (node->kind != YamlNode::Kind::kMapping) {
    value.all = ReadWord(key.name, *node, key, words).value_or(value.all);
    return;
  }
  if (node->entries.empty()) Complain(node->mark, fmt::format("{}: the mapping is empty", key.name));
  for (const YamlEntry& entry : node->entries) {
    YamlNode name;
    name.kind = YamlNode::Kind::kText;
    name.mark = entry.key_mark;
    name.text = entry.key;
    const auto known = ReadText(key.name, name, name_rule);
    if (entry.value.kind == YamlNode::Kind::kNull) {
      Complain(entry.key_mark, fmt::format("{}: {}: the value is missing", key.name, entry.key));
      continue;
    }
    const auto place = ReadWord(fmt::format("{}: {}", key.name, entry.key), entry.value, key, words);
    if (known && place) value.by_name.emplace_back(*known, *place);
  }
}

void MappingReader::Section(const Key& key, const Body& body) {
  const YamlNode* node = Take(key);
  if (node != nullptr) {
    ReadBody(key.name, *node, body);
  } else if (key.presence == Presence::kOptional) {
    // Keys inside may be required all the same.
    YamlNode empty;
    empty.kind = YamlNode::Kind::kMapping;
    empty.mark = mapping_.mark;
    ReadBody(key.name, empty, body);
  } else {
    // The keys that it would have had.
    const YamlNode nothing;
    std::vector<YamlProblem> ignored;
    MappingReader reader(nothing, ignored);
    body(reader);
    sections_.emplace_back(key.name, std::move(reader.known_));
  }
}

void MappingReader::MaybeSection(const Key& key, bool, const Body& body) {
  if (const YamlNode* node = Take(key)) ReadBody(key.name, *node, body);
}

void MappingReader::WordOrSection(const Key& key, std::string_view word, bool, const Body& body) {
  const YamlNode* node = Take(key);
  if (node == nullptr || (node->kind == YamlNode::Kind::kText && node->text == word)) return;
  if (node->kind == YamlNode::Kind::kMapping)
    ReadBody(key.name, *node, body);
  else
    ComplainKind(key.name, *node, fmt::format("'{}' or a mapping", word));
}

void MappingReader::NameOrSection(const Key& key, std::span<const std::string_view> names, std::string& name,
                                  const Body& body) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  const std::string_view written = mapping_.Find(key.name) == nullptr ? key.other_name : key.name;
  if (node->kind == YamlNode::Kind::kMapping) {
    name.clear();
    ReadBody(written, *node, body);
    return;
  }
  const auto text = ReadText(written, *node, {});
  if (!text) return;
  name = *text;
  if (name.ends_with(".yaml") || name.ends_with(".yml") ||
      std::find(names.begin(), names.end(), name) != names.end())
    return;
  const std::string valid =
      ClosestName(name, names).empty()
          ? fmt::format("; valid: {}, or a path that ends in .yaml", fmt::join(names, ", "))
          : DidYouMean(name, names);
  Complain(node->mark, fmt::format("{}: unknown value {}{}", written, Describe(*node), valid));
}

void MappingReader::List(const Key& key, std::size_t, const std::function<void(std::size_t)>& resize,
                         const NumberedBody& body) {
  const YamlNode* node = Take(key);
  const std::vector<YamlNode>* items = node == nullptr ? nullptr : ReadItems(key.name, *node);
  if (items == nullptr) return;
  resize(items->size());
  for (std::size_t i = 0; i < items->size(); ++i) {
    ReadBody(key.name, (*items)[i], [&](KeyVisitor& reader) { body(reader, i); });
  }
}

void MappingReader::NumberOr(const Key& key, std::string_view word, std::optional<double>& value,
                             Range range) {
  const YamlNode* node = Take(key);
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::kText && node->text == word)
    value.reset();
  else if (node->kind != YamlNode::Kind::kNumber)
    ComplainKind(key.name, *node, fmt::format("'{}' or a number", word));
  else if (const auto number = ReadNumber(key.name, *node, range))
    value = number;
}

void MappingReader::Alternatives(const Key& key, std::span<const Alternative> alternatives,
                                 std::optional<std::size_t> otherwise, const NumberedBody& body) {
  std::vector<std::string_view> words;
  for (const Alternative& alternative : alternatives) words.push_back(alternative.word);
  std::optional<std::size_t> index;
  if (key.presence == Presence::kOptional && mapping_.Find(key.name) == nullptr) index = otherwise;
  Choice(key, words, index);
  if (index) {
    body(*this, *index);
  } else {
    keys_unknowable_ = true;
  }
}

}  // namespace tiltproof::harness
