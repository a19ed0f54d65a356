#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <memory>

#include "harness/cli/commands.h"
#include "harness/terminal/terminal.h"
#include "link/frame.h"

namespace tiltproof::harness {
namespace {

std::vector<std::uint8_t> FromHex(std::string_view hex) {
  std::vector<std::uint8_t> bytes;
  if (hex.size() % 2 != 0) throw UsageError(fmt::format("HEX: an odd number of digits ({})", hex.size()));
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    std::uint8_t byte = 0;
    const auto [end, error] = std::from_chars(hex.data() + i, hex.data() + i + 2, byte, 16);
    if (error != std::errc{} || end != hex.data() + i + 2)
      throw UsageError(
          fmt::format("HEX: '{}' at digit {} is not a hexadecimal byte", hex.substr(i, 2), i + 1));
    bytes.push_back(byte);
  }
  return bytes;
}

void PrintEvent(const link::FrameEvent& event) {
  Print(stdout, "{{\"offset\": {}, \"status\": \"{}\", \"payload\": \"{}\"}}\n", event.begin,
        Name(event.status), fmt::format("{:02x}", fmt::join(event.payload, "")));
}

}  // namespace

int FrameEncodeCommand(const std::string& hex) {
  const auto payload = FromHex(hex);
  if (payload.size() > link::kPayloadBytesMax)
    throw UsageError(
        fmt::format("HEX: {} bytes; a payload has at most {}", payload.size(), link::kPayloadBytesMax));
  std::array<std::uint8_t, link::FrameBytesMax(link::kPayloadBytesMax)> wire;
  Print(stdout, "{}\n", fmt::format("{:02x}", fmt::join(link::EncodeFrame(payload, wire).bytes, "")));
  return kExitGreen;
}

int FrameDecodeCommand(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file))
    throw UsageError(fmt::format("FILE: {} is a folder; give a file of raw bytes", file.string()));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> opened(
      file.empty() ? nullptr : std::fopen(file.c_str(), "rb"), std::fclose);
  if (!file.empty() && !opened)
    throw UsageError(fmt::format("cannot open {}: {}", file.string(), std::strerror(errno)));
  std::FILE* input = file.empty() ? stdin : opened.get();

  link::FrameDecoder decoder;
  bool rejected = false;
  const auto report = [&](const link::FrameEvent& event) {
    PrintEvent(event);
    rejected |= event.status != link::FrameStatus::kOk;
  };
  for (int c = 0; (c = std::getc(input)) != EOF;) {
    const auto byte = static_cast<std::uint8_t>(c);
    std::span<const std::uint8_t> bytes(&byte, 1);
    while (const auto event = decoder.Next(bytes)) report(*event);
  }
  if (std::ferror(input))
    throw std::runtime_error(fmt::format(
        "cannot read {}: {}", file.empty() ? "standard input" : file.string(), std::strerror(errno)));
  if (const auto event = decoder.Finish()) report(*event);
  return rejected ? kExitNotGreen : kExitGreen;
}

}  // namespace tiltproof::harness
