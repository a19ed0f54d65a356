#include "harness/emulator/diagnosis/cpu_state.h"

#include <fmt/format.h>

#include <charconv>

namespace tiltproof::harness {
namespace {

constexpr std::uint32_t kStackPointer = 13, kPc = 15;

std::optional<std::uint32_t> HexAfter(std::string_view text, std::string_view name) {
  const std::size_t at = text.find(name);
  if (at == text.npos) return std::nullopt;
  text.remove_prefix(at + name.size());
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
  return error == std::errc() ? std::optional(value) : std::nullopt;
}

// Instructions of 16 bits.
std::optional<std::uint32_t> NarrowLoad(const CpuState& state, std::uint32_t code) {
  const std::uint32_t base = state.r[(code >> 3) & 7], offset = (code >> 6) & 31;
  switch (code >> 11) {
    case 0b01101:  // LDR
      return base + offset * 4;
    case 0b01111:  // LDRB
      return base + offset;
    case 0b10001:  // LDRH
      return base + offset * 2;
    default:
      break;
  }
  // LDRSB, LDR, LDRH, LDRB and LDRSH with a register as the offset; what comes before these are stores.
  constexpr std::uint32_t kFirstLoad = 3;
  if (code >> 12 == 0b0101 && ((code >> 9) & 7) >= kFirstLoad) return base + state.r[(code >> 6) & 7];
  return std::nullopt;
}

// LDR, LDRB, LDRH, LDRSB, LDRSH of 32 bits.
std::optional<std::uint32_t> WideLoad(const CpuState& state, std::uint32_t first, std::uint32_t second) {
  const bool load = (first & 0xFE10U) == 0xF810U && ((first >> 5) & 3) != 3;
  const std::uint32_t base_register = first & 15;
  if (!load || base_register == kPc || base_register == kStackPointer) return std::nullopt;
  const std::uint32_t base = state.r[base_register];
  if ((first & 0x80U) != 0) return base + (second & 0xFFFU);
  if ((second & 0x800U) == 0) return base + (state.r[second & 15] << ((second >> 4) & 3));
  const bool before = (second & 0x400U) != 0, up = (second & 0x200U) != 0;
  const std::uint32_t offset = second & 0xFFU;
  if (!before) return base;
  return up ? base + offset : base - offset;
}

}  // namespace

std::optional<CpuState> ParseCpuState(std::string_view text) {
  CpuState state;
  for (std::size_t i = 0; i < state.r.size(); ++i) {
    const auto value = HexAfter(text, fmt::format("R{:02}=", i));
    if (!value) return std::nullopt;
    state.r[i] = *value;
  }
  const auto xpsr = HexAfter(text, "XPSR=");
  if (!xpsr) return std::nullopt;
  state.xpsr = *xpsr;
  return state;
}

std::string HandlerName(int exception) {
  constexpr int kFirstInterrupt = 16;
  switch (exception) {
    case 0:
      return "";
    case 2:
      return "the NMI's handler";
    case 3:
      return "the hard fault's handler";
    case 4:
      return "the memory management fault's handler";
    case 5:
      return "the bus fault's handler";
    case 6:
      return "the usage fault's handler";
    case 11:
      return "the SVCall's handler";
    case 14:
      return "the PendSV's handler";
    case 15:
      return "the SysTick's handler";
    default:
      return exception >= kFirstInterrupt
                 ? fmt::format("the handler of interrupt {}", exception - kFirstInterrupt)
                 : fmt::format("the handler of exception {}", exception);
  }
}

std::optional<std::uint32_t> LoadAddress(const CpuState& state, std::uint32_t code) {
  const std::uint32_t first = code & 0xFFFFU, second = code >> 16;
  // Half-words that begin so are followed by a second one (ARMv7-M ARM, section A5.1).
  const bool wide = first >> 11 >= 0b11101;
  return wide ? WideLoad(state, first, second) : NarrowLoad(state, first);
}

}  // namespace tiltproof::harness
