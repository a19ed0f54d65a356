// Recursive descent, one function per level of the grammar.
//
// A parenthesis may open a formula or a number, and only its inside tells which. So both kinds are parsed by
// one chain of levels, each operand knows its kind, and each operator checks it: no backtracking, linear
// time.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>
#include <vector>

#include "faults/nearest_name.h"
#include "harness/formula/formula.h"

namespace tiltproof::harness::stl {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }
bool IsWordStart(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool IsWordPart(char c) { return IsWordStart(c) || IsDigit(c); }
bool IsSpace(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

constexpr std::string_view kKeywords[] = {"always", "eventually", "until",       "not",   "and",
                                          "or",     "implies",    "true",        "false", "abs",
                                          "min",    "max",        "fault_active"};

struct Operand {
  Formula node;
  bool is_formula = false;     // else a number
  bool parenthesised = false;  // "until" wants its left side so
  std::size_t column = 0;      // where it begins
  std::size_t end = 0;         // position behind it
};

std::string Quoted(std::string_view text) { return std::string("'").append(text).append("'"); }

// The end of a message about an unknown name.
template <class Names>
std::string DidYouMean(std::string_view name, const Names& valid) {
  const std::vector<std::string_view> candidates(valid.begin(), valid.end());
  const std::string_view nearest = faults::NearestName(name, candidates);
  return nearest.empty() ? "" : "; did you mean " + Quoted(nearest) + "?";
}

class Parser {
 public:
  Parser(std::string_view text, const Vocabulary& vocabulary) : text_(text), vocabulary_(vocabulary) {}

  Formula ParseAll() {
    if (text_.size() > kFormulaLengthMax_bytes)
      throw ParseError(kFormulaLengthMax_bytes + 1,
                       "a formula has at most " + std::to_string(kFormulaLengthMax_bytes) + " bytes");
    const Operand formula = RequireFormula(ParseImplies());
    SkipSpace();
    if (position_ < text_.size()) FailExpected("'and', 'or', 'implies' or the end of the formula");
    return formula.node;
  }

 private:
  // Guards every way in which one level calls itself.
  class Nesting {
   public:
    explicit Nesting(Parser& parser) : parser_(parser) {
      if (++parser_.depth_ > kNestingMax_count)
        throw ParseError(parser_.Column(),
                         "nested deeper than " + std::to_string(kNestingMax_count) + " levels");
    }
    ~Nesting() { --parser_.depth_; }
    Nesting(const Nesting&) = delete;
    Nesting& operator=(const Nesting&) = delete;

   private:
    Parser& parser_;
  };

  // implies = or [ "implies" implies ]
  Operand ParseImplies() {
    const Operand left = ParseOr();
    if (!AcceptWord("implies")) return left;
    RequireFormula(left);
    const Nesting nesting(*this);
    return Combine(Op::kImplies, left, RequireFormula(ParseImplies()));
  }

  // or = and { "or" and }
  Operand ParseOr() {
    Operand left = ParseAnd();
    while (AcceptWord("or")) {
      RequireFormula(left);
      left = Combine(Op::kOr, left, RequireFormula(ParseAnd()));
    }
    return left;
  }

  // and = unary { "and" unary }
  Operand ParseAnd() {
    Operand left = ParseUnary();
    while (AcceptWord("and")) {
      RequireFormula(left);
      left = Combine(Op::kAnd, left, RequireFormula(ParseUnary()));
    }
    return left;
  }

  // unary = "not" unary | temporal | compare | "fault_active" "(" string ")" | "true" | "false"
  Operand ParseUnary() {
    SkipSpace();
    const std::size_t column = Column();
    if (AcceptWord("not")) {
      const Nesting nesting(*this);
      return MakeFormula(Op::kNot, column, RequireFormula(ParseUnary()).node);
    }
    if (AcceptWord("always")) return ParseTemporal(Op::kAlways, column);
    if (AcceptWord("eventually")) return ParseTemporal(Op::kEventually, column);
    if (AcceptWord("true")) return MakeFormula(Op::kTrue, column);
    if (AcceptWord("false")) return MakeFormula(Op::kFalse, column);
    if (AcceptWord("fault_active")) return ParseFaultActive(column);
    return ParseCompare();
  }

  void RefuseInOneRow(std::size_t column, std::string_view word) const {
    if (vocabulary_.of_one_row)
      throw ParseError(
          column,
          Quoted(word) + " looks at more than one row: only comparisons, 'and', 'or' and 'not' stand here");
  }

  // ("always" | "eventually") [ window ] "(" formula ")"
  Operand ParseTemporal(Op op, std::size_t column) {
    RefuseInOneRow(column, op == Op::kAlways ? "always" : "eventually");
    std::optional<Window> window;
    SkipSpace();
    if (Peek() == '[') window = ParseWindow();
    SkipSpace();
    if (Peek() != '(') FailExpected(window ? "'('" : "'[' or '('");
    return MakeFormula(op, column, ParseBracketed().node, nullptr, window);
  }

  // "(" formula ")"
  Operand ParseBracketed() {
    const Nesting nesting(*this);
    Expect('(');
    Operand inside = RequireFormula(ParseImplies());
    Expect(')');
    return inside;
  }

  // "[" number "," number "]"
  Window ParseWindow() {
    SkipSpace();
    const std::size_t column = Column();
    Expect('[');
    const double begin_s = ParseBound();
    Expect(',');
    const double end_s = ParseBound();
    Expect(']');
    if (begin_s > end_s) throw ParseError(column, "the window ends before it begins");
    return {FromSeconds(begin_s), FromSeconds(end_s)};
  }

  double ParseBound() {
    SkipSpace();
    const std::size_t column = Column();
    if (Peek() == '-') throw ParseError(column, "a window lies in the future: its bounds are not negative");
    if (!AtNumber()) FailExpected("a number of seconds");
    const double seconds = ParseNumber();
    if (seconds > kWindowMax_s) throw ParseError(column, "a window reaches at most 1000000 s ahead");
    return seconds;
  }

  // "fault_active" "(" string ")"
  Operand ParseFaultActive(std::size_t column) {
    RefuseInOneRow(column, "fault_active");
    Expect('(');
    SkipSpace();
    const std::size_t string_column = Column();
    if (Peek() != '"') FailExpected("a fault's id in double quotes");
    const std::size_t begin = position_ + 1;
    const std::size_t end = text_.find('"', begin);
    if (end == std::string_view::npos) throw ParseError(string_column, "the text's closing '\"' is missing");
    const std::string_view id = text_.substr(begin, end - begin);
    position_ = end + 1;
    Expect(')');
    if (!IsFault(id))
      throw ParseError(string_column,
                       "the scenario has no fault " + Quoted(id) + DidYouMean(id, vocabulary_.fault_ids));
    return Make({.op = Op::kFaultActive, .name = std::string(id)}, true, column);
  }

  // compare = sum ("<=" | "<" | ">=" | ">") sum; also "(" formula ")" [ "until" window "(" formula ")" ],
  // which begins alike.
  Operand ParseCompare() {
    const Operand left = ParseSum();
    if (left.is_formula) {
      SkipSpace();
      const std::size_t operator_column = Column();
      if (left.parenthesised && AcceptWord("until")) {
        RefuseInOneRow(operator_column, "until");
        SkipSpace();
        if (Peek() != '[') FailExpected("'['");
        const Window window = ParseWindow();
        return MakeFormula(Op::kUntil, left.column, left.node, ParseBracketed().node, window);
      }
      if (PeekComparison()) throw ParseError(left.column, "expected a number to compare, found a formula");
      return left;
    }
    const std::optional<Op> op = AcceptComparison();
    if (!op) return left;  // a number in parentheses, or a mistake that the caller reports
    const Operand right = RequireNumber(ParseSum());
    SkipSpace();
    if (PeekComparison()) throw ParseError(Column(), "comparisons do not chain: write 'a <= b and b <= c'");
    return Combine(*op, left, right);
  }

  // sum = product { ("+"|"-") product }
  Operand ParseSum() {
    Operand left = ParseProduct();
    for (;;) {
      SkipSpace();
      const char c = Peek();
      if (c != '+' && c != '-') return left;
      RequireNumber(left);
      ++position_;
      left = Combine(c == '+' ? Op::kAdd : Op::kSubtract, left, RequireNumber(ParseProduct()), false);
    }
  }

  // product = atom { ("*"|"/") atom }
  Operand ParseProduct() {
    Operand left = ParseAtom();
    for (;;) {
      SkipSpace();
      const char c = Peek();
      if (c != '*' && c != '/') return left;
      RequireNumber(left);
      ++position_;
      left = Combine(c == '*' ? Op::kMultiply : Op::kDivide, left, RequireNumber(ParseAtom()), false);
    }
  }

  // atom = number | signal | "abs" "(" sum ")" | "min"/"max" "(" sum "," sum ")" | "-" atom | "(" sum ")"
  Operand ParseAtom() {
    const Nesting nesting(*this);
    SkipSpace();
    const std::size_t column = Column();
    if (Peek() == '(') {
      ++position_;
      Operand inside = ParseImplies();
      Expect(')');
      inside.parenthesised = true;
      inside.column = column;
      inside.end = position_;
      return inside;
    }
    if (Peek() == '-') {
      ++position_;
      return MakeNumber({.op = Op::kNegate, .left = RequireNumber(ParseAtom()).node}, column);
    }
    if (AtNumber()) return MakeNumber({.op = Op::kNumber, .number = ParseNumber()}, column);
    if (AcceptWord("abs")) {
      Expect('(');
      const Operand operand = RequireNumber(ParseSum());
      Expect(')');
      return MakeNumber({.op = Op::kAbs, .left = operand.node}, column);
    }
    if (AcceptWord("min")) return ParseExtremum(Op::kMin, column);
    if (AcceptWord("max")) return ParseExtremum(Op::kMax, column);
    return ParseSignal(column);
  }

  // "(" sum "," sum ")"
  Operand ParseExtremum(Op op, std::size_t column) {
    Expect('(');
    const Operand left = RequireNumber(ParseSum());
    Expect(',');
    const Operand right = RequireNumber(ParseSum());
    Expect(')');
    return MakeNumber({.op = op, .left = left.node, .right = right.node}, column);
  }

  Operand ParseSignal(std::size_t column) {
    const std::string_view word = PeekWord();
    if (word.empty()) FailExpected("a number, a signal or a formula");
    for (const std::string_view keyword : kKeywords)
      if (word == keyword) FailExpected("a number, a signal or a formula");
    position_ += word.size();
    if (IsSignal(word)) return MakeNumber({.op = Op::kSignal, .name = std::string(word)}, column);
    SkipSpace();
    if (Peek() == '(' || Peek() == '[') {
      constexpr std::array<std::string_view, 7> functions = {"always", "eventually", "not",         "abs",
                                                             "min",    "max",        "fault_active"};
      throw ParseError(column, "unknown operator " + Quoted(word) + DidYouMean(word, functions));
    }
    const std::string meant = DidYouMean(word, vocabulary_.signals);
    throw ParseError(column, "unknown signal " + Quoted(word) + (meant.empty() ? "; " : meant + " ") +
                                 "all signals: tiltproof list --signals");
  }

  bool IsFault(std::string_view id) const {
    return vocabulary_.any_name || std::find(vocabulary_.fault_ids.begin(), vocabulary_.fault_ids.end(),
                                             id) != vocabulary_.fault_ids.end();
  }
  // A flight's trace also has a column active_<id> for each fault.
  bool IsSignal(std::string_view word) const {
    if (vocabulary_.any_name ||
        std::find(vocabulary_.signals.begin(), vocabulary_.signals.end(), word) != vocabulary_.signals.end())
      return true;
    return word.starts_with(kActivePrefix) && IsFault(word.substr(kActivePrefix.size()));
  }

  // number = digits [ "." digits ] [ exponent ], also ".5" and "5."
  bool AtNumber() const {
    return IsDigit(Peek()) ||
           (Peek() == '.' && position_ + 1 < text_.size() && IsDigit(text_[position_ + 1]));
  }

  double ParseNumber() {
    const std::size_t column = Column();
    const char* const begin = text_.data() + position_;
    const char* const end = text_.data() + text_.size();
    double value = 0.0;
    const auto [rest, error] = std::from_chars(begin, end, value);
    const std::string_view digits(begin, static_cast<std::size_t>(rest - begin));
    if (error != std::errc() || !std::isfinite(value))
      throw ParseError(column,
                       "the number " + std::string(digits) + " is too large or too small for binary64");
    position_ += digits.size();
    if (IsWordPart(Peek()) || Peek() == '.')
      throw ParseError(Column(), "the number " + std::string(digits) + " runs into '" + Peek() + "'");
    return value;
  }

  std::size_t Column() const { return position_ + 1; }
  // '\0' at the end; a NUL in the text is no valid character either.
  char Peek() const { return position_ < text_.size() ? text_[position_] : '\0'; }
  void SkipSpace() {
    while (position_ < text_.size() && IsSpace(text_[position_])) ++position_;
  }

  std::string_view PeekWord() const {
    if (!IsWordStart(Peek())) return {};
    std::size_t end = position_;
    while (end < text_.size() && IsWordPart(text_[end])) ++end;
    return text_.substr(position_, end - position_);
  }

  bool AcceptWord(std::string_view word) {
    SkipSpace();
    if (PeekWord() != word) return false;
    position_ += word.size();
    return true;
  }

  void Expect(char c) {
    SkipSpace();
    if (Peek() != c) FailExpected(Quoted(std::string_view(&c, 1)));
    ++position_;
  }

  bool PeekComparison() const { return Peek() == '<' || Peek() == '>'; }
  std::optional<Op> AcceptComparison() {
    SkipSpace();
    if (!PeekComparison()) return std::nullopt;
    const bool less = Peek() == '<';
    ++position_;
    const bool or_equal = Peek() == '=';
    if (or_equal) ++position_;
    if (less) return or_equal ? Op::kLessEqual : Op::kLess;
    return or_equal ? Op::kGreaterEqual : Op::kGreater;
  }

  // A number where a formula must be: what comes next should have been a comparison.
  const Operand& RequireFormula(const Operand& operand) {
    if (operand.is_formula) return operand;
    position_ = operand.end;
    SkipSpace();
    FailExpected("a comparison (<=, <, >= or >)");
  }
  const Operand& RequireNumber(const Operand& operand) {
    if (operand.is_formula) throw ParseError(operand.column, "expected a number, found a formula");
    return operand;
  }

  [[noreturn]] void FailExpected(const std::string& expected) const {
    std::string found = "the end of the formula";
    if (position_ < text_.size()) {
      const std::string_view word = PeekWord();
      const unsigned char c = static_cast<unsigned char>(Peek());
      if (!word.empty())
        found = Quoted(word);
      else if (c >= 0x20 && c < 0x7F)
        found = Quoted(text_.substr(position_, 1));
      else
        found = "byte " + std::to_string(c);
    }
    throw ParseError(Column(), "expected " + expected + ", found " + found);
  }

  Operand Make(Node node, bool is_formula, std::size_t column) const {
    return {std::make_shared<const Node>(std::move(node)), is_formula, false, column, position_};
  }
  Operand MakeNumber(Node node, std::size_t column) const { return Make(std::move(node), false, column); }
  Operand MakeFormula(Op op, std::size_t column, Formula left = nullptr, Formula right = nullptr,
                      std::optional<Window> window = std::nullopt) const {
    return Make({.op = op, .window = window, .left = std::move(left), .right = std::move(right)}, true,
                column);
  }
  Operand Combine(Op op, const Operand& left, const Operand& right, bool is_formula = true) const {
    return Make({.op = op, .left = left.node, .right = right.node}, is_formula, left.column);
  }

  std::string_view text_;
  Vocabulary vocabulary_;
  std::size_t position_ = 0;
  std::size_t depth_ = 0;
};

}  // namespace

Formula Parse(std::string_view text, const Vocabulary& vocabulary) {
  return Parser(text, vocabulary).ParseAll();
}

}  // namespace tiltproof::harness::stl
