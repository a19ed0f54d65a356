#include "harness/scenario/schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "harness/scenario/fault_keys.h"
#include "harness/scenario/keys.h"

namespace tiltproof::harness {
namespace {

using Json = nlohmann::ordered_json;

// Whole numbers without a decimal point.
Json NumberJson(double value) {
  const auto whole = static_cast<std::int64_t>(value);
  if (static_cast<double>(whole) == value) return whole;
  return value;
}

Json NumberSchema(Range range) {
  return {{"type", "number"}, {"minimum", NumberJson(range.min)}, {"maximum", NumberJson(range.max)}};
}

Json PointSchema(Range range) {
  return {{"type", "array"}, {"items", NumberSchema(range)}, {"minItems", 3}, {"maxItems", 3}};
}

Json TextSchema(const TextRule& rule) {
  Json schema = {{"type", "string"}, {"minLength", 1}, {"maxLength", rule.length_max}};
  if (!rule.regex.empty()) schema["pattern"] = fmt::format("^({})$", rule.regex);
  if (!rule.reserved.empty()) schema["not"] = {{"enum", rule.reserved}};
  return schema;
}

// One mapping. Values passed in are the defaults.
class SchemaBuilder : public KeyVisitor {
 public:
  // The object of the keys described so far.
  //
  // Where a word decides about keys, one branch each applies when the word is there. (With `oneOf`, editors
  // would offer only the words that fit what is written already, and a mistake in one key would refuse all
  // alternatives at once.)
  Json Take() const {
    Json object = Object(properties_, required_);
    object.update(rules_);
    if (alternatives_.empty()) return object;
    object.erase("additionalProperties");  // which ones there may be, the branches say
    for (const SchemaBuilder& alternative : alternatives_) {
      Json properties = alternative.properties_;
      Json required = alternative.required_;
      for (const auto& [name, schema] : properties_.items())
        if (name != deciding_key_) properties[name] = schema;
      for (const auto& name : required_) required.push_back(name);
      const Json word = {{deciding_key_, {{"const", alternative.word_}}}};
      object["allOf"].push_back({{"if", {{"properties", word}, {"required", {deciding_key_}}}},
                                 {"then", Object(properties, required)}});
    }
    return object;
  }

