#include "harness/campaign/hostile_sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <stdexcept>

#include "faults/frame_words.h"
#include "link/framing.h"

namespace tiltproof::harness {
namespace {

constexpr std::array<std::string_view, 3> kPlaces = {"instead", "before", "after"};

std::string Bytes(std::size_t count) { return fmt::format("{} byte{}", count, count == 1 ? "" : "s"); }

std::string DescribeFrame(const link::FrameReading& read, const link::Protocol& protocol,
                          link::Direction direction) {
  if (!read.ok) return fmt::format("{} of {}", read.status, Bytes(read.content_end - read.content_begin));
  link::Message message;
  const link::MessageStatus status = protocol.Decode(direction, read.payload, message);
  const link::MessageType* type = protocol.Classify(direction, read.payload);
  return fmt::format("{} of {}{}", type == nullptr ? "a payload" : type->name, Bytes(read.payload.size()),
                     status == link::MessageStatus::kOk ? "" : fmt::format(" ({})", Name(status)));
}

// The bytes of a line with hostile inputs among honest frames, and where in them the inputs are.
struct HostileStream {
  struct Span {
    std::size_t begin, end;
    bool Has(std::size_t offset) const { return offset >= begin && offset < end; }
  };
  LineBytes bytes;
  std::vector<Span> inputs;
  // The input which has this byte; none: an honest frame.
  std::optional<std::size_t> InputAt(std::size_t offset) const {
    const auto found = std::ranges::find_if(inputs, [&](const Span& span) { return span.Has(offset); });
    if (found == inputs.end()) return std::nullopt;
    return static_cast<std::size_t>(found - inputs.begin());
  }
};

HostileStream StreamOf(const HostileSequence& sequence, const link::Framing& framing) {
  HostileStream stream;
  const LineBytes honest = framing.Encode(LineBytes{0});
  const auto say = [&](const LineBytes& bytes) {
    stream.bytes.insert(stream.bytes.end(), bytes.begin(), bytes.end());
  };
  say(honest);
  for (const LineBytes& input : sequence.inputs) {
    if (sequence.place == "after" || input.empty()) say(honest);
    stream.inputs.push_back({stream.bytes.size(), stream.bytes.size() + input.size()});
    say(input);
    if (sequence.place == "before" && !input.empty()) say(honest);
  }
  say(honest);
  return stream;
}

link::Direction DirectionOf(const HostileSequence& sequence) {
  return sequence.target == faults::Target::kReference ? link::Direction::kReference
                                                       : link::Direction::kToClient;
}

// The inputs as the sender would number and date them whose first one is at `from_ns`.
void RestampFrom(TimeNs from_ns, const link::Protocol& protocol, HostileSequence& sequence) {
  for (LineBytes& input : sequence.inputs) {
    Restamp(protocol, DirectionOf(sequence), input, from_ns);
    from_ns += protocol.control_period_ns;
  }
}

}  // namespace

std::string PlaceText(const HostileSequence& sequence) {
  return fmt::format("{} the frame of each period",
                     sequence.place == "instead" ? "instead of" : sequence.place);
}

std::string FramesText(const HostileSequence& sequence) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const LineBytes& input : sequence.inputs) {
    if (!text.empty()) text += ' ';
    if (input.empty()) text += '-';
    for (const std::uint8_t byte : input) {
      text += kDigits[byte >> 4];
      text += kDigits[byte & 15];
    }
  }
  return text;
}

TimeNs HostileFrom(const link::Protocol& protocol) { return protocol.control_period_ns; }

