// Finds the function and line of the source to which an address of a firmware image belongs.
//
//   const SourceLines source("firmware.elf");
//   source.Describe(0x0800'0412);             // "ReadSensor (main.c:123)"
//
// Lines need an image with debug information (compiled with -g), functions one with symbols. An image without them
// has only addresses.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

namespace tiltproof::harness {

class SourceLines {
 public:
  // Throws std::runtime_error for a file that is no image.
  explicit SourceLines(const std::filesystem::path& image);
  ~SourceLines();
  SourceLines(const SourceLines&) = delete;
  SourceLines& operator=(const SourceLines&) = delete;

  struct Place {
    std::string function;  // "" when unknown; an inlined one by its own name
    std::string file;      // without its folder; "" when unknown
    int line = 0;
  };
  Place Find(std::uint32_t address) const;

  // Describes the instruction at an address (bit 0, Thumb, is ignored): "ReadSensor (main.c:123)",
  // "Reset_Handler + 0x12", or "0x08000412".
  std::string Describe(std::uint32_t address) const;
  // Describes the call that returns to this address.
  std::string DescribeCall(std::uint32_t return_address) const;

 private:
  struct Content;
  std::unique_ptr<Content> content_;
};

}  // namespace tiltproof::harness
