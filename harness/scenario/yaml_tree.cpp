#include "harness/scenario/yaml_tree.h"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/mark.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "harness/scenario/lower_case.h"

namespace tiltproof::harness {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// -?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?
bool IsJsonNumber(std::string_view s) {
  std::size_t i = 0;
  const auto digits = [&] {
    const std::size_t begin = i;
    while (i < s.size() && IsDigit(s[i])) ++i;
    return i > begin;
  };
  if (i < s.size() && s[i] == '-') ++i;
  if (i < s.size() && s[i] == '0') {
    ++i;
  } else if (!digits()) {
    return false;
  }
  if (i < s.size() && s[i] == '.') {
    ++i;
    if (!digits()) return false;
  }
  if (i < s.size() && (s[i] == 'e' || s[i] == 'E')) {
    ++i;
    if (i < s.size() && (s[i] == '+' || s[i] == '-')) ++i;
    if (!digits()) return false;
  }
  return i == s.size();
}

// Complaint about a plain scalar that is no JSON number, but that a reader may take for one; empty: none may.
std::string NumberComplaint(std::string_view s) {
  std::string_view rest = s;
  if (!rest.empty() && (rest.front() == '+' || rest.front() == '-')) rest.remove_prefix(1);
  const std::string lower = LowerCase(rest);
  if (lower == ".inf" || lower == ".nan" || lower == "inf" || lower == "nan" || lower == "infinity") {
    return "only finite numbers are allowed";
  }
  const auto only = [&](std::string_view allowed) {
    return lower.find_first_not_of(allowed) == std::string::npos &&
           lower.find_first_of("0123456789") != std::string::npos;
  };
  if ((lower.starts_with("0x") && lower.find_first_not_of("0123456789abcdef_", 2) == std::string::npos) ||
      (lower.starts_with("0o") && lower.find_first_not_of("01234567_", 2) == std::string::npos) ||
      (lower.starts_with("0b") && lower.find_first_not_of("01_", 2) == std::string::npos)) {
    return "write the number in decimal";
  }
  if (!lower.empty() && (IsDigit(lower[0]) || lower[0] == '.') && only("0123456789_.e+-")) {
    if (lower.find('_') != std::string::npos) return "write the number without underscores";
    if (IsJsonNumber(lower) && s.front() == '+') return "write the number without a plus sign";
    if (lower[0] == '.' && std::count(lower.begin(), lower.end(), '.') == 1)
      return "write a digit before the decimal point";
    if (lower[0] == '0' && lower.size() > 1 && IsDigit(lower[1]))
      return "write the number without leading zeros";
    if (lower.back() == '.') return "write a digit after the decimal point, or leave it out";
  }
  return {};
}

void Classify(YamlNode& node, bool quoted) {
  if (quoted) {
    node.kind = YamlNode::Kind::kText;
    return;
  }
  const std::string lower = LowerCase(node.text);
  if (node.text == "true" || node.text == "false") {
    node.kind = YamlNode::Kind::kBool;
  } else if (IsJsonNumber(node.text)) {
    node.kind = YamlNode::Kind::kNumber;
  } else if (constexpr std::array kWords = {"true", "false", "yes", "no", "on", "off", "y", "n"};
             std::find(kWords.begin(), kWords.end(), lower) != kWords.end()) {
    node.kind = YamlNode::Kind::kAmbiguous;
    node.complaint = "only true and false are truth values";
  } else if (std::string complaint = NumberComplaint(node.text); !complaint.empty()) {
    node.kind = YamlNode::Kind::kAmbiguous;
    node.complaint = std::move(complaint);
  } else {
    node.kind = YamlNode::Kind::kText;
  }
}

// Offset of the first byte that is not part of valid UTF-8 text without NUL and other control characters;
// npos when all is well.
std::size_t FindBadByte(std::string_view s) {
  std::size_t i = 0;
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(s[k]); };
  while (i < s.size()) {
    const unsigned lead = byte(i);
    if (lead < 0x80) {
      if ((lead < 0x20 && lead != '\t' && lead != '\n' && lead != '\r') || lead == 0x7F) return i;
      ++i;
      continue;
    }
    const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    if (lead < 0xC2 || lead > 0xF4 || i + length > s.size()) return i;
    unsigned code = lead & (0xFFU >> (length + 1));
    for (std::size_t k = 1; k < length; ++k) {
      if ((byte(i + k) & 0xC0U) != 0x80U) return i;
      code = (code << 6) | (byte(i + k) & 0x3FU);
    }
    constexpr std::array<unsigned, 5> kSmallest = {0, 0, 0x80, 0x800,
                                                   0x10000};  // by length: no overlong forms
    if (code < kSmallest[length] || code > 0x10FFFF || (code >= 0xD800 && code <= 0xDFFF)) return i;
    i += length;
  }
  return std::string_view::npos;
}

