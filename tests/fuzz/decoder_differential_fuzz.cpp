// FrameDecoder against the slow reference, which is another program: the same events in every cut of a short
// stream in two, byte by byte, and in irregular chunks. Slow; decoder_fuzz.cpp is the fast one.
//
// Input: the first byte chooses chunk lengths and where the decoder is finished and goes on; the rest is the
// stream.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/fuzz/differential.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using tiltproof::testing::Bytes;
  const std::size_t choice = size > 0 ? data[0] : 0;
  const Bytes stream(data + (size > 0 ? 1 : 0), data + size);
  const auto finish = stream.begin() + static_cast<std::ptrdiff_t>(stream.size() * (choice >> 4) / 16);
  const std::vector<Bytes> streams = {Bytes(stream.begin(), finish), Bytes(finish, stream.end())};

  constexpr std::size_t kShortBytes = 24;
  std::vector<tiltproof::testing::Chunking> chunkings = {{}, {1}, {choice % 16, 1 + choice % 7, choice % 3}};
  if (stream.size() <= kShortBytes)
    for (std::size_t cut = 2; cut < stream.size(); ++cut) chunkings.push_back({cut, stream.size()});
  for (const auto& chunking : chunkings) {
    const std::string difference = tiltproof::testing::Disagreement(streams, chunking);
    if (difference.empty()) continue;
    std::fprintf(stderr, "%s", difference.c_str());
    std::abort();
  }
  for (const auto& event : tiltproof::testing::Decode(stream))
    tiltproof::testing::Require(!Name(event.status).empty(), "a status has a name");
  return 0;
}
