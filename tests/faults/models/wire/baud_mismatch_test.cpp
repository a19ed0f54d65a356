#include <gtest/gtest.h>

#include <cmath>

#include "tests/faults/faulty_line.h"

namespace tiltproof::faults {
namespace {

Bytes Received(double ppm, const Bytes& sent) {
  FaultSchedule schedule = AtTheLine({Spec("wire.baud_mismatch", {{"ppm", ppm}})}, 1);
  schedule.SetOrigin(kOriginAtPowerOn);
  std::vector<link::Chunk> chunks = {{.begin_ns = {}, .bytes = sent}};
  schedule.Filter(link::Direction::kToClient)->Apply(chunks);
  return chunks.empty() ? Bytes() : chunks[0].bytes;
}

// Data bit 7 is read 8.5 receiver's bits after the edge, and must be read before the stop bit begins, 9 bits after
// it, and after data bit 7 has begun, 8 bits after it: from -5.88 % to 5.88 %. The stop bit is from 9 to 10, and
// must not be missed by a receiver that is slow: 9.5 (1 + e) < 10, up to 5.26 %.
TEST(BaudMismatchTest, WithinItsToleranceNothingChanges) {
  for (const double ppm : {-58'000.0, -20'000.0, 0.0, 20'000.0, 52'000.0})
    EXPECT_EQ(CountUnchanged(Send(Spec("wire.baud_mismatch", {{"ppm", ppm}}), 500)), 500) << ppm;
  for (const double ppm : {-60'000.0, 60'000.0})
    EXPECT_LT(CountUnchanged(Send(Spec("wire.baud_mismatch", {{"ppm", ppm}}), 500)), 10) << ppm;
}

// A byte alone on the line, read off its waveform: low, eight data bits, high.
TEST(BaudMismatchTest, ALoneByteIsReadFromItsWaveform) {
  for (const double ppm : {-90'000.0, 70'000.0, 250'000.0}) {
    for (unsigned sent = 0; sent < 256; ++sent) {
      unsigned read = 0;
      for (int k = 0; k < 8; ++k) {
        const double t = (1.5 + k) * (1 + ppm * 1e-6);
        const bool level = t >= 9 || (t >= 1 && (sent >> static_cast<int>(t - 1) & 1) != 0);
        if (level) read |= 1U << k;
      }
      const Bytes received = Received(ppm, {static_cast<std::uint8_t>(sent)});
      ASSERT_FALSE(received.empty());
      EXPECT_EQ(received[0], read) << ppm << " " << sent;
    }
  }
}

// By hand, at half the rate (ppm 500 000 is 1.5 bits, so bits 2.25, 3.75 ... of 10): 0x55 is low 1 0 1 0 1 0 1 0 high.
// Samples at 2.25 (0), 3.75 (1), 5.25 (1), 6.75 (0), 8.25 (0), 9.75 (high), then the idle line.
TEST(BaudMismatchTest, AnExampleByHand) { EXPECT_EQ(Received(500'000, {0x55}), Bytes{0b11100110}); }

}  // namespace
}  // namespace tiltproof::faults
