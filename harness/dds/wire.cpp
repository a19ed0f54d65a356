#include "harness/dds/wire.h"

#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "link/check.h"

namespace tiltproof::dds {

static_assert(kIdBytesMax == tiltproof_ID_MAX && kPathBytesMax == tiltproof_PATH_MAX_BYTES &&
              kTextBytesMax == tiltproof_TEXT_MAX && kDocumentBytesMax == tiltproof_DOCUMENT_MAX &&
              kPayloadBytesMax == tiltproof_PAYLOAD_MAX && kChunkBytesMax == tiltproof_CHUNK_BYTES_MAX &&
              kNamesCountMax == tiltproof_NAMES_MAX && kChunksCountMax == tiltproof_CHUNKS_MAX &&
              kSignalsCountMax == tiltproof_SIGNALS_MAX && kNumbersCountMax == tiltproof_NUMBERS_MAX);
static_assert(static_cast<int>(NodeKind::kLine) == tiltproof_NODE_LINE &&
              static_cast<int>(Verb::kInject) == tiltproof_VERB_INJECT &&
              static_cast<int>(Phase::kFailed) == tiltproof_PHASE_FAILED);

namespace {

// Each field of a message, with the field of that name on the wire.
template <class Visitor, class A, class B>
void EachField(Visitor& visitor, A& a, B& b) {
  static_assert(NamesEveryField<std::remove_const_t<A>>());
  A::Fields(visitor, a, b);
}

class Packer {
 public:
  explicit Packer(Arena& arena) : arena_(arena) {}

  template <std::size_t kSize>
  void operator()(const char* name, const std::string& from, char (&to)[kSize]) {
    if (from.size() >= kSize) Refuse(name, from.size(), "bytes", kSize - 1);
    if (from.find('\0') != std::string::npos) {
      throw std::invalid_argument(std::string(name) + ": holds a NUL byte, which no string may");
    }
    std::memcpy(to, from.c_str(), from.size() + 1);
  }
  template <class From, class To>
  requires(std::is_arithmetic_v<From> || std::is_enum_v<From>) void operator()(const char*, const From& from,
                                                                               To& to) {
    to = static_cast<To>(from);
  }

  template <class From, std::size_t kCountMax, class To>
  void operator()(const char* name, const List<From, kCountMax>& from, To& to) {
    using Element = std::remove_reference_t<decltype(*to._buffer)>;
    if (from.size() > kCountMax) Refuse(name, from.size(), "elements", kCountMax);
    to = {};
    to._maximum = to._length = static_cast<std::uint32_t>(from.size());
    if (from.empty()) return;
    if constexpr (std::is_arithmetic_v<From>) {
      static_assert(sizeof(From) == sizeof(Element));
      to._buffer = const_cast<Element*>(from.data());  // DDS only reads it
    } else {
      auto elements = std::make_shared<Element[]>(from.size());
      for (std::size_t i = 0; i < from.size(); ++i) {
        try {
          if constexpr (std::is_same_v<From, std::string>) {
            (*this)("text", from[i], elements[static_cast<std::ptrdiff_t>(i)]);
          } else {
            EachField(*this, from[i], elements[static_cast<std::ptrdiff_t>(i)]);
          }
        } catch (const std::invalid_argument& error) {
          throw std::invalid_argument(std::string(name) + "[" + std::to_string(i) + "]." + error.what());
        }
      }
      to._buffer = elements.get();
      arena_.push_back(std::move(elements));
    }
  }

 private:
  [[noreturn]] static void Refuse(const char* name, std::size_t count, const char* of, std::size_t max) {
    throw std::invalid_argument(std::string(name) + ": " + std::to_string(count) + " " + of + ", at most " +
                                std::to_string(max) + " can be sent");
  }
  Arena& arena_;
};

class Unpacker {
 public:
  void operator()(const char*, std::string& to, const char* from) { to = from; }
  template <class To, class From>
  requires(std::is_arithmetic_v<To> || std::is_enum_v<To>) void operator()(const char*, To& to,
                                                                           const From& from) {
    to = static_cast<To>(from);
  }
  template <class To, std::size_t kCountMax, class From>
  void operator()(const char*, List<To, kCountMax>& to, const From& from) {
    if constexpr (std::is_arithmetic_v<To>) {
      if (from._length == 0) return to.clear();
      Check(from._buffer != nullptr && from._length <= kCountMax, "a list from the bus has its elements");
      to.assign(from._buffer, from._buffer + from._length);
    } else {
      Check(from._length <= kCountMax && (from._length == 0 || from._buffer != nullptr),
            "a list from the bus has its elements");
      to.resize(from._length);
      for (std::size_t i = 0; i < to.size(); ++i) {
        if constexpr (std::is_same_v<To, std::string>) {
          to[i] = from._buffer[i];
        } else {
          EachField(*this, to[i], std::as_const(from._buffer[i]));
        }
      }
    }
  }
};

}  // namespace

template <class T>
void Pack(const T& from, typename WireOf<T>::Type& to, Arena& arena) {
  Packer packer(arena);
  EachField(packer, from, to);
}

template <class T>
void Unpack(const typename WireOf<T>::Type& from, T& to) {
  Unpacker unpacker;
  EachField(unpacker, to, from);
}

#define TILTPROOF_INSTANTIATE(T, ...)                              \
  template void Pack(const T&, typename WireOf<T>::Type&, Arena&); \
  template void Unpack(const typename WireOf<T>::Type&, T&);
TILTPROOF_DDS_TOPICS(TILTPROOF_INSTANTIATE)
#undef TILTPROOF_INSTANTIATE

}  // namespace tiltproof::dds
