// WriteResolved(): the keys of a scenario as YAML, every value written out.
#include <fmt/format.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>

#include "harness/scenario/keys.h"
#include "harness/scenario/model_path.h"
#include "harness/scenario/reader.h"

namespace tiltproof::harness {
namespace {

// A JSON string is a double-quoted YAML scalar.
std::string Quoted(const std::string& text) { return nlohmann::json(text).dump(); }

// Exact, and shortest: at most nine decimals.
std::string SecondsText(TimeNs time_ns) {
  const std::int64_t magnitude = std::abs(time_ns);
  std::string text =
      fmt::format("{}{}.{:09}", time_ns < 0 ? "-" : "", magnitude / kNsPerS, magnitude % kNsPerS);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string PointText(const std::array<double, 3>& point) {
  return fmt::format("[{}]", fmt::join(point, ", "));
}

class Writer : public KeyVisitor {
 public:
  std::string Take() { return std::move(text_); }

  void Bool(const Key& key, bool& value) override { Line(key, value ? "true" : "false"); }
  void Number(const Key& key, double& value, Range) override { Line(key, fmt::format("{}", value)); }
  void MaybeNumber(const Key& key, std::optional<double>& value, Range) override {
    if (value) Line(key, fmt::format("{}", *value));
  }
  void Integer(const Key& key, std::int64_t& value, Range) override { Line(key, fmt::format("{}", value)); }
  void Seconds(const Key& key, TimeNs& value_ns, Range) override {
    if (value_ns != kPowerOn && value_ns != kNever) Line(key, SecondsText(value_ns));
  }
  void Text(const Key& key, std::string& value, const TextRule&) override {
    if (!value.empty()) Line(key, Quoted(value));
  }
  void Texts(const Key& key, std::vector<std::string>& value, const TextRule&) override {
    std::vector<std::string> quoted;
    for (const auto& text : value) quoted.push_back(Quoted(text));
    Line(key, fmt::format("[{}]", fmt::join(quoted, ", ")));
  }
  void Point(const Key& key, std::array<double, 3>& value, Range) override { Line(key, PointText(value)); }
  void Points(const Key& key, std::vector<std::array<double, 3>>& value, Range) override {
    std::vector<std::string> points;
    for (const auto& point : value) points.push_back(PointText(point));
    Line(key, fmt::format("[{}]", fmt::join(points, ", ")));
  }
  void Values(const Key& key, std::vector<NumberOrWord>& value) override {
    std::vector<std::string> texts;
    for (const NumberOrWord& one : value) {
      const auto* word = std::get_if<std::string>(&one);
      texts.push_back(word != nullptr ? Quoted(*word) : fmt::format("{}", std::get<double>(one)));
    }
    if (!texts.empty()) Line(key, fmt::format("[{}]", fmt::join(texts, ", ")));
  }
  void Choice(const Key& key, std::span<const std::string_view> words,
              std::optional<std::size_t>& index) override {
    if (index) Line(key, std::string(words[*index]));
  }
  void WordOrName(const Key& key, std::span<const std::string_view>, std::string& text,
                  const TextRule&) override {
    if (!text.empty()) Line(key, text);
  }
  void Bytes(const Key& key, std::vector<std::uint8_t>& value, std::size_t) override {
    if (!value.empty()) Line(key, fmt::format("[{:#04x}]", fmt::join(value, ", ")));
  }
  void ChoiceByName(const Key& key, std::span<const std::string_view> words, NamedChoices& value,
                    const TextRule&) override {
    if (value.by_name.empty()) return Line(key, std::string(words[value.all]));
    std::vector<std::string> entries;
    for (const auto& [name, index] : value.by_name)
      entries.push_back(fmt::format("{}: {}", Quoted(name), words[index]));
    Line(key, fmt::format("{{{}}}", fmt::join(entries, ", ")));
  }
  void Section(const Key& key, const Body& body) override {
    Writer inner;
    inner.indent_ = indent_ + 2;
    body(inner);
    if (inner.text_.empty()) {
      Line(key, "{}");
    } else {
      Line(key, "");
      text_ += inner.text_;
    }
  }
  void MaybeSection(const Key& key, bool is_there, const Body& body) override {
    if (is_there) Section(key, body);
  }
  void WordOrSection(const Key& key, std::string_view word, bool is_there, const Body& body) override {
    is_there ? Section(key, body) : Line(key, std::string(word));
  }
  void NameOrSection(const Key& key, std::span<const std::string_view>, std::string& name,
                     const Body& body) override {
    name.empty() ? Section(key, body) : Line(key, name);
  }
  void List(const Key& key, std::size_t count, const std::function<void(std::size_t)>&,
            const NumberedBody& body) override {
    if (count == 0) return Line(key, "[]");
    Line(key, "");
    for (std::size_t i = 0; i < count; ++i) {
      Writer inner;
      inner.indent_ = indent_ + 4;
      body(inner, i);
      inner.text_[indent_ + 2] = '-';
      text_ += inner.text_;
    }
  }
  void NumberOr(const Key& key, std::string_view word, std::optional<double>& value, Range) override {
    Line(key, value ? fmt::format("{}", *value) : std::string(word));
  }
  void Alternatives(const Key& key, std::span<const Alternative> alternatives,
                    std::optional<std::size_t> index, const NumberedBody& body) override {
    if (!index) return;
    Line(key, std::string(alternatives[*index].word));
    body(*this, *index);
  }

 private:
  void Line(const Key& key, const std::string& value) {
    text_ += fmt::format("{:{}}{}:{}{}\n", "", indent_, key.name, value.empty() ? "" : " ", value);
  }

  std::string text_;
  std::size_t indent_ = 0;
};

}  // namespace

std::string WriteResolved(const Scenario& scenario) {
  Scenario resolved = scenario;
  if (IsModelPath(resolved.model) && !resolved.model_file.empty())
    resolved.model = resolved.model_file.string();
  if (!resolved.gain_file.empty()) resolved.gain = resolved.gain_file.string();
  if (auto* recorded = std::get_if<RecordedReference>(&resolved.reference.path)) {
    recorded->file = std::filesystem::absolute(recorded->file);
  }
  return WriteKeys([&](KeyVisitor& writer) { DescribeScenario(writer, resolved); });
}

std::string WriteKeys(const KeyVisitor::Body& describe) {
  Writer writer;
  describe(writer);
  return writer.Take();
}

}  // namespace tiltproof::harness
