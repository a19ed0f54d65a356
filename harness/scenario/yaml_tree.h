// Strict YAML: what a scenario file may be made of, as a tree with the place of every key and value.
//
// YAML can say the same thing in many ways, and misreads some plain words (`010` is 8, `no` is false). Here
// one document holds mappings, lists and scalars; a number is written as in JSON, a truth value is true or
// false, and anchors, aliases, tags, duplicate keys and several documents are refused. This is the only unit
// that sees the YAML library.
//
//   std::vector<YamlProblem> problems;
//   const std::optional<YamlNode> root = ParseYaml(text, problems);
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tiltproof::harness {

// 1-based; columns count characters, as editors do.
struct YamlMark {
  int line = 1;
  int column = 1;
  // NOLINTNEXTLINE(modernize-use-nullptr): the 0 that the compiler writes is not ours.
  friend auto operator<=>(const YamlMark&, const YamlMark&) = default;
};

struct YamlProblem {
  YamlMark mark;
  std::string message;
};

struct YamlEntry;

struct YamlNode {
  // The type of a scalar is decided here, by its spelling: quoted is always text.
  enum class Kind : std::uint8_t { kNull, kBool, kNumber, kText, kAmbiguous, kSequence, kMapping };

  Kind kind = Kind::kNull;
  YamlMark mark;
  std::string text;       // a scalar's, without quotes and escapes
  std::string complaint;  // kAmbiguous: why a plain scalar is neither number, truth value nor clearly text
  std::optional<YamlMark>
      text_begin;                  // where `text` begins, when the file contains it unchanged and on one line
  std::vector<YamlNode> items;     // of a sequence
  std::vector<YamlEntry> entries;  // of a mapping, in file order, keys unique

  // nullptr when this is no mapping or has no such key.
  const YamlEntry* Find(std::string_view key) const;

  bool boolean() const { return text == "true"; }
  // The value of a kNumber; nullopt when a double cannot hold it (1e999).
  std::optional<double> Number() const;
  // The value of a kNumber written only with digits (and a minus); nullopt for others and beyond 64 bits.
  std::optional<std::int64_t> Integer() const;
};

struct YamlEntry {
  std::string key;
  YamlMark key_mark;
  YamlNode value;  // kNull has the mark of the key
};

inline constexpr std::size_t kYamlBytesMax = 1 << 20;
inline constexpr int kYamlDepthMax = 16;
inline constexpr std::size_t kYamlKeysMax = 1000;  // of one mapping

// Appends errors to `problems`. Returns the tree when the text could be read at all; with problems it lacks
// what they name.
std::optional<YamlNode> ParseYaml(std::string_view text, std::vector<YamlProblem>& problems);

// The value of a mapping's key; nullptr when there is none, or `mapping` is null.
const YamlNode* ValueOf(const YamlNode* mapping, std::string_view key);

// The place of a value deep down, keys separated by dots; of the deepest mapping on the way when it is
// absent.
YamlMark PlaceOf(const YamlNode& mapping, std::string_view path);

// Characters (code points) of UTF-8 text.
std::size_t CharacterCount(std::string_view text);

// For messages: "a list", "the number 7", "the text 'abc'".
std::string Describe(const YamlNode& node);

}  // namespace tiltproof::harness
