#include "harness/run/protocol_use.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/run/message_receiver.h"

namespace tiltproof::harness {
namespace {

using link::Direction;

// kRequest is the client's message of each period (link::Protocol::PeriodMessage()), and with it a command of a protocol
// whose server sends by itself. In the order in which they follow each other where no byte takes time.
enum class Kind : std::uint8_t {
  kStart,
  kRequest,
  kReply,          // a message
  kPossibleReply,  // bytes that some receiver may take for a reply, whatever its values
  kWholeReply,     // the server's last reply, untouched
  kActuators,      // a message
  kRefusedActuators
};
struct Happening {
  TimeNs time_ns;
  Kind kind;
};

// A frame that came to the client and is no message.
struct RejectedFrame {
  TimeNs time_ns;
  std::string_view why;
};

// Calls on_frame(record of its last chunk, end of that, frame) for each frame of one direction, on one side of the faults.
template <class OnFrame>
void ForEachFrame(const LinkLog& link, WireId wire, bool delivered, const link::Protocol& protocol,
                  const link::LineRate& rate, const OnFrame& on_frame) {
  MessageReceiver receiver(protocol, wire.direction);
  std::size_t offset = 0;
  while (const auto record = link.Next(offset)) {
    if (record->delivered != delivered || record->wire != wire) continue;
    const TimeNs end_ns = record->begin_ns + rate.BytesTime(static_cast<std::int64_t>(record->bytes.size()));
    receiver.ReceiveFrames(0, record->bytes,
                           [&](const MessageReceiver::Frame& frame) { on_frame(*record, end_ns, frame); });
  }
}

// Replies, whatever their values, in bytes that are sent in one go. A receiver may know from the pauses where a frame
// begins and ends, and need no flag.
std::int64_t RepliesAlone(std::span<const std::uint8_t> bytes, const link::Protocol& protocol,
                          const link::MessageType& reply) {
  const std::optional<std::uint8_t> flag = protocol.framing->flag();
  std::vector<std::uint8_t> alone;
  if (flag) alone.push_back(*flag);
  alone.insert(alone.end(), bytes.begin(), bytes.end());
  if (flag) alone.push_back(*flag);
  std::int64_t count = 0;
  MessageReceiver(protocol, Direction::kToClient)
      .ReceiveFrames(0, alone, [&](const MessageReceiver::Frame& frame) {
        count += protocol.Classify(Direction::kToClient, frame.payload) == &reply ? 1 : 0;
      });
  return count;
}

// Number of replies that some receiver may find, where the usual one finds `count` of them. Many decoders take an
// escape behind an escape for the same one.
std::int64_t PossibleReplies(std::int64_t count, std::span<const std::uint8_t> bytes,
                             const link::Protocol& protocol, const link::MessageType& reply) {
  const std::optional<std::uint8_t> escape = protocol.framing->escape();
  const auto is_double = [&](std::uint8_t a, std::uint8_t b) { return a == escape && b == escape; };
  const bool doubled = std::ranges::adjacent_find(bytes, is_double) != bytes.end();
  if (count > 0 && !doubled) return count;
  count = std::max(count, RepliesAlone(bytes, protocol, reply));
  if (!doubled) return count;
  std::vector<std::uint8_t> single(bytes.begin(), bytes.end());
  single.erase(std::unique(single.begin(), single.end(), is_double), single.end());
  return std::max(count, RepliesAlone(single, protocol, reply));
}

// Adds what came to the client: replies to its message of each period.
void AddReplies(const LinkLog& link, std::size_t client, const link::Protocol& protocol,
                const link::LineRate& rate, const link::MessageType& reply,
                std::vector<Happening>& happenings, std::vector<RejectedFrame>& rejected) {
  MessageReceiver receiver(protocol, Direction::kToClient);
  std::span<const std::uint8_t> last_sent;
  std::size_t offset = 0;
  while (const auto record = link.Next(offset)) {
    if (record->wire != WireId{client, Direction::kToClient}) continue;
    if (!record->delivered) {
      last_sent = record->bytes;
      continue;
    }
    const TimeNs end_ns = record->begin_ns + rate.BytesTime(static_cast<std::int64_t>(record->bytes.size()));
    bool is_message = false;
    std::int64_t count = 0;
    receiver.ReceiveFrames(0, record->bytes, [&](const MessageReceiver::Frame& frame) {
      is_message = frame.message != nullptr && frame.message->type == &reply;
      if (is_message) happenings.push_back({end_ns, Kind::kReply});
      if (frame.message == nullptr) rejected.push_back({record->begin_ns, frame.rejected});
      if (is_message || protocol.Classify(Direction::kToClient, frame.payload) == &reply) ++count;
    });
    // A frame may end before its record does, and be answered at once.
    for (count = PossibleReplies(count, record->bytes, protocol, reply); count > 0; --count)
      happenings.push_back({record->begin_ns, Kind::kPossibleReply});
    if (!is_message || !std::ranges::equal(record->bytes, last_sent)) continue;
    happenings.push_back({end_ns, Kind::kWholeReply});
    last_sent = {};  // a repeated one answers no request
  }
}

// "at 0.1234 s, after a frame that is no message (bad_checksum at 0.1200 s)"
std::string AtAndAfter(TimeNs time_ns, const std::vector<RejectedFrame>& rejected) {
  const auto later = std::ranges::upper_bound(rejected, time_ns, {}, &RejectedFrame::time_ns);
  std::string text = fmt::format("at {:.4f} s", ToSeconds(time_ns));
  if (later != rejected.begin())
    text += fmt::format("; the last frame before it that is not a message: {} at {:.4f} s", (later - 1)->why,
                        ToSeconds((later - 1)->time_ns));
  return text;
}

// Counts whole replies that got no command, and commands that no reply led to, where no sound client does either.
class ReplyJudge {
 public:
  explicit ReplyJudge(TimeNs period_ns) : period_ns_(period_ns) {}

