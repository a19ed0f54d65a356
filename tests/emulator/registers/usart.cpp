// USART2 (section 30.6). 1 Mbaud of 16 MHz: a byte takes 10 us, 160 cycles. registers_test.py is at the other end: it
// answers each request below.
#include "tests/emulator/registers/bare.h"

namespace {

constexpr std::uint32_t kUsart = 0x40004400, kSr = kUsart, kDr = kUsart + 4, kBrr = kUsart + 8,
                        kCr1 = kUsart + 0xC, kCr2 = kUsart + 0x10, kCr3 = kUsart + 0x14;
constexpr std::uint32_t kPe = Bit(0), kFe = Bit(1), kNe = Bit(2), kOre = Bit(3), kIdle = Bit(4),
                        kRxne = Bit(5), kTc = Bit(6), kTxe = Bit(7);
constexpr std::uint32_t kOn = Bit(13) | Bit(3) | Bit(2);

volatile unsigned calls = 0;
volatile std::uint32_t status = 0, data = 0;
volatile unsigned left = 0;

void OnReceive() {
  calls = calls + 1;
  status = Reg(kSr);
  data = Reg(kDr);
}
void OnTransmit() {
  calls = calls + 1;
  if (left != 0) {
    left = left - 1;
    Reg(kDr) = 'a' + left;
  } else {
    Clear(kCr1, kTxe);
  }
}
void OnComplete() {
  calls = calls + 1;
  Clear(kCr1, kTc);
}

// Sends a request to the other end, and waits until it is sent. The answer comes 1 ms later.
void Ask(char what) {
  Reg(kDr) = static_cast<std::uint8_t>(what);
  while ((Reg(kSr) & kTc) == 0) {
  }
}

}  // namespace