// The text by lines, to turn the library's byte columns into characters and to look at what stands at a
// place.
class SourceText {
 public:
  explicit SourceText(std::string_view text) : text_(text) {
    std::size_t begin = 0;
    while (true) {
      const std::size_t end = text.find('\n', begin);
      lines_.push_back(text.substr(begin, end == std::string_view::npos ? end : end - begin));
      if (end == std::string_view::npos) break;
      begin = end + 1;
    }
  }

  YamlMark At(std::size_t line, std::size_t column_bytes) {
    if (line >= lines_.size()) return {static_cast<int>(lines_.size()), 1};
    // Places mostly ascend: counting on from the last one keeps a long line from costing quadratic time.
    if (line != counted_line_ || column_bytes < counted_bytes_) counted_bytes_ = counted_characters_ = 0;
    const std::string_view before = lines_[line].substr(0, column_bytes);
    counted_characters_ += CharacterCount(before.substr(std::min(counted_bytes_, before.size())));
    counted_bytes_ = before.size();
    counted_line_ = line;
    return {static_cast<int>(line) + 1, static_cast<int>(counted_characters_) + 1};
  }
  YamlMark At(const YAML::Mark& mark) {
    if (mark.line < 0 || mark.column < 0) return {};
    return At(static_cast<std::size_t>(mark.line), static_cast<std::size_t>(mark.column));
  }
  // The text from there to its end.
  std::string_view From(const YAML::Mark& mark) const {
    if (mark.line < 0 || mark.column < 0 || static_cast<std::size_t>(mark.line) >= lines_.size()) return {};
    const std::string_view line = lines_[static_cast<std::size_t>(mark.line)];
    const auto line_begin = static_cast<std::size_t>(line.data() - text_.data());
    return text_.substr(line_begin + std::min(line.size(), static_cast<std::size_t>(mark.column)));
  }
  // The first tab in the indentation of a line, up to this one.
  std::optional<YamlMark> TabUpTo(const YAML::Mark& mark) {
    for (std::size_t line = 0; line < lines_.size() && static_cast<int>(line) <= mark.line; ++line) {
      const std::size_t tab = lines_[line].find('\t');
      if (tab != std::string_view::npos &&
          lines_[line].find_first_not_of(" \t\r") != std::string_view::npos &&
          lines_[line].find_first_not_of(' ') == tab)
        return At(line, tab);
    }
    return std::nullopt;
  }

 private:
  std::string_view text_;
  std::vector<std::string_view> lines_;
  std::size_t counted_line_ = 0, counted_bytes_ = 0, counted_characters_ = 0;
};

// True if the quoted scalar that begins here has its closing quote: the library takes the end of the file for
// one.
bool QuoteIsClosed(std::string_view text) {
  const char quote = text.front();
  for (std::size_t i = 1; i < text.size(); ++i) {
    if (quote == '"' && text[i] == '\\') {
      ++i;
    } else if (quote == '\'' && text.substr(i).starts_with("''")) {
      ++i;
    } else if (text[i] == quote) {
      return true;
    }
  }
  return false;
}

// Thrown out of the parser where reading on would be pointless.
struct Stop : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class TreeBuilder : public YAML::EventHandler {
 public:
  TreeBuilder(SourceText& source, std::vector<YamlProblem>& problems)
      : source_(source), problems_(problems) {}

