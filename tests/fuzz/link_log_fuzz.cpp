// The reader of link.bin: any bytes are a log or are refused; the frames of a log are its records, in order of time.
//
// Input: the file.
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "harness/report/line_frames.h"
#include "harness/run/link_log.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tiltproof::harness;
  using tiltproof::testing::Require;
  const auto log = tiltproof::testing::Tried<std::runtime_error>(
      [&] { return LinkLog(std::vector<std::uint8_t>(data, data + size)); });
  if (!log) return 0;
  std::size_t bytes_count = kLinkLogMagic.size();
  LinkLog again;
  for (std::size_t offset = 0; const auto record = log->NextOfAll(offset);) {
    bytes_count += 13 + record->bytes.size();
    const ByteSide side = record->passed_on   ? ByteSide::kPassedOn
                          : record->delivered ? ByteSide::kDelivered
                                              : ByteSide::kSent;
    again.Append(record->begin_ns, record->bytes, record->wire, side);
  }
  Require(bytes_count == log->content().size(), "records are all that a log has");
  Require(again.content() == log->content(), "a log of the same records is the same");
  const std::vector<LineFrame> frames = FramesOf(*log);
  for (std::size_t i = 1; i < frames.size(); ++i)
    Require(frames[i - 1].begin_ns <= frames[i].begin_ns, "frames are in order of time");
  for (const LineFrame& frame : frames) Require(!Name(frame.fate).empty(), "a fate has a name");
  return 0;
}