  void Take(const Happening& happening) {
    const TimeNs time_ns = happening.time_ns;
    switch (happening.kind) {
      case Kind::kStart:
        exchange_ = {};
        break;
      case Kind::kRequest:
        // One that comes early was no usual exchange.
        if (exchange_.whole_ns && !exchange_.commanded &&
            10 * (time_ns - *exchange_.asked_ns) >= 9 * period_ns_)
          Count(*exchange_.whole_ns, ignored);
        // A client may answer a little later than in the exchange, but not two exchanges later.
        exchange_ = {.asked_ns = time_ns, .open_before = exchange_.open, .commands = exchange_.commands};
        break;
      case Kind::kWholeReply:
        // A client may have a time-out, and may use its first replies to get ready.
        if (exchange_.commands && exchange_.asked_ns && 4 * (time_ns - *exchange_.asked_ns) <= period_ns_)
          exchange_.whole_ns = time_ns;
        break;
      case Kind::kPossibleReply:
        ++exchange_.open;
        break;
      case Kind::kActuators:
      case Kind::kRefusedActuators:
        if (exchange_.open_before > 0)
          --exchange_.open_before;
        else if (exchange_.open > 0)
          --exchange_.open;
        else if (exchange_.commands)
          Count(time_ns, unfounded);
        exchange_.commanded = exchange_.commands = true;
        break;
      case Kind::kReply:
        break;
    }
  }

  CountedMistake ignored, unfounded;

 private:
  static void Count(TimeNs time_ns, CountedMistake& mistake) {
    if (mistake.count++ == 0) mistake.first_ns = time_ns;
  }

  // From a request to the next.
  struct State {
    std::optional<TimeNs> asked_ns = {}, whole_ns = {};  // the request; the last byte of the server's reply
    std::int64_t open = 0,
                 open_before = 0;  // possible replies without a command: here, in the exchange before
    bool commanded = false;        // since the request
    bool commands = false;         // since its `start`
  };