  YamlNode TakeRoot() { return std::move(root_); }

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++document_count_ > 1) Halt(mark, "a second document begins here; a file holds one");
  }
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override {
    YamlNode node;
    node.mark = source_.At(mark);
    Add(mark, std::move(node));
  }

  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    Halt(mark, "aliases (*name) are not allowed; write the value out");
  }

  void OnAnchor(const YAML::Mark& mark, const std::string&) override {
    Complain(mark, "anchors (&name) are not allowed");
  }

  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t,
                const std::string& value) override {
    CheckTag(mark, tag);
    YamlNode node;
    node.mark = source_.At(mark);
    node.text = value;
    const std::string_view there = source_.From(mark);
    const bool quoted = tag == "!";
    const std::size_t skip = quoted ? 1 : 0;
    if ((there.starts_with('"') || there.starts_with('\'')) && !QuoteIsClosed(there))
      Halt(mark, "the quote is never closed");
    if (there.substr(std::min(skip, there.size())).starts_with(value)) {
      node.text_begin = YamlMark{node.mark.line, node.mark.column + static_cast<int>(skip)};
    }
    Classify(node, quoted);
    Add(mark, std::move(node));
  }

  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    Open(mark, tag, YamlNode::Kind::kSequence);
  }
  void OnSequenceEnd() override { Close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    Open(mark, tag, YamlNode::Kind::kMapping);
  }
  void OnMapEnd() override { Close(); }

 private:
  // A collection being read. A mapping's children arrive as key, value, key, value.
  struct Frame {
    YamlNode node;
    YAML::Mark mark;
    bool key_pending = false;
    std::string key;
    YamlMark key_mark;
    bool drop = false;  // the value of a duplicate key
  };

  void Complain(const YAML::Mark& mark, std::string message) {
    problems_.push_back({source_.At(mark), std::move(message)});
  }
  [[noreturn]] void Halt(const YAML::Mark& mark, std::string message) {
    Complain(mark, std::move(message));
    throw Stop("stopped");
  }

  // The library gives plain scalars and collections "?", quoted scalars "!"; the latter can also be written
  // out.
  void CheckTag(const YAML::Mark& mark, const std::string& tag) {
    if ((tag != "?" && tag != "!" && !tag.empty()) || source_.From(mark).starts_with('!')) {
      Complain(mark, "tags (!type) are not allowed");
    }
  }

  bool ExpectsKey() const {
    return !open_.empty() && open_.back().node.kind == YamlNode::Kind::kMapping && !open_.back().key_pending;
  }

  void Open(const YAML::Mark& mark, const std::string& tag, YamlNode::Kind kind) {
    CheckTag(mark, tag);
    if (ExpectsKey()) Halt(mark, "a key must be a plain word");
    if (open_.size() >= static_cast<std::size_t>(kYamlDepthMax))
      Halt(mark, fmt::format("nested deeper than {} levels", kYamlDepthMax));
    Frame frame;
    frame.node.kind = kind;
    frame.node.mark = source_.At(mark);
    frame.mark = mark;
    open_.push_back(std::move(frame));
  }

  void Close() {
    Frame frame = std::move(open_.back());
    open_.pop_back();
    Add(frame.mark, std::move(frame.node));
  }

  void Add(const YAML::Mark& mark, YamlNode node) {
    if (open_.empty()) {
      root_ = std::move(node);
      return;
    }
    Frame& parent = open_.back();
    if (parent.node.kind == YamlNode::Kind::kSequence) {
      parent.node.items.push_back(std::move(node));
      return;
    }
    if (!parent.key_pending) {
      if (node.kind == YamlNode::Kind::kNull) Halt(mark, "a key is missing");
      if (parent.node.entries.size() == kYamlKeysMax)
        Halt(mark, fmt::format("more than {} keys", kYamlKeysMax));
      parent.key_pending = true;
      parent.key = std::move(node.text);
      parent.key_mark = node.mark;
      const YamlEntry* first = parent.node.Find(parent.key);
      parent.drop = first != nullptr;
      if (first != nullptr) {
        Complain(mark, fmt::format("duplicate key '{}'; the first is on line {}", parent.key,
                                   first->key_mark.line));
      }
      return;
    }
    parent.key_pending = false;
    if (parent.drop) return;
    if (node.kind == YamlNode::Kind::kNull) node.mark = parent.key_mark;
    parent.node.entries.push_back({std::move(parent.key), parent.key_mark, std::move(node)});
  }

  SourceText& source_;
  std::vector<YamlProblem>& problems_;
  YamlNode root_;
  std::vector<Frame> open_;
  int document_count_ = 0;
};

}  // namespace

