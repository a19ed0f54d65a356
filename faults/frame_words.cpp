#include "faults/frame_words.h"

#include <optional>

#include "faults/text.h"

namespace tiltproof::faults {
namespace {

constexpr std::string_view kDigits = "0123456789abcdef";
constexpr std::size_t kQuotedMax = 24;

std::string Quoted(std::string_view word) {
  return Concat({"'", word.substr(0, kQuotedMax), word.size() > kQuotedMax ? "..." : "", "'"});
}

// Empty: the word is good, and its bytes are in `bytes`.
std::string ReadWord(std::string_view word, std::vector<std::uint8_t>& bytes) {
  if (word.empty()) return "is empty: words have single spaces between them, and none at the ends";
  if (word == "-") return {};
  if (const std::size_t bad = word.find_first_not_of(kDigits); bad != std::string_view::npos)
    return Concat({Quoted(word), " has '", word.substr(bad, 1), "' as character ", std::to_string(bad + 1),
                   ": a word is lower-case hexadecimal digits, or '-' for a frame that is left as it is"});
  if (word.size() % 2 != 0)
    return Concat({Quoted(word), " has ", std::to_string(word.size()), " digits: a byte is two of them"});
  for (std::size_t i = 0; i < word.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(kDigits.find(word[i]) << 4 | kDigits.find(word[i + 1])));
  return {};
}

}  // namespace

FrameWords ReadFrameWords(std::string_view text) {
  FrameWords words;
  for (std::size_t begin = 0; begin != std::string_view::npos;) {
    const std::size_t end = text.find(' ', begin);
    const std::string problem = ReadWord(text.substr(begin, end - begin), words.frames.emplace_back());
    if (!problem.empty()) return {{}, Concat({"word ", std::to_string(words.frames.size()), " ", problem})};
    begin = end == std::string_view::npos ? end : end + 1;
  }
  return words;
}

}  // namespace tiltproof::faults
