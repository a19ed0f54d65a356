// The errors that a check does not detect, counted by theory: how many patterns of k wrong bits of payload and check pass.
//
//   const UndetectedErrors errors(link::CheckKind::kCrc16IbmSdlc, 66);
//   Print(stdout, "{} {:.2e}\n", errors.HammingDistance(), errors.RateAt(1e-4));
//
// For a CRC these numbers do not depend on the data. For a sum they are means over all data, because the wrong bits of
// some data make up for one another and those of other data do not. Framing is not part of it.
#pragma once

#include <cstddef>
#include <vector>

#include "link/checksum.h"

namespace tiltproof::harness {

class UndetectedErrors {
 public:
  // `content_bytes`: of payload and check; at most 1024.
  UndetectedErrors(link::CheckKind kind, std::size_t content_bytes);

  // Weights up to this one are counted; beyond it, one pattern in 2^(bits of the check) passes.
  int weight_max() const { return static_cast<int>(counts_.size()) - 1; }
  // The number of patterns with so many wrong bits that pass.
  double Count(int weight) const;
  // The least number of wrong bits that may pass; 0: more than weight_max().
  int HammingDistance() const;
  // Rate of frames that pass with an error, where each bit is wrong with probability p.
  double RateAt(double p) const;

 private:
  std::size_t bits_count_;
  double share_beyond_;
  std::vector<double> counts_;
};

}  // namespace tiltproof::harness