Scenario FlightOf(const Scenario& base, const HostileSequence& sequence) {
  Scenario scenario = base;
  const TimeNs period_ns = base.link.protocol->control_period_ns;
  const TimeNs said_from_ns = HostileFrom(*base.link.protocol);
  const TimeNs said_until_ns = said_from_ns + static_cast<TimeNs>(sequence.inputs.size()) * period_ns;
  scenario.duration_ns = said_until_ns + sequence.tail_periods * period_ns;
  if (sequence.inputs.empty()) return scenario;
  HostileSequence said = sequence;
  RestampFrom(said_from_ns, *base.link.protocol, said);
  faults::FaultSpec fault;
  fault.id = kHostileFault;
  fault.type = "frame.script";
  fault.target = sequence.target;
  fault.start_ns = said_from_ns;
  fault.end_ns = said_until_ns;
  fault.parameters = {{"frames", FramesText(said)}, {"place", said.place}};
  scenario.faults = {std::move(fault)};
  return scenario;
}

Scenario WellFormedFlight(const Scenario& base) {
  constexpr std::int64_t kApart = 12;   // periods between two faults
  constexpr std::size_t kForeign = 24;  // replies
  Scenario scenario = base;
  const TimeNs period_ns = base.link.protocol->control_period_ns;
  TimeNs next_ns = kApart * period_ns;
  const auto add = [&](std::string type, std::int64_t periods,
                       decltype(faults::FaultSpec::parameters) parameters) {
    faults::FaultSpec fault;
    fault.id = fmt::format("fault-{}", scenario.faults.size());
    fault.type = std::move(type);
    fault.target = faults::Target::kToClient;
    fault.start_ns = next_ns;
    fault.end_ns = next_ns + periods * period_ns;
    fault.parameters = std::move(parameters);
    next_ns = fault.end_ns + kApart * period_ns;
    scenario.faults.push_back(std::move(fault));
  };
  for (const std::int64_t periods : {1, 2, 3, 5, 10, 30}) add("link.silence", periods, {});
  for (const double delay_ms : {0.5, 1.0, 2.0})
    add("frame.delay", kApart, {{"mean_ms", delay_ms}, {"jitter_ms", 0.0}, {"distribution", "constant"}});
  faults::Random random(1);
  const HostileFrames replies(*base.link.protocol, link::Direction::kToClient);
  for (const std::string_view place : kPlaces) {
    HostileSequence foreign{.place = std::string(place), .inputs = {}};
    // Alone, and two in a row.
    for (std::size_t i = 0; i < kForeign; ++i) {
      if (i % 3 == 0) foreign.inputs.emplace_back();
      foreign.inputs.push_back(replies.Valid(random));
      if (i % 2 == 0) foreign.inputs.emplace_back();
    }
    RestampFrom(next_ns, *base.link.protocol, foreign);
    add("frame.script", static_cast<std::int64_t>(foreign.inputs.size()),
        {{"frames", FramesText(foreign)}, {"place", foreign.place}});
  }
  scenario.duration_ns = next_ns;
  return scenario;
}

std::size_t InputsUntil(const HostileSequence& sequence, std::size_t said_count) {
  std::size_t count = 0;
  for (; count < sequence.inputs.size() && said_count > 0; ++count)
    if (!sequence.inputs[count].empty()) --said_count;
  return count;
}

std::string ToText(const HostileSequence& sequence) {
  return fmt::format("{} {}\n{}\n", Name(sequence.target), sequence.place, FramesText(sequence));
}

HostileSequence ReadSequence(std::string_view text) {
  HostileSequence sequence;
  const std::size_t line = text.find('\n');
  const std::string_view head = text.substr(0, line);
  const std::size_t space = head.find(' ');
  if (line == std::string_view::npos || space == std::string_view::npos)
    throw std::runtime_error("begins with no line of target and place");
  const std::string_view target = head.substr(0, space);
  if (target != Name(faults::Target::kToClient) && target != Name(faults::Target::kReference))
    throw std::runtime_error(fmt::format("the target '{}' is none of to_client, reference", target));
  if (target == Name(faults::Target::kReference)) sequence.target = faults::Target::kReference;
  sequence.place = head.substr(space + 1);
  if (std::find(kPlaces.begin(), kPlaces.end(), sequence.place) == kPlaces.end())
    throw std::runtime_error(
        fmt::format("the place '{}' is none of {}", sequence.place, fmt::join(kPlaces, ", ")));
  std::string_view frames = text.substr(line + 1);
  if (frames.ends_with('\n')) frames.remove_suffix(1);
  faults::FrameWords script = faults::ReadFrameWords(frames);
  if (!script.problem.empty()) throw std::runtime_error(script.problem);
  sequence.inputs = std::move(script.frames);
  if (sequence.inputs.size() > kInputsMax) sequence.inputs.resize(kInputsMax);
  return sequence;
}

