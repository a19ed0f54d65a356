#include "harness/dds/wire.h"

#include <concepts>
#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace tiltproof::dds {

static_assert(kIdBytesMax == tiltproof_ID_MAX && kPathBytesMax == tiltproof_PATH_MAX_BYTES &&
              kTextBytesMax == tiltproof_TEXT_MAX && kDocumentBytesMax == tiltproof_DOCUMENT_MAX &&
              kPayloadBytesMax == tiltproof_PAYLOAD_MAX && kChunkBytesMax == tiltproof_CHUNK_BYTES_MAX &&
              kNamesCountMax == tiltproof_NAMES_MAX && kChunksCountMax == tiltproof_CHUNKS_MAX &&
              kSignalsCountMax == tiltproof_SIGNALS_MAX && kNumbersCountMax == tiltproof_NUMBERS_MAX);
static_assert(static_cast<int>(NodeKind::kMonitor) == tiltproof_NODE_MONITOR &&
              static_cast<int>(Verb::kRelease) == tiltproof_VERB_RELEASE &&
              static_cast<int>(Phase::kFailed) == tiltproof_PHASE_FAILED);

namespace {

template <class M, class T>
concept Is = std::same_as<std::remove_const_t<M>, T>;
using NamedValue = std::pair<std::string, double>;

// The members of each struct, once for both directions: m is the message, c the struct on the wire.
#define ONE(member) v(#member, m.member, c.member)
#define LIST(member, count_max) v.List(#member, count_max, m.member, c.member)

void Members(auto& v, Is<Heartbeat> auto& m, auto& c) {
  ONE(node_id), ONE(kind), ONE(host), ONE(pid), ONE(sequence), ONE(run_id), ONE(version);
  LIST(capabilities, kNamesCountMax);
}
void Members(auto& v, Is<RunScenario> auto& m, auto& c) {
  ONE(run_id), ONE(scenario_yaml);
  LIST(nodes, kNamesCountMax), LIST(participants, kNamesCountMax);
}
void Members(auto& v, Is<Port> auto& m, auto& c) { ONE(name), ONE(path); }
void Members(auto& v, Is<RunCommand> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence), ONE(verb);
  LIST(ports, kNamesCountMax);
}
void Members(auto& v, Is<RunAck> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence), ONE(ok), ONE(text);
  LIST(ports, kNamesCountMax);
}
void Members(auto& v, Is<RunState> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(phase), ONE(time_ns), ONE(origin_ns), ONE(end_reason), ONE(text);
}
void Members(auto& v, Is<PlantState> auto& m, auto& c) {
  ONE(run_id), ONE(sequence), ONE(time_ns);
  LIST(state, kSignalsCountMax), LIST(in_force, kSignalsCountMax);
}
void Members(auto& v, Is<Reference> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence), ONE(time_ns);
  LIST(values, kSignalsCountMax);
}
void Members(auto& v, Is<TapFrame> auto& m, auto& c) {
  ONE(begin_ns), ONE(direction), ONE(delivered);
  LIST(bytes, kChunkBytesMax), LIST(fault_ids, kNamesCountMax);
}
void Members(auto& v, Is<SerialTap> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence);
  LIST(frames, kChunksCountMax), LIST(reply_latency_ns, kNumbersCountMax),
      LIST(client_round_trip_ns, kNumbersCountMax);
}
void Members(auto& v, Is<NamedValue> auto& m, auto& c) {
  v("name", m.first, c.name), v("value", m.second, c.value);
}
void Members(auto& v, Is<FaultCommand> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence), ONE(fault_id), ONE(type), ONE(duration_ns);
  LIST(parameters, kNamesCountMax);
}
void Members(auto& v, Is<Chunk> auto& m, auto& c) {
  ONE(begin_ns);
  LIST(bytes, kChunkBytesMax);
}
void Members(auto& v, Is<FaultActivation> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence), ONE(fault_id), ONE(time_ns), ONE(what);
  LIST(before, kChunksCountMax), LIST(after, kChunksCountMax);
}
void Members(auto& v, Is<RunEvent> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence), ONE(time_ns), ONE(kind), ONE(text);
}
void Members(auto& v, Is<TraceRows> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence), ONE(column_count);
  LIST(values, kNumbersCountMax), LIST(request_times_ns, kNumbersCountMax);
  LIST(actuator_times_ns, kNumbersCountMax);
}
void Members(auto& v, Is<NodeReport> auto& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(serial_tap), ONE(fault_activation), ONE(run_event), ONE(trace_rows);
  LIST(payload, kPayloadBytesMax);
}
void Members(auto& v, Is<Score> auto& m, auto& c) {
  ONE(run_id), ONE(scenario), ONE(verdict), ONE(reason), ONE(metrics_json);
}
template <class M>
requires(Is<M, StepRequest> || Is<M, StepResponse>) void Members(auto& v, M& m, auto& c) {
  ONE(run_id), ONE(node_id), ONE(sequence);
  LIST(payload, kPayloadBytesMax);
}
#undef ONE
#undef LIST

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

  template <class From, class To>
  void List(const char* name, std::size_t count_max, const std::vector<From>& from, To& to) {
    using Element = std::remove_reference_t<decltype(*to._buffer)>;
    if (from.size() > count_max) Refuse(name, from.size(), "elements", count_max);
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
            Members(*this, from[i], elements[static_cast<std::ptrdiff_t>(i)]);
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
  template <class To, class From>
  void List(const char*, std::size_t, std::vector<To>& to, const From& from) {
    if constexpr (std::is_arithmetic_v<To>) {
      if (from._length == 0) return to.clear();
      to.assign(from._buffer, from._buffer + from._length);
    } else {
      to.resize(from._length);
      for (std::size_t i = 0; i < to.size(); ++i) {
        if constexpr (std::is_same_v<To, std::string>) {
          to[i] = from._buffer[i];
        } else {
          Members(*this, to[i], std::as_const(from._buffer[i]));
        }
      }
    }
  }
};

}  // namespace

template <class T>
void Pack(const T& from, typename WireOf<T>::Type& to, Arena& arena) {
  Packer packer(arena);
  Members(packer, from, to);
}

template <class T>
void Unpack(const typename WireOf<T>::Type& from, T& to) {
  Unpacker unpacker;
  Members(unpacker, to, from);
}

#define TILTPROOF_INSTANTIATE(T)                                   \
  template void Pack(const T&, typename WireOf<T>::Type&, Arena&); \
  template void Unpack(const typename WireOf<T>::Type&, T&);
TILTPROOF_DDS_TOPICS(TILTPROOF_INSTANTIATE)
#undef TILTPROOF_INSTANTIATE

}  // namespace tiltproof::dds