  TimeNs period_ns_;
  State exchange_;
};

std::int64_t RequestsPerPeriod(const std::vector<Happening>& happenings, TimeNs period_ns) {
  // A clock may be off by some percent: one request a period is one in nine tenths of it.
  const TimeNs span_ns = period_ns / 10 * 9;
  std::deque<TimeNs> recent;
  std::size_t most = 0;
  for (const Happening& happening : happenings) {
    if (happening.kind != Kind::kRequest) continue;
    recent.push_back(happening.time_ns);
    while (happening.time_ns - recent.front() >= span_ns) recent.pop_front();
    most = std::max(most, recent.size());
  }
  return static_cast<std::int64_t>(most);
}

// A firmware may prepare itself between its `start` and its first request.
constexpr TimeNs kFirstRequestMax = 2 * kNsPerS;

// Adds the periods without a request from one request to the next, and what came too soon. `to_ns` may also be the end
// of the flight.
void AddGap(TimeNs from_ns, TimeNs to_ns, bool to_request, TimeNs period_ns,
            std::vector<LineMistake>& mistakes) {
  const TimeNs gap_ns = to_ns - from_ns;
  if (to_request && 2 * gap_ns < period_ns) {
    mistakes.push_back({to_ns, LineMistakeKind::kDoubled});
  } else if (2 * gap_ns > 3 * period_ns) {
    const std::int64_t missing =
        to_request ? (gap_ns + period_ns / 2) / period_ns - 1 : (gap_ns - period_ns / 2) / period_ns;
    mistakes.push_back({from_ns + period_ns, LineMistakeKind::kMissing, std::max<std::int64_t>(missing, 1)});
  }
}

// The reason that a frame was refused, and the bytes that were sent with its end. Only the first kShownFramesMax frames
// show bytes: a firmware may send malformed frames without end.
std::string Malformed(std::string_view why, std::span<const std::uint8_t> bytes, std::size_t earlier_count) {
  constexpr std::size_t kShownFramesMax = 100, kShownBytesMax = 24;
  if (earlier_count >= kShownFramesMax) return std::string(why);
  const auto shown = bytes.first(std::min(bytes.size(), kShownBytesMax));
  return fmt::format("{}, bytes {:02x}{}", why, fmt::join(shown, " "),
                     shown.size() < bytes.size() ? " ..." : "");
}

// The times from `begin_ns` on of one kind.
std::vector<TimeNs> TimesOf(const std::vector<Happening>& happenings, Kind kind, TimeNs begin_ns) {
  std::vector<TimeNs> times_ns;
  for (const Happening& happening : happenings)
    if (happening.kind == kind && happening.time_ns >= begin_ns) times_ns.push_back(happening.time_ns);
  return times_ns;
}

// Finds replies that no command answers within a period. A command answers the newest open reply: where one was lost, the
// next command may come within its period, but answers the next reply.
class UnansweredReplies {
 public:
  UnansweredReplies(TimeNs period_ns, std::vector<LineMistake>& mistakes)
      : period_ns_(period_ns), mistakes_(mistakes) {}

  void Take(const Happening& happening) {
    switch (happening.kind) {
      case Kind::kPossibleReply:
        // Where no byte takes time, the reply is there already.
        is_arriving_ = happening.time_ns != arrived_ns_;
        break;
      case Kind::kReply:
        arrived_ns_ = happening.time_ns;
        if (!is_answered_early_) open_ns_.push_back(happening.time_ns);
        is_arriving_ = is_answered_early_ = false;
        break;
      case Kind::kActuators:
        CountUntil(happening.time_ns);
        Answer();
        break;
      case Kind::kStart:
      case Kind::kRequest:
      case Kind::kWholeReply:
      case Kind::kRefusedActuators:
        break;
    }
  }

  // Counts the replies that are open longer than a period at that time.
  void CountUntil(TimeNs time_ns) {
    for (; !open_ns_.empty() && open_ns_.front() + period_ns_ < time_ns; open_ns_.pop_front())
      mistakes_.push_back({open_ns_.front(), LineMistakeKind::kUnanswered});
  }

 private:
  void Answer() {
    // A receiver that knows a reply's length need not wait for its last byte.
    if (open_ns_.empty()) is_answered_early_ = is_arriving_;
    if (open_ns_.empty()) return;
    // A client may ask more often than it commands.
    const TimeNs newest_ns = open_ns_.back();
    while (!open_ns_.empty() && newest_ns - open_ns_.back() < period_ns_ / 10 * 9) open_ns_.pop_back();
  }

