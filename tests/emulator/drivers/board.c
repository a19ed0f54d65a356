/* firmware/examples/minimal_c/minimal_firmware.c on boards whose drivers are written in the usual ways, chosen by DRIVER:
 *
 *   POLLED     nothing but flags: RXNE and TXE are asked for in a loop that never sleeps
 *   INTERRUPT  RXNE and TXE interrupts, rings, SysTick
 *   DMA        circular reception, handed over at HT, TC and IDLE, and transmission by DMA (RM0090, section 10)
 *
 * TIME_BASE is SYSTICK or TIM6. 168 MHz from the crystal, USART2 main line, USART3 reference line, both 921600 baud.
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "firmware/tiltproof_client.h"

#define POLLED 1
#define INTERRUPT 2
#define DMA 3
#define SYSTICK 1
#define TIM6 2

#ifndef FORMAT
#define FORMAT 0u /* M, PCE and PS of CR1; 8N1 */
#endif

#define REGISTER(address) (*(volatile uint32_t*)(address))
#define BIT(n) (1u << (n))

#define RCC 0x40023800u
#define USART_SR(usart) REGISTER((usart) + 0x00)
#define USART_DR(usart) REGISTER((usart) + 0x04)
#define USART_BRR(usart) REGISTER((usart) + 0x08)
#define USART_CR1(usart) REGISTER((usart) + 0x0C)
#define USART_CR3(usart) REGISTER((usart) + 0x14)
#define STREAM(n) (0x40026010u + 0x18u * (n)) /* of DMA1 */
#define STREAM_CR(n) REGISTER(STREAM(n))
#define STREAM_NDTR(n) REGISTER(STREAM(n) + 0x4)
#define STREAM_PAR(n) REGISTER(STREAM(n) + 0x8)
#define STREAM_M0AR(n) REGISTER(STREAM(n) + 0xC)
#define DMA1_LIFCR REGISTER(0x40026008)
#define DMA1_HIFCR REGISTER(0x4002600C)
#define TIM6_REGISTER(offset) REGISTER(0x40001000u + (offset))

enum { kRingBytes = 256, kTickNs = 1000000, kByteNs = 10850 };
enum { kPe = BIT(0), kRxne = BIT(5), kTc = BIT(6), kTxe = BIT(7), kIdle = BIT(4) };
static const uint32_t kUsarts[2] = {0x40004400, 0x40004800}; /* by UART: main, reference */

typedef struct {
  uint8_t bytes[kRingBytes];
  volatile unsigned written, read;
} Ring;
static Ring rings[2];
#if DRIVER != POLLED
static Ring transmit_ring;
#endif
static volatile uint32_t tick_count;

static void Put(Ring* ring, uint8_t byte) {
  if (ring->written - ring->read == kRingBytes) return;
  ring->bytes[ring->written % kRingBytes] = byte;
  ring->written = ring->written + 1;
}
static bool Take(Ring* ring, uint8_t* byte) {
  if (ring->written == ring->read) return false;
  *byte = ring->bytes[ring->read % kRingBytes];
  ring->read = ring->read + 1;
  return true;
}

/* ------------------------------------------------------------------------------------------------- drivers */

#if DRIVER == POLLED
static void Receive(int uart) {
  if ((USART_SR(kUsarts[uart]) & kRxne) != 0) Put(&rings[uart], (uint8_t)USART_DR(kUsarts[uart]));
}
void USART2_IRQHandler(void) {}
void USART3_IRQHandler(void) {}
static void StartReceivers(void) {}
static void Send(const uint8_t* bytes, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    /* A byte on the other line arrives meanwhile. */
    while ((USART_SR(kUsarts[0]) & kTxe) == 0) Receive(1);
    USART_DR(kUsarts[0]) = bytes[i];
  }
}
#endif

#if DRIVER == INTERRUPT
volatile uint32_t parity_errors[2]; /* by UART; read by the test */
static void Receive(int uart) {
  const uint32_t status = USART_SR(kUsarts[uart]);
  if ((status & kRxne) == 0) return;
  if ((status & kPe) != 0) parity_errors[uart] = parity_errors[uart] + 1;
  Put(&rings[uart], (uint8_t)USART_DR(kUsarts[uart]));
}
void USART2_IRQHandler(void) {
  Receive(0);
  if ((USART_CR1(kUsarts[0]) & kTxe) == 0 || (USART_SR(kUsarts[0]) & kTxe) == 0) return;
  uint8_t byte;
  if (Take(&transmit_ring, &byte)) {
    USART_DR(kUsarts[0]) = byte;
  } else {
    USART_CR1(kUsarts[0]) &= ~(uint32_t)kTxe;
  }
}
void USART3_IRQHandler(void) { Receive(1); }
static void StartReceivers(void) {
  for (int uart = 0; uart < 2; ++uart) USART_CR1(kUsarts[uart]) |= kRxne;
  REGISTER(0xE000E104) = BIT(38 - 32) | BIT(39 - 32);
}
static void Send(const uint8_t* bytes, size_t count) {
  for (size_t i = 0; i < count; ++i) Put(&transmit_ring, bytes[i]);
  __asm volatile("cpsid i" ::: "memory");
  USART_CR1(kUsarts[0]) |= kTxe;
  __asm volatile("cpsie i" ::: "memory");
}
#endif

