#include "harness/client/program_messages.h"

#include <fmt/format.h>

#include <algorithm>

#include "firmware/tiltproof_program.h"
#include "link/check.h"

namespace tiltproof::harness {
namespace {

constexpr std::size_t kHeadBytes = TILTPROOF_PROGRAM_HEADER_BYTES;

template <class Integer>
void Put(Integer value, std::vector<std::uint8_t>& out) {
  for (std::size_t i = 0; i < sizeof value; ++i)
    out.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i)));
}

void PutHead(std::size_t body_bytes, int kind, int number, bool ask, std::vector<std::uint8_t>& out) {
  Check(body_bytes <= TILTPROOF_PROGRAM_BODY_BYTES_MAX, "a message to a program has the allowed size");
  Put(static_cast<std::uint32_t>(body_bytes), out);
  out.push_back(static_cast<std::uint8_t>(kind));
  out.push_back(static_cast<std::uint8_t>(number));
  out.push_back(ask ? TILTPROOF_PROGRAM_ASK : 0);
  out.push_back(0);
}

void PutTime(int kind, int number, TimeNs shown, bool ask, std::vector<std::uint8_t>& out) {
  PutHead(sizeof shown, kind, number, ask, out);
  Put(shown, out);
}

void PutText(std::string_view text, std::vector<std::uint8_t>& out) {
  Put(static_cast<std::uint32_t>(text.size()), out);
  out.insert(out.end(), text.begin(), text.end());
}

std::string_view TextOf(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  // As of a library: its text ends with a zero.
  return text.substr(0, text.find('\0'));
}

// Parts that a kind of message may have. Sizes without data behind.
struct Shape {
  ProgramMessage::Kind kind;
  std::size_t body_bytes;
  bool has_data;
  int flags;
};
constexpr Shape kShapes[] = {
    {ProgramMessage::Kind::kReady, 4, false, TILTPROOF_PROGRAM_TELLS_STATUS | TILTPROOF_PROGRAM_TELLS_ROLE},
    {ProgramMessage::Kind::kWaiting, 8, false, 0},
    {ProgramMessage::Kind::kTransmit, 9, true, TILTPROOF_PROGRAM_ASK},
    {ProgramMessage::Kind::kStatus, 8, false, 0},
    {ProgramMessage::Kind::kRole, 0, false, 0},
    {ProgramMessage::Kind::kLog, 8, true, 0},
    {ProgramMessage::Kind::kRefused, 0, true, 0},
    {ProgramMessage::Kind::kCompute, 24, false, 0},
};
constexpr int kRoleMax = 2;

const Shape* ShapeOf(std::uint8_t kind) {
  const auto* found = std::find_if(std::begin(kShapes), std::end(kShapes), [&](const Shape& shape) {
    return static_cast<std::uint8_t>(shape.kind) == kind;
  });
  return found == std::end(kShapes) ? nullptr : found;
}

}  // namespace

void AppendHello(const ProgramHello& hello, std::vector<std::uint8_t>& out) {
  std::vector<std::uint8_t> body;
  Put(std::uint32_t{TILTPROOF_PROGRAM_VERSION}, body);
  Put(static_cast<std::uint32_t>(hello.uarts.size()), body);
  for (const link::LineRate& rate : hello.uarts) {
    Put(static_cast<std::uint32_t>(rate.baud), body);
    Put(static_cast<std::uint32_t>(rate.character.bit_count()), body);
  }
  for (const std::string& text : {hello.firmware, hello.dialect, hello.parameters}) PutText(text, body);
  PutHead(body.size(), TILTPROOF_PROGRAM_HELLO, 0, false, out);
  out.insert(out.end(), body.begin(), body.end());
}

void AppendBytes(int uart, TimeNs shown, std::span<const std::uint8_t> bytes, bool ask,
                 std::vector<std::uint8_t>& out) {
  PutHead(sizeof shown + bytes.size(), TILTPROOF_PROGRAM_BYTES, uart, ask, out);
  Put(shown, out);
  out.insert(out.end(), bytes.begin(), bytes.end());
}

void AppendGrant(TimeNs shown, bool ask, std::vector<std::uint8_t>& out) {
  PutTime(TILTPROOF_PROGRAM_GRANT, 0, shown, ask, out);
}
void AppendReset(TimeNs shown, bool ask, std::vector<std::uint8_t>& out) {
  PutTime(TILTPROOF_PROGRAM_RESET, 0, shown, ask, out);
}
void AppendSent(int uart, TimeNs shown, std::vector<std::uint8_t>& out) {
  PutTime(TILTPROOF_PROGRAM_SENT, uart, shown, false, out);
}
void AppendComputed(TimeNs shown, std::vector<std::uint8_t>& out) {
  PutTime(TILTPROOF_PROGRAM_COMPUTED, 0, shown, false, out);
}
void AppendEnd(std::vector<std::uint8_t>& out) { PutHead(0, TILTPROOF_PROGRAM_END, 0, false, out); }

