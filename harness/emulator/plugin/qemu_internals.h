// The parts of QEMU 7.2 that the plug-in uses: its public plug-in interface (version 1), and internal functions and
// layouts. Debian's qemu-system-arm exports the internal ones, but they are not part of any interface. The harness
// therefore starts the plug-in only in 7.2.x and tests it first (harness/emulator/lockstep_self_test.h).
//
// Names and signatures are QEMU's: include/qemu/qemu-plugin.h, include/qemu/timer.h, include/hw/clock.h,
// include/exec/memory.h, include/exec/exec-all.h, target/arm/cpu.h, include/hw/core/cpu.h, include/qemu/notify.h, include/qemu/main-loop.h, include/sysemu/runstate.h,
// softmmu/timers-state.h of the release 7.2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>

extern "C" {

// The public interface.
using qemu_plugin_id_t = std::uint64_t;
struct qemu_info_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, qemu_plugin_tb*));
void qemu_plugin_register_vcpu_insn_exec_cb(qemu_plugin_insn*, void (*)(unsigned, void*), int flags, void*);
void qemu_plugin_register_vcpu_tb_exec_cb(qemu_plugin_tb*, void (*)(unsigned, void*), int flags, void*);
std::size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb*);
qemu_plugin_insn* qemu_plugin_tb_get_insn(const qemu_plugin_tb*, std::size_t);
const void* qemu_plugin_insn_data(const qemu_plugin_insn*);
std::size_t qemu_plugin_insn_size(const qemu_plugin_insn*);
std::uint64_t qemu_plugin_insn_vaddr(const qemu_plugin_insn*);

// Objects and devices.
void* object_resolve_path(const char* path, bool* ambiguous);
void* sysbus_mmio_get_region(void* device, int number);
void qemu_register_reset(void (*)(void*), void*);
void qemu_system_reset(int cause);
int vm_stop(int run_state);
void* qemu_add_vm_change_state_handler(void (*)(void*, bool running, int run_state), void*);
struct Notifier {
  void (*notify)(Notifier*, void* data);
  void *next, *previous;
};
void main_loop_poll_add_notifier(Notifier*);
void* qemu_allocate_irq(void (*handler)(void*, int line, int level), void*, int line);
void qdev_connect_gpio_out_named(void* device, const char* name, int line, void* irq);
void* qdev_get_gpio_in(void* device, int number);
void* qdev_get_gpio_in_named(void* device, const char* name, int number);
void qemu_set_irq(void* irq, int level);
void qemu_system_reset_request(int cause);

// Clocks.
void timer_init_full(void* timer, void* list_group, int clock, int scale, int attributes, void (*)(void*),
                     void*);
void timer_mod(void* timer, std::int64_t expire_ns);
void timer_del(void* timer);
std::int64_t qemu_clock_get_ns(int clock);
std::int64_t qemu_clock_deadline_ns_all(int clock, int attribute_mask);
bool qemu_clock_run_timers(int clock);
void qemu_clock_enable(int clock, bool enabled);
extern std::uint8_t timers_state[];
bool clock_set(void* clock, std::uint64_t period);  // in 2^-32 ns; whether that is new
void clock_propagate(void* clock);

// The processor.
void* qemu_get_cpu(int index);
bool all_cpu_threads_idle(void);
bool cpu_work_list_empty(void* cpu);
bool cpu_is_stopped(void* cpu);  // or the machine is
void cpu_single_step(void* cpu, int flags);
union RunOnCpuData {  // run_on_cpu_data
  std::uint64_t target_ptr;
  void* host_ptr;
};
// In helpers and callbacks: ends what has been executed of a block before the code at `host_code`, its return address.
[[noreturn]] void cpu_loop_exit_restore(void* cpu, std::uintptr_t host_code);
// The priority of the handler that runs; kNoHandler: none does.
int armv7m_nvic_raw_execution_priority(void* nvic);
// True if an interrupt is pending that the processor would take now.
bool armv7m_nvic_can_take_pending_exception(void* nvic);
void async_run_on_cpu(void* cpu, void (*)(void* cpu, RunOnCpuData), RunOnCpuData);
void cpu_dump_state(void* cpu, std::FILE*, int flags);
void tb_flush(void* cpu);

