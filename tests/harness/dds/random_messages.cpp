#include "tests/harness/dds/random_messages.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string_view>
#include <type_traits>

#include "harness/dds/wire.h"

namespace tiltproof::dds {

double Random::Number() {
  switch (Below(8)) {
    case 0:
      return 0;
    case 1:
      return -std::numeric_limits<double>::infinity();
    case 2:
      return std::numeric_limits<double>::denorm_min();
    case 3:
      return std::numeric_limits<double>::max();
    default:
      return std::ldexp(static_cast<double>(Integer()), static_cast<int>(Below(200)) - 150);
  }
}

std::size_t Random::Count(std::size_t limit) {
  switch (Below(8)) {
    case 0:
      return 0;
    case 1:
      return limit;
    case 2:
      return 1;
    default:
      return Below(std::min<std::size_t>(limit, 10) + 1);
  }
}

std::string Random::Text(std::size_t bytes_max) {
  std::string text(Count(bytes_max), ' ');
  for (auto& c : text) c = static_cast<char>(1 + Below(255));
  return text;
}

std::vector<std::uint8_t> Random::Bytes(std::size_t count_max) {
  std::vector<std::uint8_t> bytes(Count(count_max));
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(Below(256));
  return bytes;
}

namespace {

// Limits beyond which a list makes the messages of a test large without testing more.
constexpr std::size_t kElementsMax = 30, kNumbersMax = 3000, kBytesMax = 60'000, kElementBytesMax = 2000;

// Visits the fields of a message with those of its struct on the wire, which know the limits of strings.
class Fill {
 public:
  Fill(Random& random, int index) : random_(random), index_(std::to_string(index) + "-") {}

  template <std::size_t kSize>
  void operator()(const char*, std::string& text, char (&)[kSize]) {
    const std::string unique = std::exchange(index_, "");  // of the first string, the key
    text = unique + random_.Text(kSize - 1 - unique.size());
  }
  void operator()(std::string_view name, std::int64_t& value, auto&) {
    value = name == "sequence" ? 1 : random_.Integer();  // logs refuse a sequence below 1
  }
  void operator()(const char*, double& value, auto&) { value = random_.Number(); }
  void operator()(const char*, bool& value, auto&) { value = random_.Below(2) == 1; }
  void operator()(const char*, std::uint8_t& value, auto&) {
    value = static_cast<std::uint8_t>(random_.Below(256));
  }
  template <class Enum>
  requires std::is_enum_v<Enum>
  void operator()(const char*, Enum& value, auto&) {
    value = static_cast<Enum>(random_.Below(static_cast<std::uint64_t>(LastOf(value)) + 1));
  }
  template <class T, std::size_t kMax, class Wire>
  void operator()(const char*, List<T, kMax>& list, Wire&) {
    if constexpr (std::is_same_v<T, std::uint8_t>) {
      list = random_.Bytes(std::min(kMax, in_element_ ? kElementBytesMax : kBytesMax));
    } else {
      list.resize(random_.Count(std::is_arithmetic_v<T> ? std::min(kMax, kNumbersMax)
                                : HasFields<T>          ? std::min(kMax, kElementsMax)
                                                        : kMax));
      for (T& element : list) {
        std::remove_pointer_t<decltype(Wire::_buffer)> on_wire{};
        if constexpr (HasFields<T>) {
          in_element_ = true;
          T::Fields(*this, element, on_wire);
          in_element_ = false;
        } else {
          (*this)("", element, on_wire);
        }
      }
    }
  }

 private:
  Random& random_;
  std::string index_;
  bool in_element_ = false;
};

// Everything as long as it may be; of structs in a list only the last one, or a message would have hundreds of megabytes.
struct FillUp {
  template <std::size_t kSize>
  void operator()(const char*, std::string& text, char (&)[kSize]) {
    text = std::string(kSize - 1, 'x');
  }
  void operator()(std::string_view name, std::int64_t& value, auto&) {
    value = name == "sequence" ? 1 : std::numeric_limits<std::int64_t>::min();
  }
  void operator()(const char*, double& value, auto&) { value = 0.1; }
  void operator()(const char*, bool& value, auto&) { value = true; }
  void operator()(const char*, std::uint8_t& value, auto&) { value = 0x7E; }
  template <class Enum>
  requires std::is_enum_v<Enum>
  void operator()(const char*, Enum& value, auto&) { value = LastOf(value); }
  template <class T, std::size_t kMax, class Wire>
  void operator()(const char*, List<T, kMax>& list, Wire&) {
    std::remove_pointer_t<decltype(Wire::_buffer)> on_wire{};
    T full{};
    if constexpr (HasFields<T>) {
      list.resize(kMax - 1);
      T::Fields(*this, full, on_wire);
      list.push_back(full);
    } else {
      (*this)("", full, on_wire);
      list.assign(kMax, full);
    }
  }
};

}  // namespace

template <class T>
T RandomMessage(Random& random, int index) {
  T message;
  auto wire = std::make_unique<typename WireOf<T>::Type>();
  T::Fields(Fill(random, index), message, *wire);
  return message;
}

template <class T>
T LargestMessage() {
  T message;
  auto wire = std::make_unique<typename WireOf<T>::Type>();
  T::Fields(FillUp(), message, *wire);
  return message;
}

#define TILTPROOF_INSTANTIATE(T, ...)            \
  template T RandomMessage(Random& random, int); \
  template T LargestMessage();
TILTPROOF_DDS_TOPICS(TILTPROOF_INSTANTIATE)

}  // namespace tiltproof::dds