void ProgramReader::Add(std::span<const std::uint8_t> bytes) {
  if (taken_ == bytes_.size()) {
    offset_ += taken_;
    taken_ = 0;
    bytes_.clear();
  }
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

std::optional<ProgramMessage> ProgramReader::Next() {
  const auto left = std::span<const std::uint8_t>(bytes_).subspan(taken_);
  if (left.size() < kHeadBytes) return std::nullopt;
  const auto head = left.first(kHeadBytes);
  CheckHead(head);
  const std::size_t body_bytes = tiltproof_get_u32(head.data());
  if (left.size() - kHeadBytes < body_bytes) return std::nullopt;
  const ProgramMessage message = Read(head, left.subspan(kHeadBytes, body_bytes));
  taken_ += kHeadBytes + body_bytes;
  return message;
}

void ProgramReader::CheckHead(std::span<const std::uint8_t> head) const {
  const std::size_t body_bytes = tiltproof_get_u32(head.data());
  const int number = head[5], flags = head[6];
  const Shape* const shape = ShapeOf(head[4]);
  if (shape == nullptr) Refuse(fmt::format("kind {}, which no program sends,", head[4]));
  if (body_bytes > TILTPROOF_PROGRAM_BODY_BYTES_MAX || body_bytes < shape->body_bytes ||
      (!shape->has_data && body_bytes > shape->body_bytes))
    Refuse(fmt::format("a body of {} bytes for kind {}, which has {}{},", body_bytes, head[4],
                       shape->has_data ? "at least " : "", shape->body_bytes));
  if ((flags & ~shape->flags) != 0 || head[7] != 0)
    Refuse(fmt::format("flags that kind {} does not have", head[4]));
  const int number_max = shape->kind == ProgramMessage::Kind::kTransmit ? uart_count_ - 1
                         : shape->kind == ProgramMessage::Kind::kRole   ? kRoleMax
                                                                        : 0;
  if (number > number_max)
    Refuse(fmt::format("number {} for kind {}, which has at most {},", number, head[4], number_max));
}

ProgramMessage ProgramReader::Read(std::span<const std::uint8_t> head,
                                   std::span<const std::uint8_t> body) const {
  ProgramMessage message;
  message.kind = ShapeOf(head[4])->kind;
  message.number = head[5];
  const auto time = [&] { return tiltproof_get_i64(body.data()); };
  switch (message.kind) {
    case ProgramMessage::Kind::kReady:
      message.tells_status = (head[6] & TILTPROOF_PROGRAM_TELLS_STATUS) != 0;
      message.tells_role = (head[6] & TILTPROOF_PROGRAM_TELLS_ROLE) != 0;
      message.version = tiltproof_get_u32(body.data());
      break;
    case ProgramMessage::Kind::kWaiting:
      message.time_ns = time();
      break;
    case ProgramMessage::Kind::kTransmit:
      message.ask = (head[6] & TILTPROOF_PROGRAM_ASK) != 0;
      message.time_ns = time();
      message.bytes = body.subspan(sizeof(TimeNs));
      break;
    case ProgramMessage::Kind::kStatus:
      message.supervisor_state = tiltproof_get_u32(body.data());
      message.failsafe_count = tiltproof_get_u32(body.data() + 4);
      break;
    case ProgramMessage::Kind::kRole:
      break;
    case ProgramMessage::Kind::kLog:
      message.time_ns = time();
      message.text = TextOf(body.subspan(sizeof(TimeNs)));
      break;
    case ProgramMessage::Kind::kRefused:
      message.text = TextOf(body);
      break;
    case ProgramMessage::Kind::kCompute:
      message.time_ns = time();
      message.length_ns = tiltproof_get_i64(body.data() + 8);
      message.deadline_ns = tiltproof_get_i64(body.data() + 16);
      break;
  }
  return message;
}

void ProgramReader::Refuse(std::string_view what) const {
  const auto shown = std::span<const std::uint8_t>(bytes_).subspan(taken_, kHeadBytes);
  throw BrokenProtocol(
      fmt::format("{} at byte {} of what it sent ({:02x})", what, offset_ + taken_, fmt::join(shown, " ")));
}

}  // namespace tiltproof::harness
