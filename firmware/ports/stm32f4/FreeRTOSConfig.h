/* FreeRTOS (V11, port ARM_CM4F) for the images freertos-*.elf. Everything is static: no heap is linked. */
#ifndef FREERTOS_CONFIG_H
#define FREERTOS_CONFIG_H

#include <stdint.h>

/* Clock: SysTick from the core clock, 1 kHz, on the board and in the emulator. */
#define configCPU_CLOCK_HZ 168000000UL
#define configTICK_RATE_HZ 1000U
#define configTICK_TYPE_WIDTH_IN_BITS TICK_TYPE_WIDTH_32_BITS

#define configUSE_PREEMPTION 1
#define configUSE_TIME_SLICING 0 /* no two tasks share a priority */
#define configUSE_PORT_OPTIMISED_TASK_SELECTION 1
#define configMAX_PRIORITIES 5       /* idle, and one a task */
#define configMINIMAL_STACK_SIZE 192 /* words; the idle task's, which also prints the statistics */
#define configMAX_TASK_NAME_LEN 16
#define configUSE_TASK_NOTIFICATIONS 1
#define configUSE_IDLE_HOOK 1 /* sleeps */
#define configUSE_TICK_HOOK 0
#define configUSE_MUTEXES 0
#define configUSE_TIMERS 0
#define configENABLE_BACKWARD_COMPATIBILITY 0

#define configSUPPORT_STATIC_ALLOCATION 1
#define configSUPPORT_DYNAMIC_ALLOCATION 0

#define INCLUDE_vTaskDelay 1

/* Interrupts: the chip has 4 priority bits. Those from 5 on may call the kernel (the USARTs: 6), the kernel's own
 * are the least urgent. */
#define configPRIO_BITS 4
#define configKERNEL_INTERRUPT_PRIORITY (15 << (8 - configPRIO_BITS))
#define configMAX_SYSCALL_INTERRUPT_PRIORITY (5 << (8 - configPRIO_BITS))
#define vPortSVCHandler SVC_Handler
#define xPortPendSVHandler PendSV_Handler
/* SysTick_Handler is main_freertos.cpp's: it counts, then calls xPortSysTickHandler. */

/* Whatever is broken: record it and reset. */
#ifdef __cplusplus
extern "C"
#endif
    void
    FailAssertion(void);
#define configASSERT(condition) \
  do {                          \
    if (!(condition)) {         \
      FailAssertion();          \
    }                           \
  } while (0)
#define configCHECK_FOR_STACK_OVERFLOW 2

#endif
