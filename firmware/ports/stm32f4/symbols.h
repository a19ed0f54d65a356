/* What an image shows in its ELF symbol table for others to read and write in RAM: the harness, a debugger, a tool
 * that flips bits. Names and layouts are fixed; all fields are 32-bit little endian.
 *
 * Also there by name: flight_application (or with FreeRTOS sensor_cycle, control_activity, actuator_writer,
 * reference_receiver), main_receive_ring, main_transmit_ring, reference_receive_ring, console_transmit_ring, the
 * main stack [_sstack, _estack), with FreeRTOS <task>_stack, and the sections [_sdata, _edata), [_sbss, _ebss).
 */
#ifndef TILTPROOF_STM32F4_SYMBOLS_H
#define TILTPROOF_STM32F4_SYMBOLS_H

#include <stdint.h>

#include "firmware/tiltproof_client.h"

#ifdef __cplusplus
extern "C" {
#endif

/* As tiltproof_client_status() gives it; written once a wake-up. An image of your own may have it too. */
extern TiltproofClientStatus tiltproof_status;

#define TILTPROOF_FAULT_MAGIC 0x54504652u /* "TPFR" */

#define TILTPROOF_CAUSE_NONE 0u
#define TILTPROOF_CAUSE_HARD_FAULT 1u
#define TILTPROOF_CAUSE_MEMORY_FAULT 2u
#define TILTPROOF_CAUSE_BUS_FAULT 3u
#define TILTPROOF_CAUSE_USAGE_FAULT 4u
#define TILTPROOF_CAUSE_ASSERT 5u         /* pc: who called */
#define TILTPROOF_CAUSE_STACK_OVERFLOW 6u /* pc: who found it */
#define TILTPROOF_CAUSE_UNEXPECTED_INTERRUPT 7u

/* In RAM that a reset leaves alone; valid while `magic` is TILTPROOF_FAULT_MAGIC. */
typedef struct {
  uint32_t magic;
  uint32_t cause; /* of the last fault */
  uint32_t pc;    /* 0: the stack was gone */
  uint32_t lr;
  uint32_t xpsr;
  uint32_t cfsr; /* PM0214, section 4.4.10 */
  uint32_t hfsr;
  uint32_t mmfar;
  uint32_t bfar;
  uint32_t count;          /* faults since power-on */
  uint32_t reported_count; /* how many of them stand on the console */
} TiltproofFaultRecord;
extern TiltproofFaultRecord tiltproof_fault_record;

typedef struct {
  uint32_t overrun;   /* a byte came before the one before it was read */
  uint32_t framing;   /* no stop bit: the byte was dropped */
  uint32_t noise;     /* samples of a bit differed: the byte was taken */
  uint32_t ring_full; /* the ring was not emptied: the byte was dropped */
} TiltproofReceiveErrorCounts;
typedef struct {
  TiltproofReceiveErrorCounts main;
  TiltproofReceiveErrorCounts reference;
} TiltproofReceiveErrors;
extern TiltproofReceiveErrors tiltproof_receive_errors;

#define TILTPROOF_STACKS_MAX 6
typedef struct {
  char name[16]; /* "main": interrupts, and everything where there are no tasks; empty: no such stack */
  uint32_t bytes;
  uint32_t used_bytes_max;
} TiltproofStackStatistics;
typedef struct {
  uint32_t wakeups_count; /* to work, not to an interrupt alone */
  uint32_t busy_ns_max;   /* longest stretch of work */
  TiltproofStackStatistics stacks[TILTPROOF_STACKS_MAX];
} TiltproofRunStatistics;
extern TiltproofRunStatistics tiltproof_run_statistics;

#ifdef __cplusplus
}
#endif

#endif
