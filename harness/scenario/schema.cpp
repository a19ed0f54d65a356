#include "harness/scenario/schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "faults/registry.h"
#include "faults/signal_choice.h"
#include "harness/scenario/fault_keys.h"
#include "harness/scenario/keys.h"
#include "harness/scenario/protocol_file.h"

namespace tiltproof::harness {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kDraft = "https://json-schema.org/draft/2020-12/schema";

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

// A condition holds for no value but a mapping: an editor that completes an empty place would offer every branch.
Json If(Json condition) {
  condition["type"] = "object";
  return condition;
}

// One mapping. Values passed in are the defaults.
//
// Titles are what an editor names in front of an error: "mean_ms of frame.delay".
class SchemaBuilder : public KeyVisitor {
 public:
  explicit SchemaBuilder(std::string title) : title_(std::move(title)) {}

  // The object of the keys described so far.
  //
  // Where a word decides about keys, one branch each applies when the word is there. (With `oneOf`, editors
  // would offer only the words that fit what is written already, and a mistake in the word or in one key would be
  // reported as one of the first alternative, or as one of all.)
  Json Take() const {
    Json object = Object(title_, properties_, required_);
    object.update(rules_);
    if (alternatives_.empty()) return object;
    object.erase("additionalProperties");  // which ones there may be, the branches say
    for (const SchemaBuilder& alternative : alternatives_) {
      Json properties = alternative.properties_;
      for (const auto& [name, schema] : properties_.items())
        if (name != deciding_key_) properties[name] = schema;
      const Json word = {{deciding_key_, {{"const", alternative.word_}}}};
      Json condition = {{"properties", word}};
      if (alternative.word_ != default_word_) condition["required"] = {deciding_key_};
      object["allOf"].push_back({{"if", If(std::move(condition))},
                                 {"then", Object(alternative.title_, properties, alternative.required_)}});
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
  void WordOrName(const Key& key, std::span<const std::string_view> words, std::string& text,
                  const TextRule& rule) override {
    const Json schema = {{"anyOf", {{{"enum", words}}, TextSchema(rule)}}};
    text.empty() ? Add(key, schema) : Add(key, schema, text);
  }
  void Bytes(const Key& key, std::vector<std::uint8_t>&, std::size_t count_max) override {
    const Json byte = {{"type", "integer"}, {"minimum", 0}, {"maximum", 255}};
    Add(key, {{"type", "array"}, {"items", byte}, {"minItems", 1}, {"maxItems", count_max}});
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
    const std::string name(key.name);
    SchemaBuilder inner(word_.empty() ? name : fmt::format("{} of {}", name, word_));
    inner.belongs_to_ = word_;
    body(inner);
    Add(key, inner.Take());
  }
  void MaybeSection(const Key& key, bool, const Body& body) override { Section(key, body); }
  void WordOrSection(const Key& key, std::string_view word, bool, const Body& body) override {
    const std::string name(key.name);
    SchemaBuilder inner(name);
    body(inner);
    Add(key, {{"anyOf", {{{"enum", {word}}}, inner.Take()}}}, std::string(word));
  }
  void NameOrSection(const Key& key, std::span<const std::string_view> names, std::string& name,
                     const Body& body) override {
    SchemaBuilder inner((std::string(key.name)));
    body(inner);
    const Json path = {{"type", "string"}, {"pattern", "\\.ya?ml$"}};
    Add(key, {{"anyOf", {{{"enum", names}}, inner.Take(), path}}}, name);
  }
  void List(const Key& key, std::size_t, const std::function<void(std::size_t)>& resize,
            const NumberedBody& body) override {
    resize(1);
    SchemaBuilder item(std::string(key.name.substr(0, key.name.find_last_not_of('s') + 1)));
    body(item, 0);
    Add(key, {{"type", "array"}, {"items", item.Take()}, {"maxItems", kListItemsMax}});
  }
  void NumberOr(const Key& key, std::string_view word, std::optional<double>& value, Range range) override {
    const Json schema = {{"anyOf", {{{"enum", {word}}}, NumberSchema(range)}}};
    value ? Add(key, schema, NumberJson(*value)) : Add(key, schema, std::string(word));
  }
  void Alternatives(const Key& key, std::span<const Alternative> alternatives,
                    std::optional<std::size_t> otherwise, const NumberedBody& body) override {
    deciding_key_ = key.name;
    if (key.presence == Presence::kOptional && otherwise) default_word_ = alternatives[*otherwise].word;
    Json words = Json::array();
    for (std::size_t i = 0; i < alternatives.size(); ++i) {
      const Json word = {{"const", alternatives[i].word}, {"description", alternatives[i].doc}};
      words.push_back(word);
      SchemaBuilder alternative(fmt::format("{} {}", title_, alternatives[i].word));
      alternative.word_ = alternatives[i].word;
      alternative.properties_[deciding_key_] = word;
      body(alternative, i);
      alternatives_.push_back(std::move(alternative));
    }
    const Json schema = {{"type", "string"}, {"oneOf", words}};
    default_word_.empty() ? Add(key, schema) : Add(key, schema, default_word_);
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
      rules_["allOf"].push_back({{"if", If({{"required", {group.key}}})}, {"then", beside_it}});
    }
  }

 private:
  static Json Object(const std::string& title, const Json& properties, const Json& required) {
    Json object = {
        {"title", title}, {"type", "object"}, {"properties", properties}, {"additionalProperties", false}};
    if (!required.empty()) object["required"] = required;
    return object;
  }

  void Add(const Key& key, Json schema, const Json& default_value = nullptr) {
    if (!belongs_to_.empty()) schema["title"] = fmt::format("{} of {}", key.name, belongs_to_);
    schema["description"] = key.doc;
    if (key.presence == Presence::kOptional && !default_value.is_null()) schema["default"] = default_value;
    if (key.presence == Presence::kRequired) required_.push_back(key.name);
    properties_[std::string(key.name)] = schema;
    if (key.other_name.empty()) return;
    schema["description"] = fmt::format("Another name for `{}`", key.name);
    properties_[std::string(key.other_name)] = std::move(schema);
    const Json without = {{"properties", {{std::string(key.other_name), false}}}};
    rules_["allOf"].push_back({{"if", If({{"required", {key.name}}})}, {"then", without}});
  }

  std::string title_;
  Json properties_ = Json::object();
  Json required_ = Json::array();
  Json rules_ = Json::object();  // that compare keys with each other
  std::string deciding_key_;
  std::string default_word_;  // of that key, where it is optional
  std::vector<SchemaBuilder> alternatives_;
  std::string word_;        // of an alternative: which one it is
  std::string belongs_to_;  // of a section of an alternative: which one that is
};

Json BuildSchema() {
  Scenario defaults;
  SchemaBuilder builder("tiltproof scenario");
  DescribeScenario(builder, defaults);
  return builder.Take();
}

Json Reference(std::string_view definition) { return {{"$ref", fmt::format("#/$defs/{}", definition)}}; }

Json CompoundSchema(const Json& members) {
  SchemaBuilder builder("compound");
  Compound compound;
  DescribeCompound(builder, compound);
  Json schema = builder.Take();
  schema["properties"]["compound"] = {{"type", "array"},
                                      {"items", members},
                                      {"minItems", 1},
                                      {"maxItems", kListItemsMax},
                                      {"description", "Its members, each with its own id and random stream"}};
  schema["required"].push_back("compound");
  return schema;
}

bool IsEndOfWindow(const Json& key) { return key == "start_s" || key == "end_s"; }

// Turns the schema of one fault into that of a fault or a compound of such faults. What both need stands in `definitions`
// once.
Json WithCompounds(Json fault, Json& definitions) {
  definitions["fault type"] = fault["properties"]["type"];
  fault["properties"]["type"] = Reference("fault type");
  Json member = fault;
  for (std::size_t i = 0; i < fault["allOf"].size(); ++i) {
    Json keys = fault["allOf"][i]["then"];
    const std::string type = keys["properties"]["type"]["const"];
    // The compound may state the ends of the window that its member must have.
    Json ends = Json::array(), required = Json::array();
    for (const Json& key : keys["required"]) (IsEndOfWindow(key) ? ends : required).push_back(key);
    keys["required"] = required;
    definitions[type] = keys;
    member["allOf"][i]["then"] = Reference(type);
    fault["allOf"][i]["then"] = Reference(type);
    if (ends.empty()) continue;
    fault["allOf"][i]["then"] = {
        {"title", keys["title"]}, {"allOf", Json::array({Reference(type)})}, {"required", ends}};
  }
  member["title"] = "member of a compound";
  definitions["compound"] = CompoundSchema(member);
  // One that is neither yet may become both.
  auto& required = fault["required"];
  required.erase(std::find(required.begin(), required.end(), "type"));
  const Json either = {{"type", "array"},
                       {"description", "Several faults in place of one, with a window in common"}};
  const Json neither = {{"title", "fault"}, {"properties", {{"compound", either}}}, {"required", {"type"}}};
  const Json untyped = {
      {"if", If({{"required", {"compound"}}})}, {"then", Reference("compound")}, {"else", neither}};
  fault["allOf"].push_back({{"if", If({{"required", {"type"}}})}, {"else", untyped}});
  return fault;
}

// The names that a parameter is likely to have; any vehicle and protocol has others.
std::vector<std::string> UsualNames(const faults::ParameterInfo& info, const VehicleSignals& vehicle) {
  if (faults::NamesSignal(info.kind) || faults::NamesPart(info.kind))
    return faults::SignalNames(vehicle, info.kind);
  if (info.kind != faults::ParameterKind::kField) return {};
  std::set<std::string> names;
  for (const faults::Target target :
       {faults::Target::kToClient, faults::Target::kToPlant, faults::Target::kReference}) {
    const auto fields = faults::FieldNames(*LinkSpec().protocol, target);
    names.insert(fields.begin(), fields.end());
  }
  return {names.begin(), names.end()};
}

// Adds the registry's facts on each parameter, beyond what the reader asks.
void DescribeParameters(Json& definitions, const VehicleSignals& vehicle) {
  for (const faults::FaultType& type : faults::FaultTypes()) {
    Json& fault = definitions[std::string(type.name)]["properties"];
    if (fault.contains("message"))
      for (const link::MessageType& message : LinkSpec().protocol->messages)
        fault["message"]["examples"].push_back(message.name);
    Json& keys = fault["parameters"]["properties"];
    for (const faults::ParameterInfo& info : type.parameters) {
      Json& parameter = keys[std::string(info.name)];
      parameter["description"] = faults::ParameterText(info);
      const std::vector<std::string> names = UsualNames(info, vehicle);
      if (!names.empty()) parameter["examples"] = names;
    }
  }
}

// The allowed values, in a few words.
std::string AllowedText(const Json& schema) {
  if (schema.contains("const")) return fmt::format("`{}`", schema["const"].get<std::string>());
  if (schema.contains("enum")) {
    std::vector<std::string> words;
    for (const auto& word : schema["enum"]) words.push_back(fmt::format("`{}`", word.get<std::string>()));
    return fmt::format("{}", fmt::join(words, ", "));
  }
  if (schema.contains("anyOf") && schema["anyOf"].size() == 3)
    return fmt::format("{}, a path that ends in `.yaml`, or a mapping", AllowedText(schema["anyOf"][0]));
  if (schema.contains("anyOf") && schema["anyOf"][1].value("type", "") == "number")
    return fmt::format("{}, or {}", AllowedText(schema["anyOf"][0]), AllowedText(schema["anyOf"][1]));
  if (schema.contains("anyOf") && schema["anyOf"][1].value("type", "") == "string")
    return fmt::format("{}, or text", AllowedText(schema["anyOf"][0]));
  if (schema.contains("anyOf") && schema["anyOf"][1].contains("properties"))
    return fmt::format("{}, or a mapping", AllowedText(schema["anyOf"][0]));
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

std::string ScenarioJsonSchema(const std::vector<std::string>& metric_names, const VehicleSignals& vehicle) {
  Json schema = {{"$schema", kDraft}};
  schema.update(BuildSchema());
  // The metrics are known to those who score.
  Json& metric = schema["properties"]["criteria"]["items"]["properties"]["metric"];
  metric["anyOf"] = {{{"enum", metric_names}},
                     // With several clients the id follows the group.
                     {{"pattern", "^(link|timing|firmware)\\.[A-Za-z0-9_]+\\.[a-z0-9_.]+$"}}};
  Json definitions = Json::object();
  Json& item = schema["properties"]["faults"]["items"];
  item = WithCompounds(item, definitions);
  DescribeParameters(definitions, vehicle);
  schema["$defs"] = definitions;
  return schema.dump(1);
}

std::string ProtocolJsonSchema() {
  ProtocolSpec defaults;
  SchemaBuilder builder("tiltproof protocol");
  DescribeProtocol(builder, defaults);
  Json schema = {{"$schema", kDraft}};
  schema.update(builder.Take());
  return schema.dump(1);
}

std::string ScenarioKeysMarkdown() {
  const Json schema = BuildSchema();
  const Json& keys = schema["properties"];
  std::string text = Table("The file", Rows(schema));
  text += Table("An item of `clients`", Rows(keys["clients"]["items"]));
  text += Table("An item of `lines`", Rows(keys["lines"]["items"]));
  for (const Json& branch : keys["arbiter"]["allOf"]) {
    const Json& kind = branch["then"];
    text += Table(fmt::format("`arbiter` of type {}", kind["properties"]["type"]["const"].get<std::string>()),
                  Rows(kind, {"type"}));
  }
  text += Table("`control_period`", Rows(keys["control_period"]));
  text += Table("`clean_line`", Rows(keys["clean_line"]));
  text += Table("`initial`", Rows(keys["initial"]));
  text += Table("`ground`", Rows(keys["ground"]["anyOf"][1]));
  text += Table("`link`", Rows(keys["link"]));
  text += Table("`adapter` of `link`", Rows(keys["link"]["properties"]["adapter"]));
  for (const Json& branch : keys["reference"]["allOf"]) {
    const Json& kind = branch["then"];
    text +=
        Table(fmt::format("`reference` of type {}", kind["properties"]["type"]["const"].get<std::string>()),
              Rows(kind, {"type"}));
  }
  // The kinds of faults differ only in their parameters, which have their own page.
  const Json& kinds = keys["faults"]["items"];
  Json fault = kinds["allOf"].front()["then"];
  for (const Json& key : kinds["required"]) fault["required"].push_back(key);
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