// Memory.
void* get_system_memory(void);
void cpu_physical_memory_rw(std::uint64_t address, void* buffer, std::uint64_t size, bool is_write);
void* cpu_get_address_space(void* cpu, int index);
std::uint32_t address_space_rw(void* space, std::uint64_t address, std::uint32_t attributes, void* buffer,
                               std::uint64_t size, bool is_write);
std::uint32_t address_space_write_rom(void* space, std::uint64_t address, std::uint32_t attributes,
                                      const void* buffer, std::uint64_t size);
void memory_region_init_io(void* region, void* owner, const void* ops, void* opaque, const char* name,
                           std::uint64_t size);
void memory_region_init_ram_nomigrate(void* region, void* owner, const char* name, std::uint64_t size,
                                      void** error);
void memory_region_add_subregion_overlap(void* region, std::uint64_t offset, void* subregion, int priority);
int memory_region_dispatch_read(void* region, std::uint64_t address, std::uint64_t* value, int mem_op,
                                std::uint32_t attributes);
int memory_region_dispatch_write(void* region, std::uint64_t address, std::uint64_t value, int mem_op,
                                 std::uint32_t attributes);
}

namespace tiltproof::qemu {

inline constexpr int kClockVirtual = 1;         // QEMU_CLOCK_VIRTUAL
inline constexpr int kScaleNs = 1;              // SCALE_NS
inline constexpr int kAnyAttribute = ~0;        // QEMU_TIMER_ATTR_ALL
inline constexpr int kRunStatePaused = 4;       // RUN_STATE_PAUSED
inline constexpr int kCauseSystemReset = 3;     // SHUTDOWN_CAUSE_HOST_QMP_SYSTEM_RESET
inline constexpr int kCauseGuestReset = 7;      // SHUTDOWN_CAUSE_GUEST_RESET
inline constexpr int kNoHandler = 0x100;        // NVIC_NOEXC_PRIO
inline constexpr int kMemOp32LittleEndian = 2;  // MO_32 | MO_LE

// struct TimersState.
inline constexpr std::size_t kIcountShiftOffset = 26;  // icount_time_shift, int16
inline constexpr std::size_t kIcountBiasOffset = 40;   // qemu_icount_bias, int64 ns

// struct CPUState and ARMCPU.
inline constexpr std::size_t kSingleStepOffset = 0xDC;   // singlestep_enabled, int
inline constexpr std::size_t kCanDoIoOffset = 0x300;     // can_do_io, uint32
inline constexpr std::size_t kCountLeftOffset = 0x1E60;  // neg.icount_decr.u16.low
inline constexpr std::size_t kRegistersOffset = 0x1E70;  // env.regs, uint32[16]

// More than QEMUTimer (56 bytes) and MemoryRegion (272 bytes) take.
inline constexpr std::size_t kTimerBytes = 256;
inline constexpr std::size_t kMemoryRegionBytes = 4096;

// struct MemoryRegionOps.
struct MemoryRegionOps {
  std::uint64_t (*read)(void* opaque, std::uint64_t address, unsigned size);
  void (*write)(void* opaque, std::uint64_t address, std::uint64_t value, unsigned size);
  std::uint32_t (*read_with_attrs)(void* opaque, std::uint64_t address, std::uint64_t* value, unsigned size,
                                   std::uint32_t attributes) = nullptr;
  std::uint32_t (*write_with_attrs)(void* opaque, std::uint64_t address, std::uint64_t value, unsigned size,
                                    std::uint32_t attributes) = nullptr;
  int endianness = 2;  // DEVICE_LITTLE_ENDIAN
  struct {
    unsigned min_access_size = 0, max_access_size = 0;
    bool unaligned = false;
    void* accepts = nullptr;
  } valid;
  struct {
    unsigned min_access_size = 1, max_access_size = 4;
    bool unaligned = false;
  } impl;
};

}  // namespace tiltproof::qemu
