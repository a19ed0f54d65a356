#include "firmware/ports/host/json.h"

#include <utility>

namespace tiltproof::firmware {
namespace {

constexpr int kDepthMax = 32;

class Parser {
 public:
  explicit Parser(std::string_view text) : rest_(text) {}

  std::optional<Json> Whole() {
    Json value;
    if (!Value(value, 0)) return std::nullopt;
    SkipSpace();
    if (!rest_.empty()) return std::nullopt;
    return value;
  }

 private:
  void SkipSpace() {
    const std::size_t begin = rest_.find_first_not_of(" \n\t\r");
    rest_.remove_prefix(begin == std::string_view::npos ? rest_.size() : begin);
  }
  bool Skip(char expected) {
    SkipSpace();
    if (!rest_.starts_with(expected)) return false;
    rest_.remove_prefix(1);
    return true;
  }

  bool Value(Json& value, int depth) {
    SkipSpace();
    if (rest_.empty() || depth > kDepthMax) return false;
    if (rest_.front() == '{' || rest_.front() == '[') return Members(value, depth);
    if (rest_.front() == '"') {
      value.kind = Json::Kind::kString;
      return String(value.text);
    }
    value.text = rest_.substr(0, rest_.find_first_of(" \n\t\r,:]}"));
    rest_.remove_prefix(value.text.size());
    if (value.text == "null") return true;
    value.kind = value.text == "true" || value.text == "false" ? Json::Kind::kBool : Json::Kind::kNumber;
    return value.kind == Json::Kind::kBool || value.As<double>();
  }

  // An array, or an object.
  bool Members(Json& value, int depth) {
    const bool is_object = rest_.front() == '{';
    const char end = is_object ? '}' : ']';
    value.kind = is_object ? Json::Kind::kObject : Json::Kind::kArray;
    rest_.remove_prefix(1);
    if (Skip(end)) return true;
    do {
      if (is_object) {
        SkipSpace();
        if (!String(value.keys.emplace_back()) || !Skip(':')) return false;
      }
      if (!Value(value.items.emplace_back(), depth + 1)) return false;
    } while (Skip(','));
    return Skip(end);
  }

  bool String(std::string& text) {
    if (!rest_.starts_with('"')) return false;
    for (std::size_t i = 1; i < rest_.size(); ++i) {
      if (rest_[i] == '"') {
        rest_.remove_prefix(i + 1);
        return true;
      }
      if (rest_[i] == '\\' && i + 1 < rest_.size() && (rest_[i + 1] == '"' || rest_[i + 1] == '\\')) ++i;
      text += rest_[i];
    }
    return false;
  }

  std::string_view rest_;
};

}  // namespace

const Json* Json::Find(std::string_view key) const {
  for (std::size_t i = 0; i < keys.size(); ++i)
    if (keys[i] == key) return &items[i];
  return nullptr;
}

std::string_view Json::TextAt(std::string_view key) const {
  const Json* value = Find(key);
  return value != nullptr && value->kind == Kind::kString ? std::string_view(value->text)
                                                          : std::string_view();
}

bool Json::IsTrueAt(std::string_view key) const {
  const Json* value = Find(key);
  return value != nullptr && value->kind == Kind::kBool && value->text == "true";
}

std::optional<Json> ParseJson(std::string_view text) { return Parser(text).Whole(); }

}  // namespace tiltproof::firmware
