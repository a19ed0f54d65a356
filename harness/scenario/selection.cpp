#include "harness/scenario/selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <map>
#include <set>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "harness/scenario/did_you_mean.h"
#include "harness/scenario/lower_case.h"

namespace tiltproof::harness {
namespace {

namespace fs = std::filesystem;

constexpr int kNestingMax = 100;

bool IsScenarioFile(const fs::path& path) {
  return path.extension() == ".yaml" || path.extension() == ".yml";
}

// A protocol file stands beside the scenarios that use it. Only such a file has this key at its top.
bool IsProtocolFile(const fs::path& path) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("protocol:")) return true;
  return false;
}

// Emacs marks a file that is being edited by a link of such a name, which leads nowhere.
bool IsEditorsLock(const fs::path& path) { return path.filename().string().starts_with(".#"); }

// The first part of the path that does not exist, with what is like it in the folder before it.
std::string MeantPath(const fs::path& path) {
  fs::path there, meant;
  std::error_code error;
  for (auto part = path.begin(); part != path.end(); ++part) {
    if (fs::exists(there / *part, error)) {
      there /= *part;
      continue;
    }
    std::vector<std::string> names;
    for (fs::directory_iterator entry(there.empty() ? "." : there, error), end; !error && entry != end;
         entry.increment(error))
      names.push_back(entry->path().filename().string());
    std::sort(names.begin(), names.end());
    const std::vector<std::string_view> valid(names.begin(), names.end());
    const std::string_view closest = ClosestName(part->string(), valid);
    if (closest.empty()) return {};
    meant = there / closest;
    for (++part; part != path.end() && fs::exists(meant / *part, error); ++part) meant /= *part;
    return fmt::format("; did you mean '{}'?", meant.string());
  }
  return {};
}

// Describes a path that is neither file nor folder.
std::string WhatItIs(const fs::path& path, fs::file_status status, std::error_code error) {
  std::error_code ignored;
  const bool is_link = fs::is_symlink(fs::symlink_status(path, ignored));
  if (error == std::errc::too_many_symbolic_link_levels) return "a link that leads back to itself";
  if (status.type() == fs::file_type::not_found && is_link)
    return fmt::format("a link to {}, which does not exist", fs::read_symlink(path, ignored).string());
  if (status.type() == fs::file_type::not_found) return "no such file or folder" + MeantPath(path);
  if (error) return fmt::format("cannot be read: {}", error.message());
  if (fs::is_fifo(status)) return "a FIFO, not a file";
  if (fs::is_socket(status)) return "a socket, not a file";
  return "a device, not a file";
}

bool IsWithin(const fs::path& inner, const fs::path& outer) {
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

class Finder {
 public:
  FoundScenarios found;

  // A path of the command line.
  void Take(const fs::path& path) {
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (fs::is_regular_file(status)) {
      Add(path, true);
    } else if (fs::is_directory(status)) {
      AddFolder(path);
    } else {
      found.problems.push_back(fmt::format("{}: {}", path.string(), WhatItIs(path, status, error)));
    }
  }

 private:
  void Add(const fs::path& file, bool named) {
    const auto [entry, is_new] = places_.try_emplace(fs::weakly_canonical(file), found.files.size());
    if (is_new)
      found.files.push_back({file, named});
    else
      found.files[entry->second].named |= named;
  }

  // Links after the tree that they are in, so that a file goes by its own name when both lead to it.
  void AddFolder(const fs::path& folder) {
    std::vector<fs::path> files, links;
    Search(folder, files, links);
    for (std::size_t i = 0; i < links.size(); ++i) Follow(fs::path(links[i]), files, links);
    std::sort(files.begin(), files.end());
    for (const fs::path& file : files) Add(file, false);
    searched_.clear();
  }

  void Follow(const fs::path& link, std::vector<fs::path>& files, std::vector<fs::path>& links) {
    if (IsWithin(fs::weakly_canonical(link.parent_path()), fs::weakly_canonical(link)))
      found.warnings.push_back(
          fmt::format("{}: not followed: a link to a folder that it is in", link.string()));
    else
      Search(link, files, links);
  }

  // Sorted, so that links are always followed in the same order.
  void Search(const fs::path& folder, std::vector<fs::path>& files, std::vector<fs::path>& links) {
    if (!searched_.insert(fs::weakly_canonical(folder)).second) return;
    std::error_code error;
    std::vector<fs::path> entries;
    for (auto entry = fs::directory_iterator(folder, error); !error && entry != fs::directory_iterator();
         entry.increment(error))
      entries.push_back(entry->path());
    if (error)
      found.problems.push_back(fmt::format("{}: cannot be read: {}", folder.string(), error.message()));
    std::sort(entries.begin(), entries.end());
    for (const fs::path& entry : entries) Sort(entry, files, links);
  }

  void Sort(const fs::path& entry, std::vector<fs::path>& files, std::vector<fs::path>& links) {
    std::error_code error, ignored;
    const fs::file_status status = fs::status(entry, error);
    const bool is_link = fs::is_symlink(fs::symlink_status(entry, ignored));
    if (fs::is_directory(status)) {
      if (fs::exists(entry / "run.json", ignored)) return;
      if (is_link)
        links.push_back(entry);
      else
        Search(entry, files, links);
    } else if (IsScenarioFile(entry) && fs::is_regular_file(status)) {
      if (!IsProtocolFile(entry)) files.push_back(entry);
    } else if (IsScenarioFile(entry) && !IsEditorsLock(entry)) {
      found.problems.push_back(fmt::format("{}: {}", entry.string(), WhatItIs(entry, status, error)));
    } else if (is_link && !fs::exists(status) && !IsEditorsLock(entry)) {
      found.warnings.push_back(
          fmt::format("{}: not followed: {}", entry.string(), WhatItIs(entry, status, error)));
    }
  }

  std::map<fs::path, std::size_t> places_;  // where each file stands in found.files, by its canonical path
  std::set<fs::path> searched_;             // folders below the present path
};

}  // namespace

std::vector<fs::path> FoundScenarios::Paths() const {
  std::vector<fs::path> paths;
  for (const File& file : files) paths.push_back(file.path);
  return paths;
}

FoundScenarios FindScenarios(const std::vector<fs::path>& paths) {
  Finder finder;
  for (const fs::path& path : paths) finder.Take(path);
  return std::move(finder.found);
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
      node.word = LowerCase(token_);
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
  std::vector<std::string> texts = {LowerCase(scenario.name)};
  for (const auto& tag : scenario.tags) texts.push_back(LowerCase(tag));
  return expression_->Holds(texts);
}

}  // namespace tiltproof::harness
