/* minimal_firmware.c on an STM32F407 Discovery, or its emulation, without a line of tiltproof's: what a board of your
 * own needs below your firmware. Vector table, clock, three USARTs, a millisecond tick, and a loop that sleeps.
 *
 *   USART2 (PA2 TX, PA3 RX)  main line          921600 8N1
 *   USART3 (PD9 RX)          reference line     921600 8N1
 *   USART1 (PB6 TX)          log, for a person  115200 8N1
 *
 * Registers: RM0090 (STM32F405/407 reference manual), PM0214 (Cortex-M4 programming manual).
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "firmware/tiltproof_client.h"

#define REGISTER(address) (*(volatile uint32_t*)(address))
#define BIT(n) (1u << (n))

/* RCC (RM0090, section 7.3), power (5.4), flash (3.9). */
#define RCC_CR REGISTER(0x40023800)
#define RCC_PLLCFGR REGISTER(0x40023804)
#define RCC_CFGR REGISTER(0x40023808)
#define RCC_AHB1ENR REGISTER(0x40023830)
#define RCC_APB1ENR REGISTER(0x40023840)
#define RCC_APB2ENR REGISTER(0x40023844)
#define PWR_CR REGISTER(0x40007000)
#define FLASH_ACR REGISTER(0x40023C00)
/* Pins (8.4): mode, alternate functions of pins 0 to 7 and 8 to 15. */
#define GPIO_A 0x40020000
#define GPIO_B 0x40020400
#define GPIO_D 0x40020C00
#define GPIO_MODER(port) REGISTER((port) + 0x00)
#define GPIO_BSRR(port) REGISTER((port) + 0x18)
#define GPIO_AFRL(port) REGISTER((port) + 0x20)
#define GPIO_AFRH(port) REGISTER((port) + 0x24)
/* USARTs (30.6). */
#define USART1 0x40011000
#define USART2 0x40004400
#define USART3 0x40004800
#define USART_SR(usart) REGISTER((usart) + 0x00)
#define USART_DR(usart) REGISTER((usart) + 0x04)
#define USART_BRR(usart) REGISTER((usart) + 0x08)
#define USART_CR1(usart) REGISTER((usart) + 0x0C)
/* Core (PM0214): SysTick (4.5), interrupt controller (4.3), control block (4.4), floating point (4.6.1). */
#define SYST_CSR REGISTER(0xE000E010)
#define SYST_RVR REGISTER(0xE000E014)
#define SYST_CVR REGISTER(0xE000E018)
#define NVIC_ISER1 REGISTER(0xE000E104)
#define SCB_AIRCR REGISTER(0xE000ED0C)
#define CPACR REGISTER(0xE000ED88)

enum {
  kCoreHz = 168000000,
  kApb1Hz = kCoreHz / 4,
  kApb2Hz = kCoreHz / 2,
  kLineBaud = 921600,
  kConsoleBaud = 115200,
  kTickNs = 1000000,
  kByteNs = 10850, /* 10 bits at 921600 baud */
  kRingBytes = 256,
};

/* --------------------------------------------------------------------------------------------- receivers */

typedef struct {
  uint8_t bytes[kRingBytes];
  volatile unsigned written; /* by the interrupt */
  volatile unsigned read;    /* by the loop */
} Ring;

static Ring rings[2]; /* by UART: TILTPROOF_UART_MAIN, TILTPROOF_UART_REFERENCE */
static volatile uint32_t tick_count;

/* Reading the status, then the byte, also clears an overrun. */
static void Receive(Ring* ring, uint32_t usart) {
  const uint32_t status = USART_SR(usart);
  const uint8_t byte = (uint8_t)USART_DR(usart);
  if ((status & BIT(5)) != 0 && ring->written - ring->read < kRingBytes) {
    ring->bytes[ring->written % kRingBytes] = byte;
    ring->written = ring->written + 1;
  }
}

void USART2_IRQHandler(void) { Receive(&rings[TILTPROOF_UART_MAIN], USART2); }
void USART3_IRQHandler(void) { Receive(&rings[TILTPROOF_UART_REFERENCE], USART3); }
void SysTick_Handler(void) { tick_count = tick_count + 1; }

/* ------------------------------------------------------------------------- what the firmware gets from its board */

static void Send(uint32_t usart, const uint8_t* bytes, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    while ((USART_SR(usart) & BIT(7)) == 0) {
    }
    USART_DR(usart) = bytes[i];
  }
}

static int64_t Transmit(void* context, int uart, int64_t now_ns, const uint8_t* bytes, size_t count) {
  (void)context;
  if (uart == TILTPROOF_UART_MAIN) Send(USART2, bytes, count);
  return now_ns + (int64_t)count * kByteNs;
}

static void Log(void* context, int64_t now_ns, const char* text) {
  (void)context;
  (void)now_ns;
  size_t length = 0;
  while (text[length] != 0) ++length;
  Send(USART1, (const uint8_t*)text, length);
  Send(USART1, (const uint8_t*)"\r\n", 2);
}

/* A board has no heap: the one allocation, which tiltproof_client_create makes, comes from here, and stays. */
void* calloc(size_t count, size_t size) {
  static _Alignas(8) uint8_t memory[4096]; /* 0 from the start */
  static bool taken;
  if (taken || count * size > sizeof(memory)) return NULL;
  taken = true;
  return memory;
}
void free(void* memory) { (void)memory; }

/* ---------------------------------------------------------------------------------------------------- board */

static void Reset(void) {
  SCB_AIRCR = 0x05FA0004; /* key, SYSRESETREQ */
  for (;;) {
  }
}