const YamlEntry* YamlNode::Find(std::string_view key) const {
  const auto found =
      std::find_if(entries.begin(), entries.end(), [&](const YamlEntry& e) { return e.key == key; });
  return found == entries.end() ? nullptr : &*found;
}

std::optional<double> YamlNode::Number() const {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (kind != Kind::kNumber || error != std::errc() || end != text.data() + text.size() ||
      !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::optional<std::int64_t> YamlNode::Integer() const {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (kind != Kind::kNumber || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<YamlNode> ParseYaml(std::string_view text, std::vector<YamlProblem>& problems) {
  if (text.size() > kYamlBytesMax) {
    problems.push_back({{}, fmt::format("larger than {} KiB", kYamlBytesMax / 1024)});
    return std::nullopt;
  }
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // some editors' byte-order mark
  SourceText source(text);
  if (const std::size_t bad = FindBadByte(text); bad != std::string_view::npos) {
    const std::size_t line_begin = bad == 0 ? 0 : text.rfind('\n', bad - 1) + 1;  // npos + 1 is 0
    const auto line = static_cast<std::size_t>(
        std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(bad), '\n'));
    problems.push_back(
        {source.At(line, bad - line_begin),
         fmt::format("byte 0x{:02X} is not UTF-8 text", static_cast<unsigned char>(text[bad]))});
    return std::nullopt;
  }
  TreeBuilder builder(source, problems);
  try {
    std::istringstream stream{std::string(text)};
    YAML::Parser parser(stream);
    if (!parser.HandleNextDocument(builder)) {
      problems.push_back({{}, "the file is empty"});
      return std::nullopt;
    }
    while (parser.HandleNextDocument(builder)) {
    }
  } catch (const Stop&) {
    return std::nullopt;
  } catch (const YAML::Exception& error) {
    if (const auto tab = source.TabUpTo(error.mark))
      problems.push_back({*tab, "a tab character: YAML is indented by spaces only"});
    else
      problems.push_back({source.At(error.mark), fmt::format("not valid YAML: {}", error.msg)});
    return std::nullopt;
  }
  return builder.TakeRoot();
}

std::size_t CharacterCount(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

std::string Describe(const YamlNode& node) {
  constexpr std::size_t kShown = 40;
  const std::string shown = node.text.size() > kShown ? node.text.substr(0, kShown) + "..." : node.text;
  switch (node.kind) {
    case YamlNode::Kind::kNull:
      return "nothing";
    case YamlNode::Kind::kBool:
      return shown;
    case YamlNode::Kind::kNumber:
      return fmt::format("the number {}", shown);
    case YamlNode::Kind::kText:
    case YamlNode::Kind::kAmbiguous:
      return fmt::format("'{}'", shown);
    case YamlNode::Kind::kSequence:
      return "a list";
    case YamlNode::Kind::kMapping:
      return "a mapping";
  }
  return "something unknown";
}

const YamlNode* ValueOf(const YamlNode* mapping, std::string_view key) {
  const YamlEntry* entry = mapping == nullptr ? nullptr : mapping->Find(key);
  return entry == nullptr ? nullptr : &entry->value;
}

YamlMark PlaceOf(const YamlNode& mapping, std::string_view path) {
  const YamlNode* node = &mapping;
  while (!path.empty()) {
    const std::size_t dot = path.find('.');
    const YamlNode* next = ValueOf(node, path.substr(0, dot));
    if (next == nullptr) break;
    node = next;
    path = dot == std::string_view::npos ? std::string_view() : path.substr(dot + 1);
  }
  return node->mark;
}

}  // namespace tiltproof::harness
