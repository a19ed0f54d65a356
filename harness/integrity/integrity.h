// Residual errors of a link format: how often a damaged frame is delivered although it equals no frame that was sent.
//
//   IntegritySpec spec{.protocol = link::FindProtocol("paper"), .message = "sensors", .errors = ErrorKind::kBurst};
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
  std::string message = "sensors";
  ErrorKind errors{};
  std::vector<double> levels = {};  // empty: LevelsOf(errors)
  std::int64_t frames_count =
      10'000'000;  // for each level; kLoss and kInsert take a tenth, kEnumerate what it needs
  std::uint64_t seed = 1;
  int threads_count = 1;  // the results do not depend on it
};

// A share with the bounds between which it lies with 95 % confidence (Clopper and Pearson, Biometrika 26 (1934) 404).
// Where all ways are counted, the bounds are the share of that one frame.
struct Rate {
  double rate = 0, low = 0, high = 0;
};

struct IntegrityRow {
  double level = 0;
  std::int64_t frames_count = 0;        // that were damaged
  std::int64_t passed_check_count = 0;  // of these: wrong ones that the framing delivers
  std::int64_t delivered_wrong_count =
      0;  // of these: wrong ones that also are messages with plausible values
  // For each frame that is sent. With kBer these are no quotients of the counts: see MeasureIntegrity().
  Rate passed_check, delivered_wrong;
  // passed_check of a check of this length that detects all but 2^-bits of the damage; for kBer and kBurst.
  std::optional<double> theory;
};

// Rows in the order of the levels. At a bit error rate p, frames with 1, 2, ... wrong bits are damaged separately: those with up
// to three in all ways, the others at random. The share of each is weighted with its binomial probability, so
// rates far below one in frames_count are found. Throws std::invalid_argument for a message or a check that cannot be measured,
// and for levels out of range.
std::vector<IntegrityRow> MeasureIntegrity(const IntegritySpec& spec);

}  // namespace tiltproof::harness