  void Bool(const Key& key, bool& value) override { Add(key, {{"type", "boolean"}}, value); }
  void Number(const Key& key, double& value, Range range) override {
    Add(key, NumberSchema(range), NumberJson(value));
  }
  void MaybeNumber(const Key& key, std::optional<double>&, Range range) override {
    Add(key, NumberSchema(range));
  }
  void Integer(const Key& key, std::int64_t& value, Range range) override {
    Json schema = NumberSchema(range);
    schema["type"] = "integer";
    Add(key, std::move(schema), value);
  }
  void Seconds(const Key& key, TimeNs& value_ns, Range range_s) override {
    if (value_ns == kPowerOn || value_ns == kNever) {
      Add(key, NumberSchema(range_s));
    } else {
      Add(key, NumberSchema(range_s), ToSeconds(value_ns));
    }
  }
  void Text(const Key& key, std::string& value, const TextRule& rule) override {
    value.empty() ? Add(key, TextSchema(rule)) : Add(key, TextSchema(rule), value);
  }
  void Texts(const Key& key, std::vector<std::string>& value, const TextRule& rule) override {
    Add(key, {{"type", "array"}, {"items", TextSchema(rule)}, {"maxItems", kListItemsMax}}, value);
  }
  void Point(const Key& key, std::array<double, 3>& value, Range range) override {
    Json point = Json::array();
    for (const double number : value) point.push_back(NumberJson(number));
    Add(key, PointSchema(range), point);
  }
  void Points(const Key& key, std::vector<std::array<double, 3>>&, Range range) override {
    Add(key,
        {{"type", "array"}, {"items", PointSchema(range)}, {"minItems", 1}, {"maxItems", kListItemsMax}});
  }
  void Choice(const Key& key, std::span<const std::string_view> words,
              std::optional<std::size_t>& index) override {
    const Json schema = {{"enum", words}};
    index ? Add(key, schema, std::string(words[*index])) : Add(key, schema);
  }
  void ChoiceByName(const Key& key, std::span<const std::string_view> words, NamedChoices& value,
                    const TextRule& name_rule) override {
    const Json word = {{"enum", words}};
    const Json by_name = {{"type", "object"},
                          {"propertyNames", TextSchema(name_rule)},
                          {"additionalProperties", word},
                          {"minProperties", 1}};
    Add(key, {{"anyOf", {word, by_name}}}, std::string(words[value.all]));
  }
  void Section(const Key& key, const Body& body) override {
    SchemaBuilder inner;
    body(inner);
    Add(key, inner.Take());
  }
  void MaybeSection(const Key& key, bool, const Body& body) override { Section(key, body); }
  void List(const Key& key, std::size_t, const std::function<void(std::size_t)>& resize,
            const NumberedBody& body) override {
    resize(1);
    SchemaBuilder item;
    body(item, 0);
    Add(key, {{"type", "array"}, {"items", item.Take()}, {"maxItems", kListItemsMax}});
  }
  void Alternatives(const Key& key, std::span<const Alternative> alternatives, std::optional<std::size_t>,
                    const NumberedBody& body) override {
    deciding_key_ = key.name;
    Json words = Json::array();
    for (std::size_t i = 0; i < alternatives.size(); ++i) {
      const Json word = {{"const", alternatives[i].word}, {"description", alternatives[i].doc}};
      words.push_back(word);
      SchemaBuilder alternative;
      alternative.word_ = alternatives[i].word;
      alternative.properties_[deciding_key_] = word;
      body(alternative, i);
      alternatives_.push_back(std::move(alternative));
    }
    Add(key, {{"oneOf", words}});
  }
  void ExactlyOne(std::string_view, std::span<const KeyGroup> groups) override {
    for (const KeyGroup& group : groups) {
      Json beside_it = Json::object();
      for (const KeyGroup& other : groups) {
        if (&other == &group) continue;
        beside_it["properties"][std::string(other.key)] = false;
        for (const std::string_view key : other.companions) beside_it["properties"][std::string(key)] = false;
      }
      for (const std::string_view key : group.companions) beside_it["anyOf"].push_back({{"required", {key}}});
      rules_["anyOf"].push_back({{"required", {group.key}}});
      rules_["allOf"].push_back({{"if", {{"required", {group.key}}}}, {"then", beside_it}});
    }
  }

 private:
  static Json Object(const Json& properties, const Json& required) {
    Json object = {{"type", "object"}, {"properties", properties}, {"additionalProperties", false}};
    if (!required.empty()) object["required"] = required;
    return object;
  }

  void Add(const Key& key, Json schema, const Json& default_value = nullptr) {
    schema["description"] = key.doc;
    if (key.presence == Presence::kOptional && !default_value.is_null()) schema["default"] = default_value;
    if (key.presence == Presence::kRequired) required_.push_back(key.name);
    properties_[std::string(key.name)] = schema;
    if (key.other_name.empty()) return;
    schema["description"] = fmt::format("Another name for `{}`", key.name);
    properties_[std::string(key.other_name)] = std::move(schema);
    rules_["not"] = {{"required", {key.name, key.other_name}}};
  }

