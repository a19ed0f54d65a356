// Converts plain structs to bytes and back, for messages between processes of one build of this program.
//
// A struct takes part when it names its fields (link/fields.h):
//
//   Packer packer;  packer(event);  Send(packer.bytes());
//   Unpacker unpacker(bytes);  unpacker(event);   // throws std::runtime_error when the bytes are not such a struct
//
// Not a file format: both ends have the same byte order and the same structs.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "link/fields.h"
#include "link/time.h"

namespace tiltproof::harness {

template <class T>
concept Scalar = std::is_arithmetic_v<T> || std::is_enum_v<T>;
// A struct that says all by its type.
template <class T>
concept Empty = std::is_empty_v<T> && !HasFields<T>;
// A class that checks and keeps bytes.
template <class T>
concept MadeOfContent = requires(const T& value) {
  T(std::vector<std::uint8_t>(value.content()));
};

class Packer {
 public:
  template <class... Ts>
  void operator()(const Ts&... values) {
    (Put(values), ...);
  }
  std::span<const std::uint8_t> bytes() const {
    return {reinterpret_cast<const std::uint8_t*>(bytes_.data()), bytes_.size()};
  }
  // Removes and returns the first bytes.
  std::vector<std::uint8_t> Take(std::size_t size) {
    const auto first = bytes().first(size);
    std::vector<std::uint8_t> taken(first.begin(), first.end());
    bytes_.erase(0, size);
    return taken;
  }

 private:
  void Append(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }
  template <Scalar T>
  void Put(const T& value) {
    Append(&value, sizeof value);
  }
  void Put(BootTime time) { Put(time.ns()); }
  void Put(Origin origin) { Put(origin.boot_time()); }
  void Put(const std::string& text) {
    Put(text.size());
    Append(text.data(), text.size());
  }
  template <class T>
  void Put(const std::vector<T>& values) {
    Put(values.size());
    if constexpr (Scalar<T>) {
      Append(values.data(), values.size() * sizeof(T));
    } else {
      for (const T& value : values) Put(value);
    }
  }
  template <class T, std::size_t n>
  void Put(const std::array<T, n>& values) {
    for (const T& value : values) Put(value);
  }
  template <class T>
  void Put(const std::map<std::string, T>& values) {
    Put(values.size());
    for (const auto& [key, value] : values) {
      Put(key);
      Put(value);
    }
  }
  template <class T>
  void Put(const std::optional<T>& value) {
    Put(value.has_value());
    if (value) Put(*value);
  }
  template <class... Ts>
  void Put(const std::variant<Ts...>& value) {
    static_assert(sizeof...(Ts) < 256);
    Put(static_cast<std::uint8_t>(value.index()));
    std::visit([this](const auto& held) { this->Put(held); }, value);
  }
  template <HasFields T>
  void Put(const T& value) {
    static_assert(NamesEveryField<T>());
    T::Fields([this](const char*, const auto& field) { this->Put(field); }, value);
  }
  template <Empty T>
  void Put(const T& /*value*/) {}
  template <MadeOfContent T>
  void Put(const T& value) {
    Put(value.content());
  }

  std::string bytes_;
};

class Unpacker {
 public:
  explicit Unpacker(std::span<const std::uint8_t> bytes) : rest_(bytes) {}
  template <class... Ts>
  void operator()(Ts&... values) {
    (Get(values), ...);
  }
  template <class T>
  T Next() {
    T value{};
    Get(value);
    return value;
  }
  bool empty() const { return rest_.empty(); }

 private:
  const std::uint8_t* Take(std::size_t size) {
    if (size > rest_.size()) throw std::runtime_error("a message from another process is cut short");
    const std::uint8_t* at = rest_.data();
    rest_ = rest_.subspan(size);
    return at;
  }
  std::size_t GetCount(std::size_t bytes_each) {
    const auto count = Next<std::size_t>();
    if (count > rest_.size() / bytes_each)
      throw std::runtime_error("a message from another process is damaged");
    return count;
  }
  template <Scalar T>
  void Get(T& value) {
    std::memcpy(&value, Take(sizeof value), sizeof value);
  }
  void Get(bool& value) {
    // Another byte would be no bool at all.
    const std::uint8_t byte = *Take(1);
    if (byte > 1) throw std::runtime_error("a message from another process is damaged");
    value = byte == 1;
  }
  void Get(BootTime& time) { time = BootTime(Next<std::int64_t>()); }
  void Get(Origin& origin) { origin = Origin(Next<BootTime>()); }
  void Get(std::string& text) {
    const std::size_t size = GetCount(1);
    const std::uint8_t* at = Take(size);
    text.assign(at, at + size);
  }
  template <class T>
  void Get(std::vector<T>& values) {
    if constexpr (Scalar<T>) {
      values.resize(GetCount(sizeof(T)));
      const std::uint8_t* at = Take(values.size() * sizeof(T));
      if (!values.empty()) std::memcpy(values.data(), at, values.size() * sizeof(T));
    } else {
      // Element by element, so that a damaged count takes no more memory than the bytes that could fill it.
      values.clear();
      for (std::size_t left = GetCount(1); left > 0; --left) Get(values.emplace_back());
    }
  }
  template <class T, std::size_t n>
  void Get(std::array<T, n>& values) {
    for (T& value : values) Get(value);
  }
  template <class T>
  void Get(std::map<std::string, T>& values) {
    values.clear();
    for (std::size_t left = GetCount(1); left > 0; --left) {
      std::string key = Next<std::string>();
      Get(values[std::move(key)]);
    }
  }
  template <class T>
  void Get(std::optional<T>& value) {
    value.reset();
    if (Next<bool>()) Get(value.emplace());
  }
  template <class... Ts>
  void Get(std::variant<Ts...>& value) {
    const auto index = Next<std::uint8_t>();
    std::uint8_t i = 0;
    if (!((i++ == index && (Get(value.template emplace<Ts>()), true)) || ...))
      throw std::runtime_error("a message from another process is damaged");
  }
  template <HasFields T>
  void Get(T& value) {
    T::Fields([this](const char*, auto& field) { this->Get(field); }, value);
  }
  template <Empty T>
  void Get(T& /*value*/) {}
  template <MadeOfContent T>
  void Get(T& value) {
    value = T(Next<std::vector<std::uint8_t>>());
  }

  std::span<const std::uint8_t> rest_;
};

}  // namespace tiltproof::harness
