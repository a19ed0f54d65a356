// A board for a firmware library under test: the host's side of firmware/tiltproof_client.h, keeping
// everything that was sent.
#pragma once

#include <dlfcn.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "firmware/tiltproof_client.h"
#include "link/time.h"
#include "tests/support/slow_codec.h"

namespace tiltproof::firmware {

using testing::Bytes;

// The payload of a message: 32-bit floats, little endian.
inline Bytes Payload(std::span<const float> values) {
  Bytes payload;
  for (const float value : values) {
    std::uint32_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    for (int byte = 0; byte < 4; ++byte) payload.push_back(static_cast<std::uint8_t>(bits >> (8 * byte)));
  }
  return payload;
}
inline Bytes Frame(std::span<const float> values) { return testing::SlowEncode(Payload(values)); }
inline Bytes Frame(std::initializer_list<float> values) {
  return Frame(std::span(values.begin(), values.size()));
}

// The floats of the only frame in `wire`; empty when there is none.
inline std::vector<float> FrameValues(const Bytes& wire) {
  std::vector<float> values;
  for (const testing::SlowEvent& event : testing::SlowDecode(wire)) {
    if (event.status != testing::SlowStatus::kAccepted) continue;
    values.resize(event.payload.size() / 4);
    std::memcpy(values.data(), event.payload.data(), values.size() * 4);
  }
  return values;
}

// The functions of a firmware's shared library. It stays loaded for the rest of the process.
struct ClientLibrary {
  explicit ClientLibrary(const char* file) : handle(dlopen(file, RTLD_NOW | RTLD_LOCAL)) {
    if (handle == nullptr) throw std::runtime_error(dlerror());
    Find("abi_version", abi_version);
    Find("create", create);
    Find("destroy", destroy);
    Find("start", start);
    Find("receive", receive);
    Find("grant", grant);
    Find("reset", reset);
    Find("status", status);
  }

  void* handle;
  decltype(&tiltproof_client_abi_version) abi_version = nullptr;
  decltype(&tiltproof_client_create) create = nullptr;
  decltype(&tiltproof_client_destroy) destroy = nullptr;
  decltype(&tiltproof_client_start) start = nullptr;
  decltype(&tiltproof_client_receive) receive = nullptr;
  decltype(&tiltproof_client_grant) grant = nullptr;
  decltype(&tiltproof_client_reset) reset = nullptr;
  decltype(&tiltproof_client_status) status = nullptr;  // may be missing

 private:
  template <class Function>
  void Find(const std::string& name, Function*& function) {
    function = reinterpret_cast<Function*>(dlsym(handle, ("tiltproof_client_" + name).c_str()));
  }
};

struct Sent {
  TimeNs time_ns;
  int uart;
  Bytes bytes;
  friend bool operator==(const Sent&, const Sent&) = default;
};

// One powered board. baud 0: a line without byte time.
class FakeBoard {
 public:
  FakeBoard(const ClientLibrary& library, const char* firmware, const char* dialect, std::int64_t baud = 0)
      : library_(library), baud_(baud) {
    host_ = {TILTPROOF_CLIENT_ABI_VERSION, firmware,        dialect, this,
             &FakeBoard::Transmit,         &FakeBoard::Log, nullptr, nullptr};
    client_ = library_.create(&host_);
    if (client_ == nullptr) throw std::runtime_error("the library refuses to be this firmware");
  }
  ~FakeBoard() { library_.destroy(client_); }
  FakeBoard(const FakeBoard&) = delete;
  FakeBoard& operator=(const FakeBoard&) = delete;

  TimeNs Start(TimeNs now) { return library_.start(client_, now); }
  TimeNs Reset(TimeNs now) { return library_.reset(client_, now); }
  TimeNs Grant(TimeNs now) { return library_.grant(client_, now); }
  // Bytes arrive and the firmware runs, as the harness does it.
  TimeNs Receive(TimeNs now, const Bytes& bytes, int uart = TILTPROOF_UART_MAIN) {
    library_.receive(client_, uart, now, bytes.data(), bytes.size());
    return Grant(now);
  }
  TiltproofClientStatus Status() const {
    TiltproofClientStatus status{};
    library_.status(client_, &status);
    return status;
  }

  // Returns what was sent since the last call.
  std::vector<Sent> TakeSent() { return std::exchange(sent_, {}); }
  const std::vector<std::string>& log() const { return log_; }

 private:
  static std::int64_t Transmit(void* context, int uart, std::int64_t now_ns, const std::uint8_t* bytes,
                               std::size_t count) {
    auto& board = *static_cast<FakeBoard*>(context);
    board.sent_.push_back({now_ns, uart, Bytes(bytes, bytes + count)});
    if (board.baud_ == 0) return now_ns;
    board.free_ns_ =
        std::max(board.free_ns_, now_ns) + static_cast<std::int64_t>(count) * 10 * kNsPerS / board.baud_;
    return board.free_ns_;
  }
  static void Log(void* context, std::int64_t, const char* text) {
    static_cast<FakeBoard*>(context)->log_.emplace_back(text);
  }

  const ClientLibrary& library_;
  const std::int64_t baud_;
  TimeNs free_ns_ = kPowerOn;
  TiltproofHost host_{};
  TiltproofClient* client_ = nullptr;
  std::vector<Sent> sent_;
  std::vector<std::string> log_;
};

}  // namespace tiltproof::firmware
