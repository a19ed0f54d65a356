#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <memory>

#include "harness/cli/shared_options.h"
#include "harness/terminal/terminal.h"
#include "link/hdlc_framing.h"
#include "link/message_kind.h"

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

void PrintFrame(const link::FrameReading& read) {
  Print(stdout, "{{\"offset\": {}, \"status\": \"{}\", \"payload\": \"{}\"}}\n", read.begin, read.status,
        fmt::format("{:02x}", fmt::join(read.payload, "")));
}

int FrameEncodeCommand(const std::string& hex) {
  const auto payload = FromHex(hex);
  if (payload.size() > link::kPayloadBytesMax)
    throw UsageError(
        fmt::format("HEX: {} bytes; a payload has at most {}", payload.size(), link::kPayloadBytesMax));
  Print(stdout, "{}\n", fmt::format("{:02x}", fmt::join(link::HdlcFraming()->Encode(payload), "")));
  return kExitGreen;
}

// An empty path is standard input.
int FrameDecodeCommand(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file))
    throw UsageError(fmt::format("FILE: {} is a folder; give a file of raw bytes", file.string()));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> opened(
      file.empty() ? nullptr : std::fopen(file.c_str(), "rb"), std::fclose);
  if (!file.empty() && !opened)
    throw UsageError(fmt::format("cannot open {}: {}", file.string(), std::strerror(errno)));
  std::FILE* input = file.empty() ? stdin : opened.get();

  const std::unique_ptr<link::FrameReader> reader = link::HdlcFraming()->MakeReader();
  bool rejected = false;
  const auto report = [&](const link::FrameReading& read) {
    PrintFrame(read);
    rejected |= !read.ok;
  };
  for (int c = 0; (c = std::getc(input)) != EOF;) {
    const auto byte = static_cast<std::uint8_t>(c);
    std::span<const std::uint8_t> bytes(&byte, 1);
    while (const auto read = reader->Next(bytes)) report(*read);
  }
  if (std::ferror(input))
    throw std::runtime_error(fmt::format(
        "cannot read {}: {}", file.empty() ? "standard input" : file.string(), std::strerror(errno)));
  if (const auto read = reader->Finish()) report(*read);
  return rejected ? kExitNotGreen : kExitGreen;
}

}  // namespace

void RegisterFrame(CLI::App& program, CommandLine& line) {
  CLI::App* command = program.add_subcommand("frame", "Encode and decode frames of the serial line");
  command->require_subcommand(1);

  const auto hex = std::make_shared<std::string>();
  CLI::App* encode =
      command->add_subcommand("encode", "Print the frame that carries a payload, in hexadecimal");
  encode->add_option("HEX", *hex, "The payload in hexadecimal")->required();
  SetAction(*encode, line, [hex] { return FrameEncodeCommand(*hex); });

  const auto file = std::make_shared<std::filesystem::path>();
  CLI::App* decode =
      command->add_subcommand("decode", "Decode raw bytes: one JSON line per frame or rejection");
  decode->add_option("FILE", *file, "Raw bytes (default: standard input)");
  SetAction(*decode, line, [file] { return FrameDecodeCommand(*file); });
}

}  // namespace tiltproof::harness