#if DRIVER == DMA
/* Receivers: streams 5 (USART2) and 1 (USART3); the transmitter: stream 6; all channel 4 (table 42). */
enum { kDmaBytes = 32 };
static const unsigned kStreams[2] = {5, 1};
static volatile uint8_t dma_buffers[2][kDmaBytes];
static unsigned dma_read[2];
static uint8_t sending[kRingBytes];

/* What has come since the last call. */
static void Collect(int uart) {
  const unsigned written = kDmaBytes - STREAM_NDTR(kStreams[uart]);
  while (dma_read[uart] != written % kDmaBytes) {
    Put(&rings[uart], dma_buffers[uart][dma_read[uart]]);
    dma_read[uart] = (dma_read[uart] + 1) % kDmaBytes;
  }
}
static void OnIdle(int uart) {
  if ((USART_SR(kUsarts[uart]) & kIdle) == 0) return;
  (void)USART_DR(kUsarts[uart]);
  Collect(uart);
}
void USART2_IRQHandler(void) { OnIdle(0); }
void USART3_IRQHandler(void) { OnIdle(1); }
void DMA1_Stream1_IRQHandler(void) {
  DMA1_LIFCR = 0x3Du << 6;
  Collect(1);
}
void DMA1_Stream5_IRQHandler(void) {
  DMA1_HIFCR = 0x3Du << 6;
  Collect(0);
}
static void StartSending(void) {
  size_t count = 0;
  while (count < sizeof(sending) && Take(&transmit_ring, &sending[count])) ++count;
  if (count == 0) return;
  STREAM_M0AR(6) = (uint32_t)(uintptr_t)sending;
  STREAM_NDTR(6) = count;
  STREAM_CR(6) = 4u << 25 | BIT(10) | BIT(6) | BIT(4) | BIT(0);
}
void DMA1_Stream6_IRQHandler(void) {
  DMA1_HIFCR = 0x3Du << 16;
  StartSending();
}
static void StartReceivers(void) {
  REGISTER(RCC + 0x30) |= BIT(21); /* DMA1 */
  for (int uart = 0; uart < 2; ++uart) {
    const unsigned stream = kStreams[uart];
    STREAM_PAR(stream) = kUsarts[uart] + 4;
    STREAM_M0AR(stream) = (uint32_t)(uintptr_t)dma_buffers[uart];
    STREAM_NDTR(stream) = kDmaBytes;
    STREAM_CR(stream) = 4u << 25 | BIT(10) | BIT(8) | BIT(4) | BIT(3) | BIT(0); /* circular, HT, TC */
    USART_CR3(kUsarts[uart]) = BIT(6);
    USART_CR1(kUsarts[uart]) |= kIdle;
  }
  STREAM_PAR(6) = kUsarts[0] + 4;
  USART_CR3(kUsarts[0]) |= BIT(7);
  REGISTER(0xE000E100) = BIT(12) | BIT(16) | BIT(17);
  REGISTER(0xE000E104) = BIT(38 - 32) | BIT(39 - 32);
}
static void Send(const uint8_t* bytes, size_t count) {
  __asm volatile("cpsid i" ::: "memory");
  for (size_t i = 0; i < count; ++i) Put(&transmit_ring, bytes[i]);
  if ((STREAM_CR(6) & BIT(0)) == 0) StartSending();
  __asm volatile("cpsie i" ::: "memory");
}
#else
void DMA1_Stream1_IRQHandler(void) {}
void DMA1_Stream5_IRQHandler(void) {}
void DMA1_Stream6_IRQHandler(void) {}
#endif

/* ----------------------------------------------------------------------------------------------- time base */

void SysTick_Handler(void) { tick_count = tick_count + 1; }
void TIM6_IRQHandler(void) {
  TIM6_REGISTER(0x10) = 0;
  tick_count = tick_count + 1;
}

