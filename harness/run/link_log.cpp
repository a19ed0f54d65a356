#include "harness/run/link_log.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>

namespace tiltproof::harness {
namespace {

static_assert(std::endian::native == std::endian::little,
              "link.bin is written in host order on little-endian hosts only");

constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kRecordBytesMax = 0xFFFF;

}  // namespace

LinkLog::LinkLog(std::vector<std::uint8_t> content) : content_(std::move(content)) {
  if (content_.size() < kLinkLogMagic.size() ||
      !std::equal(kLinkLogMagic.begin(), kLinkLogMagic.end(), content_.begin()))
    throw std::runtime_error("not a tiltproof link log: it does not begin with TPLINK1");
  std::size_t at = kLinkLogMagic.size();
  while (at < content_.size()) {
    const auto fail = [&](const char* what) {
      throw std::runtime_error("damaged link log: " + std::string(what) + " at byte " + std::to_string(at));
    };
    if (content_.size() - at < kHeaderBytes) fail("cut record header");
    if (content_[at + 8] >= link::kDirectionCount) fail("unknown direction");
    if (content_[at + 9] > 1) fail("unknown side");
    std::uint16_t size;
    std::memcpy(&size, &content_[at + 10], 2);
    if (content_.size() - at - kHeaderBytes < size) fail("cut record");
    at += kHeaderBytes + size;
  }
}

void LinkLog::Append(const link::Chunk& chunk, link::Direction direction, bool delivered) {
  // A chunk longer than a record can say goes in several; only a fault that inserts without end makes one.
  std::span<const std::uint8_t> rest = chunk.bytes;
  do {
    const auto piece = rest.first(std::min(rest.size(), kRecordBytesMax));
    const std::size_t at = content_.size();
    content_.resize(at + kHeaderBytes + piece.size());
    const auto size = static_cast<std::uint16_t>(piece.size());
    std::memcpy(&content_[at], &chunk.begin_ns, 8);
    content_[at + 8] = static_cast<std::uint8_t>(direction);
    content_[at + 9] = delivered ? 1 : 0;
    std::memcpy(&content_[at + 10], &size, 2);
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

void LinkLog::ShiftOrigin(TimeNs origin_ns) {
  for (std::size_t at = kLinkLogMagic.size(); at < content_.size();) {
    TimeNs begin;
    std::uint16_t size;
    std::memcpy(&begin, &content_[at], 8);
    std::memcpy(&size, &content_[at + 10], 2);
    begin -= origin_ns;
    std::memcpy(&content_[at], &begin, 8);
    at += kHeaderBytes + size;
  }
}

std::optional<LinkRecord> LinkLog::Next(std::size_t& offset) const {
  const std::size_t at = std::max(offset, kLinkLogMagic.size());
  if (at >= content_.size()) return std::nullopt;
  LinkRecord record;
  std::uint16_t size;
  std::memcpy(&record.begin_ns, &content_[at], 8);
  std::memcpy(&size, &content_[at + 10], 2);
  record.direction = static_cast<link::Direction>(content_[at + 8]);
  record.delivered = content_[at + 9] != 0;
  record.bytes = std::span(content_).subspan(at + kHeaderBytes, size);
  offset = at + kHeaderBytes + size;
  return record;
}

}  // namespace tiltproof::harness
