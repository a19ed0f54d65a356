// Messages as the bytes that DDS sends: CDR as of tiltproof.idl (little endian, XCDR version 1, of types that are final),
// with the four bytes before them that name this encoding. For logs: on the bus Cyclone DDS does this.
//
//   const std::string bytes = ToCdr(RunEvent{.kind = "start_accepted"});
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "link/fields.h"

namespace tiltproof::dds {

class CdrWriter {
 public:
  template <class T>
  requires std::is_arithmetic_v<T>
  void Put(T value) {
    while ((bytes_.size() - kHeadBytes) % sizeof value != 0) bytes_ += '\0';
    const auto raw = std::bit_cast<std::array<char, sizeof value>>(value);
    static_assert(std::endian::native == std::endian::little);
    bytes_.append(raw.data(), raw.size());
  }
  template <class T>
  requires std::is_enum_v<T>
  void Put(T value) { Put(static_cast<std::uint32_t>(value)); }
  // Up to its first NUL byte, which no string may have.
  void Put(std::string_view value) {
    value = value.substr(0, value.find('\0'));
    Put(static_cast<std::uint32_t>(value.size() + 1));
    bytes_ += value;
    bytes_ += '\0';
  }
  void Put(const std::string& value) { Put(std::string_view(value)); }
  template <class T>
  void Put(const std::vector<T>& values) {
    Put(static_cast<std::uint32_t>(values.size()));
    for (const T& value : values) Put(value);
  }
  template <HasFields T>
  void Put(const T& value) {
    static_assert(NamesEveryField<T>());
    T::Fields([this](const char*, const auto& field) { this->Put(field); }, value);
  }

  const std::string& bytes() const { return bytes_; }

 private:
  static constexpr std::size_t kHeadBytes = 4;
  std::string bytes_{"\x00\x01\x00\x00", kHeadBytes};
};

template <HasFields T>
std::string ToCdr(const T& message) {
  CdrWriter writer;
  writer.Put(message);
  return writer.bytes();
}

// The text of tiltproof.idl.
std::string_view IdlText();

}  // namespace tiltproof::dds
