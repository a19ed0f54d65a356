// Properties of the frame codec over random payloads, streams and chunks.
#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <algorithm>

#include "link/frame.h"
#include "tests/fuzz/differential.h"

namespace tiltproof::link {
namespace {

using tiltproof::testing::Bytes;
using tiltproof::testing::Chunking;
using tiltproof::testing::Decode;
using tiltproof::testing::Disagreement;
using tiltproof::testing::SeenEvent;

// Bytes of which every other one means something to the protocol or the checksum.
rc::Gen<std::uint8_t> HostileByte() {
  return rc::gen::oneOf(rc::gen::arbitrary<std::uint8_t>(),
                        rc::gen::element<std::uint8_t>(0x7E, 0x7D, 0x5E, 0x5D, 0x00, 0xFF));
}

Bytes AnyPayload() {
  const auto length = *rc::gen::inRange<std::size_t>(0, kPayloadBytesMax + 1);
  return *rc::gen::container<Bytes>(length, HostileByte());
}

Chunking AnyChunking() {
  Chunking chunking = *rc::gen::container<Chunking>(rc::gen::inRange<std::size_t>(0, 20));
  chunking.push_back(*rc::gen::inRange<std::size_t>(1, 80));
  return chunking;
}

Bytes Encode(const Bytes& payload) {
  Bytes wire(FrameBytesMax(payload.size()));
  const EncodedFrame frame = EncodeFrame(payload, wire);
  return Bytes(frame.bytes.begin(), frame.bytes.end());
}

RC_GTEST_PROP(FrameProperty, EncoderAgreesWithTheReference, ()) {
  const Bytes payload = AnyPayload();
  RC_ASSERT(Encode(payload) == tiltproof::testing::SlowEncode(payload));
}

RC_GTEST_PROP(FrameProperty, WhatIsEncodedIsDecoded, ()) {
  const Bytes payload = AnyPayload();
  const Bytes frame = Encode(payload);
  const FrameStatus status = payload.empty() ? FrameStatus::kEmpty : FrameStatus::kOk;
  RC_ASSERT(Decode(frame, AnyChunking()) == (std::vector<SeenEvent>{{status, payload, 0, frame.size()}}));
}

RC_GTEST_PROP(FrameProperty, NoFlagInsideAFrame, ()) {
  const Bytes frame = Encode(AnyPayload());
  RC_ASSERT(std::count(frame.begin(), frame.end(), kFlag) == 2);
}

RC_GTEST_PROP(FrameProperty, ChunksDoNotMatter, ()) {
  const Bytes stream = *rc::gen::container<Bytes>(HostileByte());
  RC_ASSERT(Decode(stream, AnyChunking()) == Decode(stream));
}

RC_GTEST_PROP(FrameProperty, RandomStreamsAgreeWithTheReference, ()) {
  const auto streams = *rc::gen::container<std::vector<Bytes>>(rc::gen::container<Bytes>(HostileByte()));
  RC_ASSERT(Disagreement(streams, AnyChunking()) == "");
}

// Streams without a flag in the first part run into the limit of the length.
RC_GTEST_PROP(FrameProperty, OverlongStreamsAgreeWithTheReference, ()) {
  const auto length = *rc::gen::inRange<std::size_t>(250, 300);
  Bytes stream = {kFlag};
  const Bytes inside = *rc::gen::container<Bytes>(length, HostileByte());
  std::remove_copy(inside.begin(), inside.end(), std::back_inserter(stream), kFlag);
  stream.push_back(kFlag);
  RC_ASSERT(Disagreement({stream, stream}, AnyChunking()) == "");
}

RC_GTEST_PROP(FrameProperty, DamagedFramesAgreeWithTheReference, ()) {
  Bytes stream;
  for (int count = *rc::gen::inRange(1, 4); count > 0; --count) {
    const Bytes frame = Encode(AnyPayload());
    stream.insert(stream.end(), frame.begin(), frame.end());
  }
  for (int count = *rc::gen::inRange(1, 6); count > 0; --count) {
    const auto at =
        stream.begin() + *rc::gen::inRange<std::ptrdiff_t>(0, static_cast<std::ptrdiff_t>(stream.size()));
    switch (*rc::gen::inRange(0, 3)) {
      case 0:
        *at = *HostileByte();
        break;
      case 1:
        stream.insert(at, *HostileByte());
        break;
      default:
        stream.erase(at);
    }
  }
  RC_ASSERT(Disagreement({stream}, AnyChunking()) == "");
}

}  // namespace
}  // namespace tiltproof::link