  Json properties_ = Json::object();
  Json required_ = Json::array();
  Json rules_ = Json::object();  // that compare keys with each other
  std::string deciding_key_;
  std::vector<SchemaBuilder> alternatives_;
  std::string word_;  // of an alternative: which one it is
};

Json BuildSchema() {
  Scenario defaults;
  SchemaBuilder builder;
  DescribeScenario(builder, defaults);
  return builder.Take();
}

// A compound of such faults.
Json CompoundSchema(const Json& fault) {
  Json member = fault;
  for (Json& branch : member["allOf"]) {  // what a member must state, the compound may state for it
    Json required = Json::array();
    for (const Json& key : branch["then"]["required"])
      if (key != "start_s" && key != "end_s") required.push_back(key);
    branch["then"]["required"] = required;
  }
  SchemaBuilder builder;
  Compound compound;
  DescribeCompound(builder, compound);
  Json schema = builder.Take();
  schema["properties"]["compound"] = {{"type", "array"},
                                      {"items", member},
                                      {"minItems", 1},
                                      {"maxItems", kListItemsMax},
                                      {"description", "Its members, each with its own id and random stream"}};
  schema["required"].push_back("compound");
  return schema;
}

// What may stand there, in a few words.
std::string AllowedText(const Json& schema) {
  if (schema.contains("const")) return fmt::format("`{}`", schema["const"].get<std::string>());
  if (schema.contains("enum")) {
    std::vector<std::string> words;
    for (const auto& word : schema["enum"]) words.push_back(fmt::format("`{}`", word.get<std::string>()));
    return fmt::format("{}", fmt::join(words, ", "));
  }
  if (schema.contains("anyOf"))
    return fmt::format("{}, or a mapping of names to these", AllowedText(schema["anyOf"][0]));
  const std::string type = schema["type"];
  if (type == "number") return fmt::format("{} to {}", schema["minimum"].dump(), schema["maximum"].dump());
  if (type == "integer")
    return fmt::format("{} to {}, whole", schema["minimum"].dump(), schema["maximum"].dump());
  if (type == "boolean") return "`true`, `false`";
  if (type == "string") return "text";
  if (type == "object") return "mapping";
  const Json& items = schema["items"];
  if (items["type"] == "object") return "list of mappings";
  if (items["type"] == "array") return fmt::format("list of points, each {}", AllowedText(items));
  if (items["type"] == "string") return "list of texts";
  return fmt::format("three numbers, {}", AllowedText(items));
}

// The rows of one object's keys, `except` those of another table.
std::string Rows(const Json& object, const std::vector<std::string>& except = {}) {
  std::string text;
  const Json required = object.value("required", Json::array());
  for (const auto& [name, schema] : object["properties"].items()) {
    if (std::find(except.begin(), except.end(), name) != except.end()) continue;
    const bool is_required = std::find(required.begin(), required.end(), name) != required.end();
    const std::string fallback =
        schema.contains("default") ? fmt::format("`{}`", schema["default"].dump()) : "-";
    text += fmt::format("| `{}` | {} | {} | {} |\n", name, AllowedText(schema),
                        is_required ? "required" : fallback, schema["description"].get<std::string>());
  }
  return text;
}

std::string Table(const std::string& title, const std::string& rows) {
  return fmt::format("### {}\n\n| key | allowed | default | meaning |\n|---|---|---|---|\n{}\n", title, rows);
}

}  // namespace

std::string ScenarioJsonSchema(const std::vector<std::string>& metric_names) {
  Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                 {"title", "tiltproof scenario"}};
  schema.update(BuildSchema());
  // The metrics are known to those who score.
  Json& metric = schema["properties"]["criteria"]["items"]["properties"]["metric"];
  metric["anyOf"] = {{{"enum", metric_names}},
                     // With several clients the id follows the group.
                     {{"pattern", "^(link|timing|firmware)\\.[A-Za-z0-9_]+\\.[a-z0-9_.]+$"}}};
  Json& item = schema["properties"]["faults"]["items"];
  item = {{"if", {{"required", {"compound"}}}}, {"then", CompoundSchema(item)}, {"else", item}};
  return schema.dump(2);
}

std::string ScenarioKeysMarkdown() {
  const Json schema = BuildSchema();
  const Json& keys = schema["properties"];
  std::string text = Table("The file", Rows(schema));
  text += Table("An item of `clients`", Rows(keys["clients"]["items"]));
  text += Table("`arbiter`", Rows(keys["arbiter"]));
  text += Table("`control_period`", Rows(keys["control_period"]));
  text += Table("`initial`", Rows(keys["initial"]));
  text += Table("`link`", Rows(keys["link"]));
  for (const Json& branch : keys["reference"]["allOf"]) {
    const Json& kind = branch["then"];
    text +=
        Table(fmt::format("`reference` of type {}", kind["properties"]["type"]["const"].get<std::string>()),
              Rows(kind, {"type"}));
  }
  // The kinds of faults differ only in their parameters, which have their own page.
  const Json& kinds = keys["faults"]["items"];
  Json fault = kinds["allOf"].front()["then"];
  fault["properties"]["type"] = {{"type", "string"},
                                 {"description", kinds["properties"]["type"]["description"]}};
  text += Table("An item of `faults`", Rows(fault));
  text += Table("`after` of a fault", Rows(fault["properties"]["after"]));
  text += Table("A compound in `faults`", Rows(CompoundSchema(kinds)));
  text += Table("An item of `criteria`", Rows(keys["criteria"]["items"]));
  text.pop_back();
  return text;
}

}  // namespace tiltproof::harness
