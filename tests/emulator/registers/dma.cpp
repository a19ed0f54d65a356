// DMA1 with USART2 (section 10.5): stream 6, channel 4 transmits, stream 5, channel 4 receives. 1 Mbaud of 16 MHz.
#include "tests/emulator/registers/bare.h"

namespace {

constexpr std::uint32_t kUsart = 0x40004400, kSr = kUsart, kDr = kUsart + 4;
constexpr std::uint32_t kDma = 0x40026000, kHisr = kDma + 4, kHifcr = kDma + 0xC;
constexpr std::uint32_t kReceive = kDma + 0x10 + 5 * 0x18, kTransmit = kDma + 0x10 + 6 * 0x18;
constexpr std::uint32_t kNdtr = 4, kPar = 8, kM0ar = 0xC, kM1ar = 0x10;
constexpr std::uint32_t kEn = Bit(0), kTeie = Bit(2), kHtie = Bit(3), kTcie = Bit(4), kToPeripheral = Bit(6),
                        kCirc = Bit(8), kMinc = Bit(10), kDbm = Bit(18), kCt = Bit(19), kChannel4 = 4u << 25;
// In HISR, of streams 5 and 6.
constexpr unsigned kStream5 = 6, kStream6 = 16;
constexpr std::uint32_t kTe = Bit(3), kHt = Bit(4), kTc = Bit(5);

volatile unsigned halves = 0, wholes = 0, errors = 0;
std::uint8_t buffer[8], second[8];

void OnReceive() {
  const std::uint32_t flags = Reg(kHisr) >> kStream5;
  if ((flags & kHt) != 0) halves = halves + 1;
  if ((flags & kTc) != 0) wholes = wholes + 1;
  Reg(kHifcr) = 0x3Du << kStream5;
}
void OnTransmit() {
  const std::uint32_t flags = Reg(kHisr) >> kStream6;
  if ((flags & kTc) != 0) wholes = wholes + 1;
  if ((flags & kTe) != 0) errors = errors + 1;
  Reg(kHifcr) = 0x3Du << kStream6;
}

std::uint32_t Address(const void* object) { return reinterpret_cast<std::uint32_t>(object); }

void Ask(char what) {
  Reg(kDr) = static_cast<std::uint8_t>(what);
  while ((Reg(kSr) & Bit(6)) == 0) {
  }
}

void StartReceive(std::uint32_t more, std::uint32_t count) {
  Reg(kReceive + kPar) = kDr;
  Reg(kReceive + kM0ar) = Address(buffer);
  Reg(kReceive + kM1ar) = Address(second);
  Reg(kReceive + kNdtr) = count;
  Reg(kReceive) = kChannel4 | kMinc | more;
  Set(kReceive, kEn);
}
void StartTransmit(std::uint32_t from, std::uint32_t count) {
  Reg(kTransmit + kPar) = kDr;
  Reg(kTransmit + kM0ar) = from;
  Reg(kTransmit + kNdtr) = count;
  Reg(kTransmit) = kChannel4 | kMinc | kToPeripheral | kTcie | kTeie;
  Set(kTransmit, kEn);
}

}  // namespace

void Test() {
  EnableClocks();
  Check("DMA_SxCR", Reg(kReceive), 0);
  Check("DMA_SxFCR", Reg(kReceive + 0x14), 0x21);
  Check("DMA_HISR", Reg(kHisr), 0);
  Reg(kUsart + 8) = 0x10;
  Reg(kUsart + 0xC) = Bit(13) | Bit(3) | Bit(2);
  Reg(kUsart + 0x14) = Bit(6) | Bit(7);

  // Transmission at the USART's pace: TC of the stream when the last byte is in DR, one byte time before the line is free.
  static const char kText[] = "hello";
  Handle(17, OnTransmit);
  const std::uint32_t begin = Cycles();
  Reg(kSr) = ~Bit(6);
  StartTransmit(Address(kText), 5);
  Check("EN", Reg(kTransmit) & kEn, kEn);
  Check("NDTR", Reg(kTransmit + kNdtr), 3);  // one byte is being sent, one is in DR
  Await(200, [] { return wholes != 0; });
  CheckNear("TCIF", Cycles() - begin, 3 * 160, 40);
  Await(200, [] { return (Reg(kSr) & Bit(6)) != 0; });
  CheckNear("TC of the USART", Cycles() - begin, 5 * 160, 40);
  Check("EN goes", Reg(kTransmit) & kEn, 0);
  Check("NDTR 0", Reg(kTransmit + kNdtr), 0);

  // Circular reception of 12 bytes into 8: half, whole, half (section 10.3.8).
  Handle(16, OnReceive);
  wholes = 0;
  StartReceive(kCirc | kHtie | kTcie, 8);
  Ask('D');  // "0123456789ab"
  Wait(2'000);
  Check("HTIF", halves, 2);
  Check("TCIF of circular", wholes, 1);
  Check("NDTR of circular", Reg(kReceive + kNdtr), 4);
  Check("buffer 0", buffer[0], '8');
  Check("buffer 3", buffer[3], 'b');
  Check("buffer 4", buffer[4], '4');
  Check("RXNE is taken", Reg(kSr) & Bit(5), 0);

  // Stopped by software: EN reads 0, and TCIF is set (section 10.3.14).
  handlers[16] = nullptr;
  Reg(kReceive) = kChannel4;
  Check("EN stopped", Reg(kReceive) & kEn, 0);
  Check("TCIF by stop", Reg(kHisr) >> kStream5 & kTc, kTc);
  Reg(kHifcr) = 0x3Du << kStream5;
  Check("HIFCR", Reg(kHisr), 0);

  // Two buffers in turn (section 10.3.9).
  StartReceive(kDbm | kCirc, 8);
  Ask('D');
  Wait(2'000);
  Check("CT", Reg(kReceive) & kCt, kCt);
  Check("second buffer", second[3], 'b');
  Reg(kReceive) = 0;
  Reg(kHifcr) = 0x3Du << kStream5;

  // Another channel of the stream is another peripheral's (table 42).
  buffer[0] = 0;
  StartReceive(0, 8);
  Reg(kReceive) = 0;
  Reg(kReceive + kNdtr) = 8;
  Reg(kReceive) = 3u << 25 | kMinc | kEn;
  Ask('A');
  Wait(2'000);
  Check("wrong channel", buffer[0], 0);
  Touch(kDr);
  Reg(kReceive) = 0;

  // The core-coupled RAM is out of reach (section 2.1): a transfer error.
  StartTransmit(0x10000000, 5);
  Wait(50);
  Check("TEIF", errors, 1);
  Check("EN after TEIF", Reg(kTransmit) & kEn, 0);
}
