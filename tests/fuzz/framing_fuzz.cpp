// Framings: any bytes give the same readings in any chunks, what is accepted is a frame of its payload again, and a cutter
// finds the end of each.
//
// Input: the first byte chooses the framing, the second one the size of the chunks; the rest is the stream.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "link/cobs_framing.h"
#include "link/hdlc_framing.h"
#include "link/length_framing.h"
#include "link/message_kind.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/frame_readings.h"

namespace {

using Bytes = std::vector<std::uint8_t>;
using tiltproof::testing::Read, tiltproof::testing::Require;
namespace link = tiltproof::link;

const link::Framing& FramingAt(std::uint8_t choice) {
  using link::CheckKind;
  static const std::array<std::shared_ptr<const link::Framing>, 8> kFramings = {
      link::HdlcFraming(),
      link::MakeHdlcFraming(CheckKind::kCrc32IsoHdlc),
      link::MakeHdlcFraming(CheckKind::kNone),
      link::MakeCobsFraming(CheckKind::kCrc16Ibm3740),
      link::MakeCobsFraming(CheckKind::kNone),
      link::MakeLengthFraming({.sync = {0xAA, 0x55}}, CheckKind::kCrc16IbmSdlc),
      link::MakeLengthFraming({.sync = {'$', '$', 'M', '<'}, .length_bytes = 2}, CheckKind::kSum8),
      link::MakeLengthFraming({.sync = {0xFD}}, CheckKind::kNone)};
  return *kFramings[choice % kFramings.size()];
}

std::vector<Read> ReadAll(const link::Framing& framing, std::span<const std::uint8_t> stream,
                          std::size_t piece) {
  return tiltproof::testing::ReadAll(framing, stream, piece, [&](const link::FrameReading& reading) {
    Require(reading.ok == (reading.status == "ok"), "only the status `ok` is a frame");
    Require(reading.payload.size() <= link::kPayloadBytesMax, "a payload has a longest length");
    Require(reading.begin <= reading.content_begin && reading.content_begin <= reading.content_end &&
                reading.content_end <= reading.end && reading.end <= stream.size(),
            "the places of a reading are in order");
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const link::Framing& framing = FramingAt(data[0]);
  const auto stream = std::span(data, size).subspan(2);
  const std::vector<Read> whole = ReadAll(framing, stream, std::max<std::size_t>(stream.size(), 1));
  Require(whole == ReadAll(framing, stream, 1 + data[1]), "chunks do not matter");
  for (const Read& read : whole) {
    if (read.status != "ok") continue;
    const Bytes frame = framing.Encode(read.payload);
    const auto parts = framing.Split(frame);
    Require(parts && parts->payload == read.payload && parts->damage == 0, "a frame is put together again");
    Bytes behind(framing.opening().begin(), framing.opening().end());
    behind.insert(behind.end(), frame.begin() + static_cast<std::ptrdiff_t>(framing.opening().size()),
                  frame.end());
    const auto cutter = framing.MakeCutter();
    Require(cutter->FindEnd(behind) == behind.size(), "a cutter finds its end");
  }
  framing.Split(stream);
  return 0;
}