void Test() {
  EnableClocks();
  Check("USART_SR", Reg(kSr), 0xC0);
  Check("USART_BRR", Reg(kBrr), 0);
  Check("USART_CR1", Reg(kCr1), 0);
  Reg(kBrr) = 0x10;
  Reg(kCr1) = kOn;
  Check("BRR reads back", Reg(kBrr), 0x10);
  Check("CR1 reads back", Reg(kCr1), kOn);

  // The first byte goes on to the shift register at once, the second waits (section 30.3.2).
  Check("TXE, TC", Reg(kSr), kTxe | kTc);
  std::uint32_t begin = Cycles();
  Reg(kDr) = '1';
  Check("TC is cleared by SR, DR", Reg(kSr) & kTc, 0);
  while (Cycles() - begin < 1'600) {
  }
  Check("TC after it", Reg(kSr), kTxe | kTc);
  begin = Cycles();
  Reg(kDr) = '2';
  Reg(kDr) = '3';
  const std::uint32_t full = Reg(kSr);
  Check("TXE, TC while full", full & (kTxe | kTc), 0);
  Await(100, [] { return (Reg(kSr) & kTxe) != 0; });
  const std::uint32_t empty = Cycles() - begin;
  Await(100, [] { return (Reg(kSr) & kTc) != 0; });
  const std::uint32_t complete = Cycles() - begin;
  CheckNear("TXE after a byte", empty, 160, 12);
  CheckNear("TC after two", complete, 320, 12);
  Reg(kSr) = ~kTc;
  Check("TC can be cleared", Reg(kSr) & kTc, 0);

  // Interrupts of the transmitter: three bytes and one call more; and TC.
  Handle(38, OnTransmit);
  left = 3;
  calls = 0;
  Set(kCr1, kTxe);
  Wait(100);
  Check("TXEIE", calls, 4);
  Check("TC at last", Reg(kSr) & kTc, kTc);
  Handle(38, OnComplete);
  calls = 0;
  Reg(kDr) = '4';
  Set(kCr1, kTc);
  const std::uint32_t early = calls;
  Wait(50);
  Check("TCIE not before", early, 0);
  Check("TCIE", calls, 1);

  // A byte is received: RXNE and its interrupt.
  handlers[38] = nullptr;
  Ask('A');
  Check("RXNE", Await(2'000, [] { return (Reg(kSr) & kRxne) != 0; }), 1);
  Check("DR", Reg(kDr), 'x');
  Check("RXNE goes", Reg(kSr) & kRxne, 0);
  Handle(38, OnReceive);
  calls = 0;
  Set(kCr1, kRxne);
  Ask('A');
  Wait(2'000);
  Check("RXNEIE", calls, 1);
  Check("DR in the interrupt", data, 'x');
  Clear(kCr1, kRxne);

  // Overrun (section 30.3.3): the first byte stays, and RXNEIE raises its interrupt.
  Ask('B');
  Wait(2'000);
  Check("ORE", Reg(kSr) & (kOre | kRxne), kOre | kRxne);
  Check("ORE keeps the byte", Reg(kDr), 'x');
  Check("ORE goes", Reg(kSr) & (kOre | kRxne), 0);

  // Framing error and noise.
  Ask('F');
  Wait(2'000);
  Check("FE", Reg(kSr) & (kFe | kNe | kRxne), kFe | kRxne);
  Touch(kDr);
  Ask('N');
  Wait(2'000);
  Check("NE", Reg(kSr) & (kFe | kNe | kRxne), kNe | kRxne);
  Touch(kDr);
  Check("errors go", Reg(kSr) & (kFe | kNe | kOre), 0);

  // Parity error (sections 30.3.3 and 30.6.1): PE with RXNE, cleared by SR and then DR, whether read or written.
  Ask('P');
  Wait(2'000);
  Check("PE", Reg(kSr) & (kPe | kFe | kNe | kRxne), kPe | kRxne);
  Check("PE keeps the byte", Reg(kDr), 'x');
  Check("PE goes", Reg(kSr) & (kPe | kRxne), 0);
  Ask('P');
  Wait(2'000);
  Touch(kDr);
  Check("PE stays without a read of SR", Reg(kSr) & (kPe | kRxne), kPe);
  Reg(kDr) = '8';
  Check("PE is cleared by SR, write to DR", Reg(kSr) & kPe, 0);
  Wait(50);
  // PEIE raises the interrupt, RXNEIE being off.
  calls = 0;
  Ask('P');
  Wait(2'000);
  Check("no PEIE", calls, 0);
  Set(kCr1, Bit(8));
  Check("PEIE", calls, 1);
  Check("PE in the interrupt", status & (kPe | kRxne), kPe | kRxne);
  Clear(kCr1, Bit(8));
  // With parity the highest bit of the word is the parity bit (section 30.6.2): M = 1, then M = 0.
  Set(kCr1, Bit(12) | Bit(10));
  Ask('Q');
  Wait(2'000);
  Check("DR with M and PCE", Reg(kDr), 0x178);
  Clear(kCr1, Bit(12));
  Ask('R');
  Wait(2'000);
  Check("PE with PCE", Reg(kSr) & (kPe | kRxne), kPe | kRxne);
  Check("DR with PCE", Reg(kDr), 0xF8);
  Clear(kCr1, Bit(10));

  // IDLE: one byte time after the last byte, and not between two (section 30.3.3); cleared by SR, DR.
  Touch(kDr);
  calls = 0;
  Set(kCr1, kIdle);
  Ask('C');  // five bytes in a row
  Wait(1'030);
  Check("no IDLE between bytes", calls, 0);
  Wait(1'000);
  Check("IDLEIE", calls, 1);
  Check("IDLE", status & kIdle, kIdle);
  Check("IDLE goes", Reg(kSr) & kIdle, 0);
  Clear(kCr1, kIdle);

  // EIE: errors raise the interrupt only with DMAR (section 30.6.6); there is no stream here.
  calls = 0;
  Reg(kCr3) = 1;
  Ask('N');
  Wait(2'000);
  Check("EIE without DMAR", calls, 0);
  Set(kCr3, Bit(6));
  Check("EIE with DMAR", calls, 1);
  Reg(kCr3) = 0;

  // Two stop bits: 11 bits a byte.
  Reg(kCr2) = 2u << 12;
  begin = Cycles();
  Reg(kDr) = '5';
  Await(100, [] { return (Reg(kSr) & kTc) != 0; });
  Wait(20);
  Reg(kSr) = ~kTc;
  Touch(kSr);
  begin = Cycles();
  Reg(kDr) = '6';
  Await(100, [] { return (Reg(kSr) & kTc) != 0; });
  CheckNear("two stop bits", Cycles() - begin, 176, 12);
  Reg(kCr2) = 0;

  // OVER8 (section 30.3.4): 8 samples a bit, fraction of three bits. 2 Mbaud of 16 MHz.
  Reg(kCr1) = 0;
  Reg(kCr1) = kOn | Bit(15);
  Wait(1);
  Touch(kSr);
  begin = Cycles();
  Reg(kDr) = '7';
  Await(100, [] { return (Reg(kSr) & kTc) != 0; });
  CheckNear("OVER8", Cycles() - begin, 80, 12);

  // APB1RSTR (section 7.3.8).
  Reg(0x40023820) = Bit(17);
  Reg(0x40023820) = 0;
  Check("USART2RST", Reg(kBrr), 0);
}
