#include "harness/report/zstd_bytes.h"

#include <fmt/format.h>
#include <zstd.h>

#include <stdexcept>

#include "link/check.h"

namespace tiltproof::harness {
namespace {

// Residuals of a trace's columns, after their transformation, hardly get smaller at higher levels.
constexpr int kLevel = 3;

}  // namespace

std::string CompressZstd(std::string_view bytes) {
  std::string frame(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size = ZSTD_compress(frame.data(), frame.size(), bytes.data(), bytes.size(), kLevel);
  Check(ZSTD_isError(size) == 0, "a buffer of the largest size is large enough");
  frame.resize(size);
  return frame;
}

std::string DecompressZstd(std::string_view frame, std::size_t size_max) {
  const unsigned long long size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN)
    throw std::runtime_error("not compressed by Zstandard, or damaged");
  if (size > size_max) throw std::runtime_error(fmt::format("holds {} bytes; {} at most", size, size_max));
  std::string bytes(size, '\0');
  const std::size_t got = ZSTD_decompress(bytes.data(), bytes.size(), frame.data(), frame.size());
  if (ZSTD_isError(got) != 0) throw std::runtime_error(fmt::format("damaged: {}", ZSTD_getErrorName(got)));
  if (got != size) throw std::runtime_error(fmt::format("damaged: {} bytes instead of {}", got, size));
  return bytes;
}

}  // namespace tiltproof::harness