HostileSequence ChangeSequence(const HostileSequence& parent, const HostileSequence& other,
                               const HostileFrames& frames, std::size_t count, faults::Random& random) {
  HostileSequence changed = parent;
  std::vector<LineBytes>& inputs = changed.inputs;
  bool is_new = inputs.empty();
  if (is_new && random.Below(2) == 0) changed.place = kPlaces[random.Below(kPlaces.size())];
  // In some flights the firmware hears nothing but hostile frames, in others honest ones between them.
  const std::uint64_t honest_of_8 = random.Below(5);
  // Places that few inputs reach are searched for near those inputs.
  const std::size_t near_count = random.Below(4) == 0 ? 0 : inputs.size();
  while (inputs.size() < count) {
    const LineBytes* near = near_count == 0 ? nullptr : &inputs[random.Below(near_count)];
    if (near != nullptr && !near->empty()) {
      inputs.push_back(random.Below(2) == 0 ? frames.ChangeOneByte(*near, random)
                                            : frames.Change(*near, random));
      is_new = true;
    } else {
      inputs.push_back(random.Below(8) < honest_of_8 ? LineBytes() : frames.Make(random));
    }
  }
  for (std::size_t changes = is_new ? 0 : 1 + random.Below(count); changes > 0 && !inputs.empty();
       --changes) {
    const std::size_t at = random.Below(inputs.size());
    const std::uint64_t what = random.Below(16);
    if (what < 7) {
      inputs[at] = frames.Change(inputs[at].empty() ? frames.Valid(random) : inputs[at], random);
    } else if (what < 12) {
      inputs[at] = frames.Make(random);
    } else if (what < 14 && !other.inputs.empty()) {
      inputs[at] = other.inputs[random.Below(other.inputs.size())];
    } else {
      Rearrange(inputs, at, random);
    }
  }
  inputs.resize(count);
  return changed;
}

std::vector<std::string> Describe(const HostileSequence& sequence, const link::Protocol& protocol) {
  const link::Direction direction = DirectionOf(sequence);
  const link::Framing& framing = *protocol.framing;
  const HostileStream stream = StreamOf(sequence, framing);
  std::vector<std::vector<std::string>> parts(sequence.inputs.size());
  std::vector<std::size_t> rest_of(
      sequence.inputs.size());  // the input with the frame that goes on in this one
  const std::unique_ptr<link::FrameReader> reader = framing.MakeReader();
  std::span<const std::uint8_t> rest(stream.bytes);
  while (const auto read = reader->Next(rest)) {
    // Its flags may be its neighbours'.
    const auto input = stream.InputAt(read->content_begin);
    if (!input) continue;
    std::string text = DescribeFrame(*read, protocol, direction);
    const std::size_t last = stream.InputAt(read->content_end - 1).value_or(*input);
    if (last != *input) text += fmt::format(" (it ends in frame {})", last + 1);
    parts[*input].push_back(std::move(text));
    std::fill(rest_of.begin() + static_cast<std::ptrdiff_t>(*input), rest_of.end(), *input);
  }
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < sequence.inputs.size(); ++i) {
    const LineBytes& input = sequence.inputs[i];
    const bool is_idle = CountFlags(framing, input) == input.size();
    lines.push_back(input.empty()       ? "as it is"
                    : !parts[i].empty() ? fmt::format("{}", fmt::join(parts[i], ", "))
                    : is_idle           ? fmt::format("{} flag{}", input.size(), input.size() == 1 ? "" : "s")
                                        : fmt::format("the rest of frame {}", rest_of[i] + 1));
  }
  return lines;
}

}  // namespace tiltproof::harness
