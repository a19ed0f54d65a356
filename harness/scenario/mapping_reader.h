// Fills the described keys from a YAML mapping, and notes all errors with their places.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/scenario/key_visitor.h"
#include "harness/scenario/yaml_tree.h"

namespace tiltproof::harness {

class MappingReader : public KeyVisitor {
 public:
  MappingReader(const YamlNode& mapping, std::vector<YamlProblem>& problems)
      : mapping_(mapping), problems_(problems) {}

  // Call after all keys were described: reports the keys in the file that were not described, and the missing
  // ones.
  void Finish();

  void Refuse(const Key& key) override;
  void ExactlyOne(std::string_view mapping, std::span<const KeyGroup> groups) override;
  void Bool(const Key& key, bool& value) override;
  void Number(const Key& key, double& value, Range range) override;
  void MaybeNumber(const Key& key, std::optional<double>& value, Range range) override;
  void Integer(const Key& key, std::int64_t& value, Range range) override;
  void Seconds(const Key& key, TimeNs& value_ns, Range range_s) override;
  void Text(const Key& key, std::string& value, const TextRule& rule) override;
  void Texts(const Key& key, std::vector<std::string>& value, const TextRule& rule) override;
  void Point(const Key& key, std::array<double, 3>& value, Range range) override;
  void Points(const Key& key, std::vector<std::array<double, 3>>& value, Range range) override;
  void Values(const Key& key, std::vector<NumberOrWord>& value) override;
  void Choice(const Key& key, std::span<const std::string_view> words,
              std::optional<std::size_t>& index) override;
  void WordOrName(const Key& key, std::span<const std::string_view> words, std::string& text,
                  const TextRule& rule) override;
  void Bytes(const Key& key, std::vector<std::uint8_t>& value, std::size_t count_max) override;
  void ChoiceByName(const Key& key, std::span<const std::string_view> words, NamedChoices& value,
                    const TextRule& name_rule) override;
  void Section(const Key& key, const Body& body) override;
  void MaybeSection(const Key& key, bool is_there, const Body& body) override;
  void WordOrSection(const Key& key, std::string_view word, bool is_there, const Body& body) override;
  void NameOrSection(const Key& key, std::span<const std::string_view> names, std::string& name,
                     const Body& body) override;
  void List(const Key& key, std::size_t count, const std::function<void(std::size_t)>& resize,
            const NumberedBody& body) override;
  void NumberOr(const Key& key, std::string_view word, std::optional<double>& value, Range range) override;
  void Alternatives(const Key& key, std::span<const Alternative> alternatives,
                    std::optional<std::size_t> index, const NumberedBody& body) override;

 private:
  // The value of a key that is there and not empty.
  const YamlNode* Take(const Key& key);
  void Complain(YamlMark mark, std::string message) { problems_.push_back({mark, std::move(message)}); }
  void ComplainKind(std::string_view key, const YamlNode& node, std::string_view expected);

  std::optional<double> ReadNumber(std::string_view key, const YamlNode& node, Range range);
  std::optional<std::string> ReadText(std::string_view key, const YamlNode& node, const TextRule& rule);
  std::optional<std::array<double, 3>> ReadPoint(std::string_view key, const YamlNode& node, Range range);
  // The place of the word; `written` is its key.
  std::optional<std::size_t> ReadWord(std::string_view written, const YamlNode& node, const Key& key,
                                      std::span<const std::string_view> words);
  const std::vector<YamlNode>* ReadItems(std::string_view key, const YamlNode& node);
  void RequireCompanion(const KeyGroup& group);
  void RefuseCompanions(const KeyGroup& group);
  void ReadBody(std::string_view key, const YamlNode& node, const Body& body);
  // The section that has a key of this name; empty when none has.
  std::string_view SectionOf(std::string_view name) const;

  const YamlNode& mapping_;
  std::vector<YamlProblem>& problems_;
  std::vector<std::string_view> known_;
  std::vector<std::string_view> missing_;
  std::vector<std::pair<std::string_view, std::vector<std::string_view>>> sections_;  // with their keys
  bool keys_unknowable_ = false;  // the word that decides them is wrong
};

}  // namespace tiltproof::harness
