#include "tests/support/slow_codec.h"

#include <optional>

namespace tiltproof::testing {
namespace {

// A piece of the stream between flags, with its escapes undone.
struct Piece {
  Bytes data;
  bool escape_open = false;            // it ends in an escape that escapes nothing
  std::optional<std::size_t> surplus;  // position in the piece of the raw byte that is one too many
};

Piece Unescape(const Bytes& raw) {
  Piece piece;
  for (std::size_t i = 0; i < raw.size(); ++i) {
    int value = raw[i];
    if (value == 0x7D) {
      if (i + 1 == raw.size()) {
        piece.escape_open = true;
        break;
      }
      value = raw[++i] ^ 0x20;
    }
    piece.data.push_back(static_cast<std::uint8_t>(value));
    if (piece.data.size() == kSlowPayloadLimit + 3 && !piece.surplus) piece.surplus = i;
  }
  return piece;
}

Bytes Front(const Bytes& bytes, std::size_t count) {
  const std::size_t kept = count < bytes.size() ? count : bytes.size();
  return Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(kept));
}

// `raw` is not empty; `begin` is its opening flag's offset.
SlowEvent JudgePiece(const Bytes& raw, std::size_t begin, bool closed) {
  const Piece piece = Unescape(raw);
  const std::size_t end = begin + 1 + raw.size() + (closed ? 1 : 0);
  const Bytes shown = Front(piece.data, kSlowPayloadLimit);
  if (piece.surplus) return {SlowStatus::kOverlong, shown, begin, begin + 1 + *piece.surplus + 1};
  if (!closed) return {SlowStatus::kUnfinished, shown, begin, end};
  if (piece.escape_open) return {SlowStatus::kCutEscape, shown, begin, end};
  if (piece.data.size() == 1) return {SlowStatus::kOneByte, shown, begin, end};

  const Bytes payload = Front(piece.data, piece.data.size() - 2);
  const Bytes received_check(piece.data.end() - 2, piece.data.end());
  if (SlowCheck(payload) != received_check) return {SlowStatus::kWrongCheck, payload, begin, end};
  return {payload.empty() ? SlowStatus::kNoPayload : SlowStatus::kAccepted, payload, begin, end};
}

}  // namespace

Bytes SlowCheck(const Bytes& payload) {
  int sum = 0;
  int sum_of_sums = 0;
  for (const std::uint8_t byte : payload) {
    sum = (sum + byte) % 255;
    sum_of_sums = (sum_of_sums + sum) % 255;
  }
  return {static_cast<std::uint8_t>(sum), static_cast<std::uint8_t>(sum_of_sums)};
}

Bytes SlowEncode(const Bytes& payload) {
  Bytes inside = payload;
  for (const std::uint8_t byte : SlowCheck(payload)) inside.push_back(byte);
  Bytes frame = {0x7E};
  for (const std::uint8_t byte : inside) {
    if (byte == 0x7E) {
      frame.insert(frame.end(), {0x7D, 0x5E});
    } else if (byte == 0x7D) {
      frame.insert(frame.end(), {0x7D, 0x5D});
    } else {
      frame.push_back(byte);
    }
  }
  frame.push_back(0x7E);
  return frame;
}

std::vector<SlowEvent> SlowDecode(const Bytes& stream, std::size_t origin) {
  std::vector<std::size_t> flags;
  for (std::size_t i = 0; i < stream.size(); ++i) {
    if (stream[i] == 0x7E) flags.push_back(i);
  }
  std::vector<SlowEvent> events;
  if (flags.empty()) {
    if (!stream.empty()) events.push_back({SlowStatus::kHeadless, {}, origin, origin + stream.size()});
    return events;
  }
  if (flags.front() != 0) events.push_back({SlowStatus::kHeadless, {}, origin, origin + flags.front() + 1});
  for (std::size_t n = 0; n < flags.size(); ++n) {
    const bool closed = n + 1 < flags.size();
    const std::size_t stop = closed ? flags[n + 1] : stream.size();
    const Bytes raw(stream.begin() + static_cast<std::ptrdiff_t>(flags[n]) + 1,
                    stream.begin() + static_cast<std::ptrdiff_t>(stop));
    if (!raw.empty()) events.push_back(JudgePiece(raw, origin + flags[n], closed));
  }
  return events;
}

}  // namespace tiltproof::testing
