// The keys of a YAML file, each described once: name, type, unit, range, default and meaning.
//
// A function visits the fields of a struct and tells a KeyVisitor about each one. What a visitor does with a field is its
// own matter: the reader fills it from YAML, the writer prints it, the schema notes its type and default. So the three
// cannot drift apart.
//
//   void DescribeLink(KeyVisitor& v, LinkSpec& link) {
//     v.Number({"adapter_latency_ms", "Buffering of a USB-serial adapter"}, link.adapter_latency_ms,
//              {0, 100});
//   }
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "link/time.h"

namespace tiltproof::harness {

// kDerived: may be left out, and then follows from other keys.
enum class Presence : std::uint8_t { kOptional, kRequired, kDerived };

struct Key {
  std::string_view name;
  std::string_view doc;  // one line for a person
  Presence presence = Presence::kOptional;
  std::string_view other_name = {};  // alternative to `name`; both at once are an error
  // For a word that was allowed in the past: "was replaced by ..."; empty for any other.
  std::string_view (*why_no_longer)(std::string_view word) = nullptr;
};

// Both ends included.
struct Range {
  double min = 0.0, max = 0.0;
};

// The texts that are allowed; an empty regex allows all but control characters.
struct TextRule {
  std::string_view regex;    // of the whole text, in JavaScript and POSIX (extended) alike: no \d
  std::string_view meaning;  // "must be ..."
  std::size_t length_max = 4096;
  std::span<const std::string_view> reserved = {};  // texts that are refused ...
  std::string_view reserved_for = {};               // ... since each "is ..."
};

// Names of scenarios, faults, criteria, tags.
inline constexpr TextRule kNameRule = {
    "[A-Za-z0-9][A-Za-z0-9_.-]*", "letters, digits, '_', '.', '-', beginning with a letter or digit", 100};

// Ids of clients: they are part of the names of columns and metrics, so a formula must be able to read them.
inline constexpr TextRule kClientRule = {"[A-Za-z0-9_]+", "letters, digits and '_'", 32};

// A key that excludes others, and the keys that are allowed only together with it.
struct KeyGroup {
  std::string_view key;
  std::vector<std::string_view> companions = {};  // it needs one of these; none: it needs no other
  std::string_view companions_refused = {};       // what is wrong with them together with another key
};

// A word that decides which other keys a mapping has.
struct Alternative {
  std::string_view word;
  std::string_view doc;  // one line for a person
};

// Places in a list of words: one for all names, or those of some.
struct NamedChoices {
  std::size_t all = 0;
  std::vector<std::pair<std::string, std::size_t>> by_name;  // in the file's order; empty: `all` was written
};

// A number or a word.
using NumberOrWord = std::variant<double, std::string>;

class KeyVisitor {
 public:
  using Body = std::function<void(KeyVisitor&)>;
  using NumberedBody = std::function<void(KeyVisitor&, std::size_t)>;

  virtual ~KeyVisitor() = default;

  // A key that other mappings of this kind have; `key.doc` says why this one has none.
  virtual void Refuse(const Key& /*key*/) {}

  // Exactly one of these keys, described as optional, must be there. `mapping` names it: "a criterion".
  virtual void ExactlyOne(std::string_view /*mapping*/, std::span<const KeyGroup> /*groups*/) {}

  // The value passed in is the default.
  virtual void Bool(const Key& key, bool& value) = 0;
  virtual void Number(const Key& key, double& value, Range range) = 0;
  virtual void MaybeNumber(const Key& key, std::optional<double>& value, Range range) = 0;
  virtual void Integer(const Key& key, std::int64_t& value, Range range) = 0;
  // Written in seconds. kPowerOn and kNever represent a key that is absent.
  virtual void Seconds(const Key& key, TimeNs& value_ns, Range range_s) = 0;
  // An empty text represents a key that is absent.
  virtual void Text(const Key& key, std::string& value, const TextRule& rule) = 0;
  virtual void Texts(const Key& key, std::vector<std::string>& value, const TextRule& rule) = 0;
  virtual void Point(const Key& key, std::array<double, 3>& value, Range range) = 0;
  virtual void Points(const Key& key, std::vector<std::array<double, 3>>& value, Range range) = 0;
  // Numbers and words, in a list; an empty list represents a key that is absent. No scenario has such a key.
  virtual void Values(const Key& /*key*/, std::vector<NumberOrWord>& /*value*/) {}
  // One of several words; nullopt represents a key that is absent.
  virtual void Choice(const Key& key, std::span<const std::string_view> words,
                      std::optional<std::size_t>& index) = 0;
  // One of several words, or a name that only the rest of the file explains. An empty text represents a key that is
  // absent.
  virtual void WordOrName(const Key& key, std::span<const std::string_view> words, std::string& text,
                          const TextRule& rule) = 0;
  // Bytes, written in decimal or as 0xAA; an empty list represents a key that is absent.
  virtual void Bytes(const Key& key, std::vector<std::uint8_t>& value, std::size_t count_max) = 0;
  // One of several words, or a mapping in which names that fit the rule have one word each.
  virtual void ChoiceByName(const Key& key, std::span<const std::string_view> words, NamedChoices& value,
                            const TextRule& name_rule) = 0;
  // A mapping in the mapping.
  virtual void Section(const Key& key, const Body& body) = 0;
  // The same, where its absence has a meaning. `body` is called only when it is there.
  virtual void MaybeSection(const Key& key, bool is_there, const Body& body) = 0;
  // A mapping, or the word that stands for its absence. `body` is called only when the mapping is there.
  virtual void WordOrSection(const Key& key, std::string_view word, bool is_there, const Body& body) = 0;
  // One of several names, a path with the ending of YAML files, or a mapping, which has no name. `body` is called only
  // when the mapping is there.
  virtual void NameOrSection(const Key& key, std::span<const std::string_view> names, std::string& name,
                             const Body& body) = 0;
  // A list of mappings. `resize` is called before the bodies.
  virtual void List(const Key& key, std::size_t count, const std::function<void(std::size_t)>& resize,
                    const NumberedBody& body) = 0;
  // A number, or the word that stands for its absence.
  virtual void NumberOr(const Key& key, std::string_view word, std::optional<double>& value, Range range) = 0;
  // A word decides which other keys this mapping has. `index`: the word when the key is absent, where it is optional.
  virtual void Alternatives(const Key& key, std::span<const Alternative> alternatives,
                            std::optional<std::size_t> index, const NumberedBody& body) = 0;
};

// One of these values of an enumeration, each with a name.
template <class Enum, std::size_t n>
void Enumeration(KeyVisitor& v, const Key& key, const std::array<Enum, n>& values, Enum& value) {
  std::array<std::string_view, n> words;
  std::optional<std::size_t> index;
  for (std::size_t i = 0; i < n; ++i) {
    words[i] = Name(values[i]);
    if (values[i] == value) index = i;
  }
  v.Choice(key, words, index);
  if (index) value = values[*index];
}

// A list of mappings, one for each item.
template <class Item, class Describe>
void ListOf(KeyVisitor& v, const Key& key, std::vector<Item>& items, Describe describe) {
  v.List(
      key, items.size(), [&](std::size_t count) { items.resize(count); },
      [&](KeyVisitor& w, std::size_t i) { describe(w, items[i]); });
}

inline constexpr std::size_t kListItemsMax = 1000;

// The described keys as YAML, every value written out.
std::string WriteKeys(const KeyVisitor::Body& describe);

}  // namespace tiltproof::harness