  TimeNs period_ns_;
  std::vector<LineMistake>& mistakes_;
  std::deque<TimeNs> open_ns_;             // the ends of replies without a command
  std::optional<TimeNs> arrived_ns_ = {};  // the end of the last reply
  bool is_arriving_ = false, is_answered_early_ = false;
};

// Without the malformed frames. `begin_ns`: of the client's flight.
void AddMistakes(const RunLog& log, const std::vector<Happening>& happenings, TimeNs begin_ns,
                 const link::Protocol& protocol, std::vector<LineMistake>& mistakes) {
  const TimeNs period_ns = protocol.control_period_ns;
  const std::vector<TimeNs> requests_ns = TimesOf(happenings, Kind::kRequest, begin_ns);
  if (requests_ns.empty() || requests_ns.front() > begin_ns + kFirstRequestMax)
    AddGap(begin_ns, requests_ns.empty() ? log.end_ns : requests_ns.front(), false, period_ns, mistakes);
  for (std::size_t i = 1; i < requests_ns.size(); ++i)
    AddGap(requests_ns[i - 1], requests_ns[i], true, period_ns, mistakes);
  // The criterion survival covers the silence of a firmware that hung or crashed.
  TimeNs end_ns = log.end_ns;
  if (WentAway(log.end_reason)) end_ns = requests_ns.empty() ? begin_ns : requests_ns.back();
  if (!requests_ns.empty()) AddGap(requests_ns.back(), end_ns, false, period_ns, mistakes);

  if (protocol.streams()) return;  // a period without a command is missing already
  UnansweredReplies unanswered(period_ns, mistakes);
  for (const Happening& happening : happenings)
    if (happening.time_ns >= begin_ns) unanswered.Take(happening);
  unanswered.CountUntil(end_ns);
}

// The first implausible field of a whole message, with its plausible range.
std::string ImplausibleField(const link::MessageType& type, std::span<const std::uint8_t> payload) {
  for (std::size_t i = 0; i < type.fields.size(); ++i) {
    const link::MessageField& field = type.fields[i];
    const double value = link::FieldValue(type, payload, i);
    if (field.min <= value && value <= field.max) continue;
    // As many digits as the number on the line has.
    const std::string text = field.type == link::NumberType::kF32
                                 ? fmt::format("{}", static_cast<float>(value))
                                 : fmt::format("{}", value);
    return fmt::format("{} = {}, plausible is {} to {}", field.signal, text, field.min, field.max);
  }
  return "a message that it refuses";
}

// Adds an event, in order of time, about a frame that the firmware itself made and no server takes.
void AddEvent(RunLog& log, std::size_t client, TimeNs time_ns, std::string_view kind, std::string text) {
  const auto later =
      std::upper_bound(log.events.begin(), log.events.end(), time_ns,
                       [](TimeNs time, const RunEvent& event) { return time < event.time_ns; });
  log.events.insert(later, {time_ns, std::string(kind), std::move(text),
                            log.clients.size() > 1 ? std::optional(client) : std::nullopt});
}

// Counts what the firmware does between one request and the next.
void CountExchanges(const std::vector<Happening>& happenings, ProtocolUse& use) {
  bool asked = false, replied = false, answered = false;
  std::int64_t actuators = 0, early = 0;
  for (const Happening& happening : happenings) {
    switch (happening.kind) {
      case Kind::kRequest:
        use.actuators_per_request_max = std::max(use.actuators_per_request_max, actuators);
        use.actuators_before_reply += early;
        use.replies_unanswered += asked && replied && !answered ? 1 : 0;
        asked = true;
        replied = answered = false;
        actuators = early = 0;
        break;
      case Kind::kReply:
        replied = true;
        break;
      case Kind::kActuators:
        ++actuators;
        early += asked && !replied ? 1 : 0;
        answered = answered || replied;
        break;
      case Kind::kStart:
      case Kind::kPossibleReply:
      case Kind::kWholeReply:
      case Kind::kRefusedActuators:
        break;
    }
  }
}

// Sets what a protocol with requests has: replies and the commands that answer them.
void JudgeExchanges(const std::vector<Happening>& happenings, const std::vector<RejectedFrame>& rejected,
                    TimeNs period_ns, ProtocolUse& use) {
  CountExchanges(happenings, use);
  ReplyJudge judge(period_ns);
  for (const Happening& happening : happenings) judge.Take(happening);
  if (judge.ignored.count > 0)
    judge.ignored.text =
        "no command followed a whole reply that came " + AtAndAfter(judge.ignored.first_ns, rejected);
  if (judge.unfounded.count > 0)
    judge.unfounded.text =
        "a command without a new reply was sent " + AtAndAfter(judge.unfounded.first_ns, rejected);
  use.replies_ignored = std::move(judge.ignored);
  use.commands_without_reply = std::move(judge.unfounded);
}

}  // namespace

void AddProtocolUse(RunLog& log, std::size_t client, const link::Protocol& protocol,
                    const link::LineRate& rate) {
  const LinkLog& link = log.link;
  ProtocolUse use{.refused_commands = 0};
  std::vector<Happening> happenings;
  std::vector<LineMistake> mistakes;
  TimeNs started_ns = kNever;
  const link::MessageType& period_message = protocol.PeriodMessage();
  ForEachFrame(
      link, {client, Direction::kToPlant}, false, protocol, rate,
      [&](const LinkRecord& record, TimeNs /*end_ns*/, const MessageReceiver::Frame& frame) {
        const TimeNs begin_ns = record.begin_ns;
        if (frame.message != nullptr && frame.message->type->starts) {
          started_ns = std::min(started_ns, begin_ns);
          happenings.push_back({begin_ns, Kind::kStart});
        }
        if (frame.message == nullptr) {
          if (begin_ns >= 0 && started_ns != kNever)
            mistakes.push_back({begin_ns, LineMistakeKind::kMalformed, 1,
                                Malformed(frame.rejected, record.bytes, mistakes.size())});
          const std::int64_t others = use.malformed_sent++ - *use.refused_commands;
          const link::MessageType* type = protocol.Classify(Direction::kToPlant, frame.payload);
          const bool is_command = type != nullptr && type->kind == link::MessageKind::kActuators;
          if (is_command) happenings.push_back({begin_ns, Kind::kRefusedActuators});
          if (!is_command) {
            if (others > 0) return;
            AddEvent(log, client, begin_ns, kMalformedSentEvent,
                     fmt::format("the firmware sent a frame that is not a message: {}", frame.rejected));
          } else if ((*use.refused_commands)++ == 0) {
            // It is dropped and the command before stays in force, so that nothing else shows it.
            AddEvent(log, client, begin_ns, kCommandRefusedEvent,
                     "the server refused a command: " + (frame.rejected == Name(link::MessageStatus::kStale)
                                                             ? "its number or time is not newer than before"
                                                             : ImplausibleField(*type, frame.payload)));
          }
          return;
        }
        if (frame.message->type == &period_message) happenings.push_back({begin_ns, Kind::kRequest});
        if (frame.message->type->kind == link::MessageKind::kActuators) {
          happenings.push_back({begin_ns, Kind::kActuators});
        }
      });
  std::vector<RejectedFrame> rejected;
  if (const link::MessageType* reply = protocol.Find(period_message.reply))
    AddReplies(link, client, protocol, rate, *reply, happenings, rejected);
  std::stable_sort(happenings.begin(), happenings.end(), [](const Happening& a, const Happening& b) {
    return a.time_ns != b.time_ns ? a.time_ns < b.time_ns : a.kind < b.kind;
  });
  use.requests_per_period_max = RequestsPerPeriod(happenings, protocol.control_period_ns);
  if (!protocol.streams()) JudgeExchanges(happenings, rejected, protocol.control_period_ns, use);
  if (started_ns != kNever && log.clients.at(client).starts_accepted_count > 0)
    AddMistakes(log, happenings, std::max<TimeNs>(started_ns, 0), protocol, mistakes);
  log.clients.at(client).protocol = use;
  log.clients.at(client).line_mistakes = std::move(mistakes);
}

}  // namespace tiltproof::harness
