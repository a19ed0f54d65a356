// Residual errors of a link format: how often a damaged frame is delivered although it equals no frame that was sent.
//
//   IntegritySpec spec{.protocol = FindProtocol("paper"), .errors = ErrorKind::kBurst};
//   for (const IntegrityRow& row : MeasureIntegrity(spec)) Print(stdout, "{} {:.2e}\n", row.level, row.passed_check.rate);
//
// Each frame is damaged on its own, between two intact ones. A wrong frame is one that equals neither of the three: those
// before and behind it are known to its receiver, and are no news.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "link/protocol.h"

namespace tiltproof::harness {

enum class ErrorKind : std::uint8_t {
  kBer,        // each bit of the frame is wrong with this probability
  kBurst,      // the first and the last of this many bits are wrong, those between them at random
  kStuck,      // this many bytes read 00, or FF
  kSwap,       // this many neighbouring pairs of bytes are swapped
  kLoss,       // this many bytes are lost
  kInsert,     // this many random bytes are added
  kEnumerate,  // all ways in which this many bits of one frame are wrong
};
constexpr ErrorKind LastOf(ErrorKind) { return ErrorKind::kEnumerate; }
std::string_view Name(ErrorKind kind);
// Levels that are measured by default.
std::vector<double> LevelsOf(ErrorKind kind);

struct IntegritySpec {
  std::shared_ptr<const link::Protocol> protocol;  // its framing has one of the checks of link/checksum.h
  std::string message = {};                        // empty: DefaultMessage(protocol)
  ErrorKind errors{};
  std::vector<double> levels = {};  // empty: LevelsOf(errors)
  std::int64_t frames_count =
      10'000'000;  // for each level; kLoss and kInsert take a tenth, kEnumerate what it needs
  std::uint64_t seed = 1;
  int threads_count = 1;  // the results do not depend on it
};

// The reply to a request, or else the longest message that the server sends; null when it sends none.
const link::MessageType* DefaultMessage(const link::Protocol& protocol);

// A share with the bounds between which it lies with 95 % confidence (ClusteredBounds() of binomial.h; the frames that
// were made from one intact frame are a cluster). With kEnumerate the bounds are the share of that one frame.
struct Rate {
  double rate = 0, low = 0, high = 0;
};

struct IntegrityRow {
  double level = 0;
  std::int64_t frames_count = 0;  // that were damaged
  // Wrong frames that are delivered: by the framing and its check; with the exact length and the id of a message, too;
  // and with values within their ranges, too.
  std::int64_t passed_check_count = 0, passed_length_count = 0, delivered_wrong_count = 0;
  // For each frame that is sent. With kBer these are no quotients of the counts: see MeasureIntegrity().
  Rate passed_check, passed_length, delivered_wrong;
  // passed_check by theory (undetected.h), for kBer and kEnumerate. For kBurst: that of a check that detects all but
  // 2^-bits of the damage, and of a CRC for bursts that it detects for sure.
  std::optional<double> theory;
};

// Rows in the order of the levels. At a bit error rate p, frames with up to three wrong bits (two, if they are long) are
// damaged in all ways. Those with more are drawn: the number of their wrong bits from the binomial distribution without
// the small numbers. The shares are weighted with their binomial probability, so rates far below one in frames_count
// are found. A number of wrong bits with which no frame came through in any way adds nothing to the bounds. Throws
// std::invalid_argument for a message or a check that cannot be measured, and for levels out of
// range.
std::vector<IntegrityRow> MeasureIntegrity(const IntegritySpec& spec);

}  // namespace tiltproof::harness
