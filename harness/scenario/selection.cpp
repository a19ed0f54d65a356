#include "harness/scenario/selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

constexpr int kNestingMax = 100;

std::string Lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

bool IsScenarioFile(const fs::path& path) {
  return path.extension() == ".yaml" || path.extension() == ".yml";
}

}  // namespace

std::vector<fs::path> FindScenarios(const std::vector<fs::path>& paths) {
  std::vector<fs::path> found;
  std::set<fs::path> seen;
  const auto add = [&](const fs::path& file) {
    if (seen.insert(fs::weakly_canonical(file)).second) found.push_back(file);
  };
  for (const fs::path& path : paths) {
    std::error_code error;
    if (fs::is_directory(path, error)) {
      std::vector<fs::path> inside;
      for (auto entry = fs::recursive_directory_iterator(path); entry != fs::recursive_directory_iterator();
           ++entry) {
        // A run's results hold resolved scenarios; they are not the user's.
        if (entry->is_directory() && fs::exists(entry->path() / "run.json"))
          entry.disable_recursion_pending();
        if (entry->is_regular_file() && IsScenarioFile(entry->path())) inside.push_back(entry->path());
      }
      std::sort(inside.begin(), inside.end());
      std::for_each(inside.begin(), inside.end(), add);
    } else if (fs::is_regular_file(path, error)) {
      add(path);
    } else {
      throw std::invalid_argument(fmt::format("{}: no such file or folder", path.string()));
    }
  }
  return found;
}

std::string SuiteName(const std::vector<fs::path>& paths) {
  std::vector<std::string> names;
  for (const fs::path& path : paths) {
    std::error_code error;
    fs::path whole = fs::weakly_canonical(path, error);
    if (error) whole = fs::absolute(path).lexically_normal();
    const bool is_folder = fs::is_directory(whole, error);
    names.push_back(is_folder ? whole.filename().string() : whole.stem().string());
    if (names.back().empty()) names.back() = "root";  // of "/"
  }
  // It becomes part of a folder's name.
  constexpr std::size_t kSuiteNameMax = 80;
  const std::string joined = fmt::format("{}", fmt::join(names, "+"));
  if (joined.size() <= kSuiteNameMax) return joined;
  return fmt::format("{}-and-{}-more", names.front().substr(0, kSuiteNameMax), names.size() - 1);
}

// A word, or an operator on the nodes below it: `not` has one, `and` and `or` have two or more.
struct Selection::Node {
  enum class Op { kWord, kNot, kAnd, kOr };
  Op op = Op::kWord;
  std::string word;
  std::vector<Node> operands;

  bool Holds(const std::vector<std::string>& texts) const {
    const auto holds = [&](const Node& node) { return node.Holds(texts); };
    switch (op) {
      case Op::kWord:
        return std::any_of(texts.begin(), texts.end(),
                           [&](const auto& text) { return text.find(word) != std::string::npos; });
      case Op::kNot:
        return !operands.front().Holds(texts);
      case Op::kAnd:
        return std::all_of(operands.begin(), operands.end(), holds);
      case Op::kOr:
        return std::any_of(operands.begin(), operands.end(), holds);
    }
    return false;
  }
};

namespace {

class ExpressionParser {
 public:
  using Node = Selection::Node;

  explicit ExpressionParser(std::string_view text) : text_(text) { Advance(); }

  Node Parse() {
    Node node = ParseOr();
    if (!token_.empty()) Fail(fmt::format("expected 'and', 'or' or the end, found '{}'", token_));
    return node;
  }

 private:
  [[noreturn]] void Fail(const std::string& message) const {
    throw std::invalid_argument(fmt::format("column {}: {}", token_begin_ + 1, message));
  }

  // Next word or parenthesis; empty at the end.
  void Advance() {
    while (position_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[position_])) != 0)
      ++position_;
    token_begin_ = position_;
    const auto is_end = [&](char c) {
      return std::isspace(static_cast<unsigned char>(c)) != 0 || c == '(' || c == ')';
    };
    while (position_ < text_.size() && !is_end(text_[position_])) ++position_;
    if (position_ == token_begin_ && position_ < text_.size()) ++position_;  // a parenthesis
    token_ = text_.substr(token_begin_, position_ - token_begin_);
  }

  Node ParseOr() {
    return ParseChain("or", Node::Op::kOr,
                      [&] { return ParseChain("and", Node::Op::kAnd, [&] { return ParseNot(); }); });
  }

  template <class ParseOperand>
  Node ParseChain(std::string_view word, Node::Op op, ParseOperand parse_operand) {
    Node first = parse_operand();
    if (token_ != word) return first;
    Node chain;
    chain.op = op;
    chain.operands.push_back(std::move(first));
    while (token_ == word) {
      Advance();
      chain.operands.push_back(parse_operand());
    }
    return chain;
  }

  Node ParseNot() {
    if (++nesting_ > kNestingMax) Fail("nested too deep");
    Node node;
    if (token_ == "not") {
      Advance();
      node.op = Node::Op::kNot;
      node.operands.push_back(ParseNot());
    } else if (token_ == "(") {
      Advance();
      node = ParseOr();
      if (token_ != ")") Fail("expected ')'");
      Advance();
    } else if (token_.empty() || token_ == ")" || token_ == "and" || token_ == "or") {
      Fail(token_.empty() ? "expected a word" : fmt::format("expected a word, found '{}'", token_));
    } else {
      node.word = Lower(token_);
      Advance();
    }
    --nesting_;
    return node;
  }

  std::string_view text_;
  std::size_t position_ = 0, token_begin_ = 0;
  std::string_view token_;
  int nesting_ = 0;
};

}  // namespace

Selection::Selection(std::string_view expression, std::string_view tag) : tag_(tag) {
  if (!expression.empty()) expression_ = std::make_shared<const Node>(ExpressionParser(expression).Parse());
}

bool Selection::Matches(const Scenario& scenario) const {
  if (!tag_.empty() && std::find(scenario.tags.begin(), scenario.tags.end(), tag_) == scenario.tags.end())
    return false;
  if (!expression_) return true;
  std::vector<std::string> texts = {Lower(scenario.name)};
  for (const auto& tag : scenario.tags) texts.push_back(Lower(tag));
  return expression_->Holds(texts);
}

}  // namespace tiltproof::harness
