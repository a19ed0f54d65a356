#include "harness/run/link_log.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <type_traits>
#include <utility>

namespace tiltproof::harness {
namespace {

static_assert(std::endian::native == std::endian::little,
              "link.bin is written in host order on little-endian hosts only");

constexpr std::string_view kFirstMagic = "TPLINK1\n";
constexpr std::size_t kHeaderBytes = 13;
constexpr std::size_t kClientAt = 8, kDirectionAt = 9, kSideAt = 10, kSizeAt = 11;
constexpr std::size_t kRecordBytesMax = 0xFFFF;
constexpr std::uint8_t kSent = 0, kDelivered = 1, kPassedOn = 2;

bool BeginsWith(const std::vector<std::uint8_t>& content, std::string_view magic) {
  return content.size() >= magic.size() && std::equal(magic.begin(), magic.end(), content.begin());
}

std::uint16_t SizeAt(const std::vector<std::uint8_t>& content, std::size_t at) {
  std::uint16_t size;
  std::memcpy(&size, &content[at], 2);
  return size;
}

static_assert(std::is_trivially_copyable_v<BootTime> && sizeof(BootTime) == sizeof(TimeNs));

template <class Time>
Time TimeAt(const std::vector<std::uint8_t>& content, std::size_t at) {
  Time time;
  std::memcpy(&time, &content[at], sizeof time);
  return time;
}

}  // namespace

template <class Time>
TimedLinkLog<Time>::TimedLinkLog(std::vector<std::uint8_t> content) : content_(std::move(content)) {
  const bool first_version = BeginsWith(content_, kFirstMagic);
  if (!first_version && !BeginsWith(content_, kLinkLogMagic))
    throw std::runtime_error("not a tiltproof link log: it begins with neither TPLINK2 nor TPLINK1");
  // In the first version a record has all but the client.
  const std::size_t header_bytes = kHeaderBytes - (first_version ? 1 : 0);
  std::vector<std::uint8_t> with_clients(kLinkLogMagic.begin(), kLinkLogMagic.end());
  std::size_t at = kLinkLogMagic.size();
  while (at < content_.size()) {
    const auto fail = [&](const char* what) {
      throw std::runtime_error("damaged link log: " + std::string(what) + " at byte " + std::to_string(at));
    };
    if (content_.size() - at < header_bytes) fail("cut record header");
    const std::size_t direction_at = at + header_bytes - 4;
    if (content_[direction_at] >= link::kDirectionCount) fail("unknown direction");
    if (content_[direction_at + 1] > kPassedOn) fail("unknown side");
    const std::uint16_t size = SizeAt(content_, direction_at + 2);
    if (content_.size() - at - header_bytes < size) fail("cut record");
    if (first_version) {
      const auto record = content_.begin() + static_cast<std::ptrdiff_t>(at);
      with_clients.insert(with_clients.end(), record, record + kClientAt);
      with_clients.push_back(0);
      with_clients.insert(with_clients.end(), record + kClientAt,
                          record + static_cast<std::ptrdiff_t>(header_bytes + size));
    }
    at += header_bytes + size;
  }
  if (first_version) content_ = std::move(with_clients);
}

template <class Time>
void TimedLinkLog<Time>::Append(const link::TimedChunk<Time>& chunk, WireId wire, bool delivered) {
  AppendRecords(chunk.begin_ns, chunk.bytes, wire, delivered ? kDelivered : kSent);
}

template <class Time>
void TimedLinkLog<Time>::AppendPassedOn(Time at, std::span<const std::uint8_t> bytes, WireId wire) {
  AppendRecords(at, bytes, wire, kPassedOn);
}

template <class Time>
void TimedLinkLog<Time>::AppendRecords(Time begin, std::span<const std::uint8_t> rest, WireId wire,
                                       std::uint8_t side) {
  // A piece that is too long for one record is split; only a fault that inserts without end makes such a chunk.
  do {
    const auto piece = rest.first(std::min(rest.size(), kRecordBytesMax));
    const std::size_t at = content_.size();
    content_.resize(at + kHeaderBytes + piece.size());
    const auto size = static_cast<std::uint16_t>(piece.size());
    std::memcpy(&content_[at], &begin, 8);
    content_[at + kClientAt] = static_cast<std::uint8_t>(wire.client);
    content_[at + kDirectionAt] = static_cast<std::uint8_t>(wire.direction);
    content_[at + kSideAt] = side;
    std::memcpy(&content_[at + kSizeAt], &size, 2);
    if (!piece.empty()) std::memcpy(&content_[at + kHeaderBytes], piece.data(), piece.size());
    rest = rest.subspan(piece.size());
  } while (!rest.empty());
}

template <class Time>
void TimedLinkLog<Time>::Append(TimedLinkLog&& other) {
  if (content_.size() == kLinkLogMagic.size()) {
    content_ = std::move(other.content_);
    other = {};
    return;
  }
  content_.insert(content_.end(), other.content_.begin() + static_cast<std::ptrdiff_t>(kLinkLogMagic.size()),
                  other.content_.end());
}

template <class Time>
    LinkLog TimedLinkLog<Time>::Shifted(Origin origin) && requires std::same_as<Time, BootTime> {
  for (std::size_t at = kLinkLogMagic.size(); at < content_.size();) {
    const TimeNs begin_ns = origin.SimulationTime(TimeAt<BootTime>(content_, at));
    std::memcpy(&content_[at], &begin_ns, sizeof begin_ns);
    at += kHeaderBytes + SizeAt(content_, at + kSizeAt);
  }
  LinkLog shifted;
  shifted.content_ = std::exchange(*this, {}).content_;
  return shifted;
}

template <class Time>
std::optional<TimedLinkRecord<Time>> TimedLinkLog<Time>::Next(std::size_t& offset) const {
  std::optional<TimedLinkRecord<Time>> record = NextOfAll(offset);
  while (record && record->passed_on) record = NextOfAll(offset);
  return record;
}

template <class Time>
std::optional<TimedLinkRecord<Time>> TimedLinkLog<Time>::NextOfAll(std::size_t& offset) const {
  const std::size_t at = std::max(offset, kLinkLogMagic.size());
  if (at >= content_.size()) return std::nullopt;
  TimedLinkRecord<Time> record;
  const std::uint16_t size = SizeAt(content_, at + kSizeAt);
  record.begin_ns = TimeAt<Time>(content_, at);
  record.wire = {content_[at + kClientAt], static_cast<link::Direction>(content_[at + kDirectionAt])};
  record.delivered = content_[at + kSideAt] == kDelivered;
  record.passed_on = content_[at + kSideAt] == kPassedOn;
  record.bytes = std::span(content_).subspan(at + kHeaderBytes, size);
  offset = at + kHeaderBytes + size;
  return record;
}

template class TimedLinkLog<TimeNs>;
template class TimedLinkLog<BootTime>;

}  // namespace tiltproof::harness