static void StartTicks(void) {
#if TIME_BASE == TIM6
  REGISTER(RCC + 0x40) |= BIT(4);
  TIM6_REGISTER(0x28) = 84 - 1; /* 1 MHz of 84 MHz, twice APB1 */
  TIM6_REGISTER(0x2C) = 1000 - 1;
  TIM6_REGISTER(0x14) = 1; /* loads the prescaler */
  TIM6_REGISTER(0x10) = 0;
  TIM6_REGISTER(0x0C) = 1;
  TIM6_REGISTER(0x00) = 1;
  REGISTER(0xE000E104) = BIT(54 - 32);
#else
  REGISTER(0xE000E014) = 168000 - 1;
  REGISTER(0xE000E018) = 0;
  REGISTER(0xE000E010) = 7;
#endif
}

static int64_t Now(void) { return (int64_t)tick_count * kTickNs; }

/* ---------------------------------------------------------------------------------------------------- board */

static void StartClock(void) {
  REGISTER(RCC) |= BIT(16);
  while ((REGISTER(RCC) & BIT(17)) == 0) {
  }
  REGISTER(RCC + 0x4) = 7u << 24 | BIT(22) | 336u << 6 | 8u;
  REGISTER(RCC) |= BIT(24);
  while ((REGISTER(RCC) & BIT(25)) == 0) {
  }
  REGISTER(0x40023C00) = BIT(8) | BIT(9) | BIT(10) | 5u;
  REGISTER(RCC + 0x8) = 5u << 10 | 4u << 13 | 2u;
  while ((REGISTER(RCC + 0x8) & 0xC) != 8) {
  }
}

static void StartUsarts(void) {
  REGISTER(RCC + 0x40) |= BIT(17) | BIT(18);
  for (int uart = 0; uart < 2; ++uart) {
    USART_BRR(kUsarts[uart]) = 46; /* 42 MHz / 921600 */
    USART_CR1(kUsarts[uart]) = BIT(13) | BIT(3) | BIT(2) | FORMAT;
  }
  StartReceivers();
}

static int64_t Transmit(void* context, int uart, int64_t now_ns, const uint8_t* bytes, size_t count) {
  (void)context;
  if (uart == TILTPROOF_UART_MAIN) Send(bytes, count);
  return now_ns + (int64_t)count * kByteNs;
}

void* calloc(size_t count, size_t size) {
  static _Alignas(8) uint8_t memory[4096];
  return count * size <= sizeof(memory) ? memory : NULL; /* called once */
}
void free(void* memory) { (void)memory; }

int main(void) {
  StartClock();
  StartUsarts();
  StartTicks();
  const TiltproofHost host = {.abi_version = TILTPROOF_CLIENT_ABI_VERSION,
                              .firmware = "driver",
                              .dialect = "paper",
                              .transmit = Transmit};
  while (tick_count == 0) {
  }
  TiltproofClient* client = tiltproof_client_create(&host);
  int64_t wake_ns = tiltproof_client_start(client, Now());
  for (;;) {
#if DRIVER == POLLED
    (void)wake_ns;
    Receive(0);
    Receive(1);
#else
    __asm volatile("cpsid i" ::: "memory");
    if (rings[0].written == rings[0].read && rings[1].written == rings[1].read && Now() < wake_ns)
      __asm volatile("wfi" ::: "memory");
    __asm volatile("cpsie i\n\tisb" ::: "memory");
#endif
    for (int uart = 0; uart < 2; ++uart) {
      uint8_t byte;
      while (Take(&rings[uart], &byte)) tiltproof_client_receive(client, uart, Now(), &byte, 1);
    }
    wake_ns = tiltproof_client_grant(client, Now());
  }
}

/* ------------------------------------------------------------------------------------------------- start-up */

extern uint32_t _estack, _sdata, _edata, _sbss, _ebss;
extern const uint32_t _sidata;

void Reset_Handler(void) {
  REGISTER(0xE000ED88) |= 0xFu << 20; /* floating point on */
  __asm volatile("dsb\n\tisb" ::: "memory");
  const uint32_t* from = &_sidata;
  for (uint32_t* to = &_sdata; to != &_edata;) *to++ = *from++;
  for (uint32_t* to = &_sbss; to != &_ebss;) *to++ = 0;
  main();
}

static void Fault(void) {
  for (;;) {
  }
}

__attribute__((section(".vectors"), used)) static void (*const vectors[16 + 82])(void) = {
    [0] = (void (*)(void)) & _estack,
    [1] = Reset_Handler,
    [2] = Fault,
    [3] = Fault,
    [15] = SysTick_Handler,
    [16 + 12] = DMA1_Stream1_IRQHandler,
    [16 + 16] = DMA1_Stream5_IRQHandler,
    [16 + 17] = DMA1_Stream6_IRQHandler,
    [16 + 38] = USART2_IRQHandler,
    [16 + 39] = USART3_IRQHandler,
    [16 + 54] = TIM6_IRQHandler,
};
