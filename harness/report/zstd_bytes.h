// Bytes, compressed by Zstandard. The only part of the program that sees its library.
//
//   const std::string small = CompressZstd(bytes);
//   const std::string again = DecompressZstd(small, kBytesMax);
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace tiltproof::harness {

// One frame, which states how many bytes it holds.
std::string CompressZstd(std::string_view bytes);

// Throws std::runtime_error on what is no whole frame, or holds more than `size_max` bytes: before memory is taken
// for them.
std::string DecompressZstd(std::string_view frame, std::size_t size_max);

}  // namespace tiltproof::harness
