#include "harness/run/link_log.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace tiltproof::harness {
namespace {

static_assert(std::endian::native == std::endian::little,
              "link.bin is written in host order on little-endian hosts only");

constexpr std::string_view kFirstMagic = "TPLINK1\n";
constexpr std::size_t kHeaderBytes = 13;
constexpr std::size_t kClientAt = 8, kDirectionAt = 9, kSideAt = 10, kSizeAt = 11;
constexpr std::size_t kRecordBytesMax = 0xFFFF;
// Before or after t = 0, 146 years. Sums of times stay within their type.
constexpr TimeNs kTimeMax = kNever / 2;

bool BeginsWith(const std::vector<std::uint8_t>& content, std::string_view magic) {
  return content.size() >= magic.size() && std::equal(magic.begin(), magic.end(), content.begin());
}

std::uint16_t SizeAt(const std::vector<std::uint8_t>& content, std::size_t at) {
  std::uint16_t size;
  std::memcpy(&size, &content[at], 2);
  return size;
}

TimeNs TimeAt(const std::vector<std::uint8_t>& content, std::size_t at) {
  TimeNs time;
  std::memcpy(&time, &content[at], sizeof time);
  return time;
}

}  // namespace

LinkLog::LinkLog(std::vector<std::uint8_t> content) : content_(std::move(content)) {
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
    if (const TimeNs time = TimeAt(content_, at); time < -kTimeMax || time > kTimeMax)
      fail("a time beyond any flight");
    if (content_[direction_at] >= link::kDirectionCount) fail("unknown direction");
    if (content_[direction_at + 1] > static_cast<std::uint8_t>(ByteSide::kPassedOn)) fail("unknown side");
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

void LinkLog::Append(TimeNs begin, std::span<const std::uint8_t> rest, WireId wire, ByteSide side) {
  // A piece that is too long for one record is split; only a fault that inserts without end makes such a chunk.
  do {
    const auto piece = rest.first(std::min(rest.size(), kRecordBytesMax));
    const std::size_t at = content_.size();
    content_.resize(at + kHeaderBytes + piece.size());
    const auto size = static_cast<std::uint16_t>(piece.size());
    std::memcpy(&content_[at], &begin, 8);
    content_[at + kClientAt] = static_cast<std::uint8_t>(wire.client);
    content_[at + kDirectionAt] = static_cast<std::uint8_t>(wire.direction);
    content_[at + kSideAt] = static_cast<std::uint8_t>(side);
    std::memcpy(&content_[at + kSizeAt], &size, 2);
    if (!piece.empty()) std::memcpy(&content_[at + kHeaderBytes], piece.data(), piece.size());
    rest = rest.subspan(piece.size());
  } while (!rest.empty());
}

void LinkLog::Append(LinkLog&& other) {
  if (content_.size() == kLinkLogMagic.size()) {
    content_ = std::move(other.content_);
    other = {};
    return;
  }
  content_.insert(content_.end(), other.content_.begin() + static_cast<std::ptrdiff_t>(kLinkLogMagic.size()),
                  other.content_.end());
}

std::optional<LinkRecord> LinkLog::Next(std::size_t& offset) const {
  std::optional<LinkRecord> record = NextOfAll(offset);
  while (record && record->passed_on) record = NextOfAll(offset);
  return record;
}

std::optional<LinkRecord> LinkLog::NextOfAll(std::size_t& offset) const {
  const std::size_t at = std::max(offset, kLinkLogMagic.size());
  if (at >= content_.size()) return std::nullopt;
  LinkRecord record;
  const std::uint16_t size = SizeAt(content_, at + kSizeAt);
  record.begin_ns = TimeAt(content_, at);
  record.wire = {content_[at + kClientAt], static_cast<link::Direction>(content_[at + kDirectionAt])};
  const auto side = static_cast<ByteSide>(content_[at + kSideAt]);
  record.delivered = side == ByteSide::kDelivered;
  record.passed_on = side == ByteSide::kPassedOn;
  record.bytes = std::span(content_).subspan(at + kHeaderBytes, size);
  offset = at + kHeaderBytes + size;
  return record;
}

}  // namespace tiltproof::harness