static void StartClockAndPins(void) {
  RCC_CR |= BIT(16); /* 8 MHz crystal */
  while ((RCC_CR & BIT(17)) == 0) {
  }
  RCC_APB1ENR |= BIT(28);
  PWR_CR |= BIT(14);                                            /* voltage for 168 MHz */
  RCC_PLLCFGR = 7u << 24 | BIT(22) | 0u << 16 | 336u << 6 | 8u; /* 8 MHz / 8 * 336 / 2 */
  RCC_CR |= BIT(24);
  while ((RCC_CR & BIT(25)) == 0) {
  }
  FLASH_ACR = BIT(8) | BIT(9) | BIT(10) | 5u; /* caches, 5 wait states */
  RCC_CFGR = 5u << 10 | 4u << 13 | 2u;        /* APB1 / 4, APB2 / 2, from the PLL */
  while ((RCC_CFGR & (3u << 2)) != 2u << 2) {
  }
  RCC_AHB1ENR |= BIT(0) | BIT(1) | BIT(3); /* GPIO A, B, D */
  RCC_APB1ENR |= BIT(17) | BIT(18);        /* USART2, USART3 */
  RCC_APB2ENR |= BIT(4);                   /* USART1 */
  /* Alternate function 7; these pins' modes are 0 after a reset. */
  GPIO_AFRL(GPIO_A) |= 7u << 8 | 7u << 12;
  GPIO_MODER(GPIO_A) |= 2u << 4 | 2u << 6;
  GPIO_AFRH(GPIO_D) |= 7u << 4;
  GPIO_BSRR(GPIO_D) = BIT(4 + 16); /* PD4 low: the audio codec on PB6 stays in reset */
  GPIO_MODER(GPIO_D) |= 2u << 18 | 1u << 8;
  GPIO_AFRL(GPIO_B) |= 7u << 24;
  GPIO_MODER(GPIO_B) |= 2u << 12;
}

static void StartUsartsAndTicks(void) {
  USART_BRR(USART1) = (kApb2Hz + kConsoleBaud / 2) / kConsoleBaud;
  USART_BRR(USART2) = (kApb1Hz + kLineBaud / 2) / kLineBaud;
  USART_BRR(USART3) = (kApb1Hz + kLineBaud / 2) / kLineBaud;
  USART_CR1(USART1) = BIT(13) | BIT(3);                   /* on, sends */
  USART_CR1(USART2) = BIT(13) | BIT(3) | BIT(2) | BIT(5); /* on, sends, receives with interrupt */
  USART_CR1(USART3) = BIT(13) | BIT(2) | BIT(5);          /* on, receives with interrupt */
  NVIC_ISER1 = BIT(38 - 32) | BIT(39 - 32);
  SYST_RVR = kCoreHz / 1000 - 1;
  SYST_CVR = 0;
  SYST_CSR = BIT(2) | BIT(1) | BIT(0); /* core clock, interrupt, on */
}

/* Time is that of the last tick: what is due at t begins at the first tick at or after it. */
static int64_t Now(void) { return (int64_t)tick_count * kTickNs; }

static bool Received(void) { return rings[0].written != rings[0].read || rings[1].written != rings[1].read; }

int main(void) {
  StartClockAndPins();
  StartUsartsAndTicks();
  while (tick_count == 0) {
  }
  const TiltproofHost host = {.abi_version = TILTPROOF_CLIENT_ABI_VERSION,
                              .firmware = "minimal_c",
                              .dialect = "paper",
                              .transmit = Transmit,
                              .log = Log};
  TiltproofClient* client = tiltproof_client_create(&host);
  if (client == NULL) Reset();
  int64_t wake_ns = tiltproof_client_start(client, Now());
  for (;;) {
    /* Interrupts are off from the question to the sleep; one that is pending ends the sleep at once. */
    __asm volatile("cpsid i" ::: "memory");
    if (!Received() && Now() < wake_ns) __asm volatile("wfi" ::: "memory");
    __asm volatile("cpsie i\n\tisb" ::: "memory");
    for (int uart = 0; uart < 2; ++uart) {
      Ring* ring = &rings[uart];
      while (ring->read != ring->written) {
        const uint8_t byte = ring->bytes[ring->read % kRingBytes];
        ring->read = ring->read + 1;
        tiltproof_client_receive(client, uart, Now(), &byte, 1);
      }
    }
    wake_ns = tiltproof_client_grant(client, Now());
  }
}

/* ------------------------------------------------------------------------------------------------- start-up */

extern uint32_t _estack, _sdata, _edata, _sbss, _ebss;
extern const uint32_t _sidata;

void Reset_Handler(void) {
  CPACR |= 0xFu << 20; /* floating point on */
  __asm volatile("dsb\n\tisb" ::: "memory");
  const uint32_t* from = &_sidata;
  for (uint32_t* to = &_sdata; to != &_edata;) *to++ = *from++;
  for (uint32_t* to = &_sbss; to != &_ebss;) *to++ = 0;
  main();
}

/* RM0090, table 62. An interrupt or fault without a handler starts the board again. */
__attribute__((section(".vectors"), used)) static void (*const vectors[16 + 40])(void) = {
    [0] = (void (*)(void)) & _estack,
    [1] = Reset_Handler,
    [2] = Reset,
    [3] = Reset,
    [4] = Reset,
    [5] = Reset,
    [6] = Reset,
    [15] = SysTick_Handler,
    [16 + 38] = USART2_IRQHandler,
    [16 + 39] = USART3_IRQHandler,
};
