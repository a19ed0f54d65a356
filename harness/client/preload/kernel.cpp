#include "harness/client/preload/kernel.h"

#include <elf.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <sys/auxv.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <iterator>

asm(R"(
  .text
  .globl tiltproof_kernel
  .hidden tiltproof_kernel
  .type tiltproof_kernel, @function
tiltproof_kernel:
  mov %rdi, %rax
  mov %rsi, %rdi
  mov %rdx, %rsi
  mov %rcx, %rdx
  mov %r8, %r10
  mov %r9, %r8
  mov 8(%rsp), %r9
  syscall
  .globl tiltproof_kernel_end
  .hidden tiltproof_kernel_end
tiltproof_kernel_end:
  ret
  .size tiltproof_kernel, . - tiltproof_kernel
)");
extern "C" const char tiltproof_kernel_end[];

namespace tiltproof::preload {
namespace {

constexpr int kFromFilter = 1;  // SYS_SECCOMP of the kernel

Trap trap;

// Layout of the kernel, not of the C library.
struct KernelAction {
  void* handler;
  unsigned long flags;
  void* restorer;
  std::uint64_t mask;
};
KernelAction segment_action = {};

// Calls that wait, that tell the time, that name a port, or that the clock cannot hold.
constexpr int kTrapped[] = {
    SYS_read,
    SYS_write,
    SYS_readv,
    SYS_writev,
    SYS_open,
    SYS_openat,
    SYS_close,
    SYS_dup,
    SYS_dup2,
    SYS_dup3,
    SYS_fcntl,
    SYS_ioctl,
    SYS_poll,
    SYS_ppoll,
    SYS_select,
    SYS_pselect6,
    SYS_epoll_wait,
    SYS_epoll_pwait,
    SYS_epoll_pwait2,
    SYS_nanosleep,
    SYS_clock_nanosleep,
    SYS_clock_gettime,
    SYS_gettimeofday,
    SYS_time,
    SYS_times,
    SYS_sysinfo,
    SYS_clock_settime,
    SYS_settimeofday,
    SYS_clock_adjtime,
    SYS_adjtimex,
    SYS_futex,
    SYS_futex_waitv,
    SYS_sched_yield,
    SYS_pause,
    SYS_alarm,
    SYS_getitimer,
    SYS_setitimer,
    SYS_timer_create,
    SYS_timer_settime,
    SYS_timer_gettime,
    SYS_timer_delete,
    SYS_timer_getoverrun,
    SYS_timerfd_create,
    SYS_timerfd_settime,
    SYS_timerfd_gettime,
    SYS_rt_sigprocmask,
    SYS_rt_sigaction,
    SYS_rt_sigtimedwait,
    SYS_rt_sigsuspend,
    SYS_recvfrom,
    SYS_recvmsg,
    SYS_recvmmsg,
    SYS_accept,
    SYS_accept4,
    SYS_getrandom,
    SYS_fork,
    SYS_vfork,
    SYS_execve,
    SYS_execveat,
    SYS_exit,
    SYS_exit_group,
    SYS_tgkill,
    SYS_kill,
    SYS_rt_sigqueueinfo,
    SYS_socket,
    SYS_mq_open,
    SYS_mq_timedreceive,
    SYS_mq_timedsend,
    SYS_semtimedop,
    SYS_semop,
    SYS_msgrcv,
    SYS_io_uring_setup,
    SYS_io_getevents,
    SYS_io_pgetevents,
    SYS_close_range,
    SYS_stat,
    SYS_lstat,
    SYS_newfstatat,
    SYS_statx,
    SYS_access,
    SYS_faccessat,
    SYS_faccessat2,
    SYS_readlink,
    SYS_readlinkat,
};

constexpr sock_filter Load(std::size_t offset) {
  return BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset));
}
constexpr sock_filter Give(std::uint32_t action) { return BPF_STMT(BPF_RET | BPF_K, action); }
constexpr sock_filter IfEqual(std::uint32_t value, std::uint8_t then, std::uint8_t otherwise) {
  return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, then, otherwise);
}

void OnTrap(int, siginfo_t* info, void* raw) {
  auto* context = static_cast<ucontext_t*>(raw);
  if (info->si_code == SI_TIMER) trap.tick();
  if (info->si_code != kFromFilter) return;
  auto& registers = context->uc_mcontext.gregs;
  const Call call = {info->si_arch == AUDIT_ARCH_X86_64 ? info->si_syscall : -1,
                     {registers[REG_RDI], registers[REG_RSI], registers[REG_RDX], registers[REG_R10],
                      registers[REG_R8], registers[REG_R9]},
                     context};
  registers[REG_RAX] = trap.call(call);
}

// A crash, or the cycle counter (rdtsc, rdtscp). The kernel's own reason is that an instruction is forbidden, which has been read
// then; with any other, the program may have jumped nowhere.
void OnSegment(int, siginfo_t* info, void* raw) {
  const auto* context = static_cast<const ucontext_t*>(raw);
  const auto* code = reinterpret_cast<const unsigned char*>(context->uc_mcontext.gregs[REG_RIP]);
  if (info->si_code == SI_KERNEL && code[0] == 0x0f &&
      (code[1] == 0x31 || (code[1] == 0x01 && code[2] == 0xf9)))
    trap.cycles();
  // The instruction runs again and crashes as the program wanted it.
  Kernel(SYS_rt_sigaction, SIGSEGV, &segment_action, nullptr, sizeof segment_action.mask);
  // There is no instruction where a process has sent the signal, as the handler of a sanitizer does.
  if (info->si_code <= 0)
    Kernel(SYS_rt_tgsigqueueinfo, Kernel(SYS_getpid), Kernel(SYS_gettid), SIGSEGV, info);
}

// Sets a handler that no signal interrupts, not even those that the C library keeps for itself (pthread_cancel()).
void Handle(int signal, void (*handler)(int, siginfo_t*, void*), KernelAction* old) {
  KernelAction set;
  if (old != nullptr) Kernel(SYS_rt_sigaction, signal, nullptr, old, sizeof set.mask);
  // The C library knows how to return from a signal handler.
  struct sigaction action = {};
  action.sa_sigaction = handler;
  action.sa_flags = SA_SIGINFO | SA_RESTART;
  sigaction(signal, &action, nullptr);
  Kernel(SYS_rt_sigaction, signal, nullptr, &set, sizeof set.mask);
  set.mask = ~0ULL;
  Kernel(SYS_rt_sigaction, signal, &set, nullptr, sizeof set.mask);
}

const char* SetFilter() {
  constexpr std::size_t kCalls = std::size(kTrapped);
  static sock_filter program[kCalls + 24];
  std::size_t size = 0;
  const auto add = [&size](sock_filter step) { program[size++] = step; };
  const auto end = reinterpret_cast<std::uint64_t>(&tiltproof_kernel_end);
  add(Load(offsetof(seccomp_data, arch)));
  add(IfEqual(AUDIT_ARCH_X86_64, 1, 0));
  add(Give(SECCOMP_RET_TRAP));
  add(Load(offsetof(seccomp_data, instruction_pointer)));
  add(IfEqual(static_cast<std::uint32_t>(end), 0, 3));
  add(Load(offsetof(seccomp_data, instruction_pointer) + 4));
  add(IfEqual(static_cast<std::uint32_t>(end >> 32), 0, 1));
  add(Give(SECCOMP_RET_ALLOW));
  add(Load(offsetof(seccomp_data, nr)));
  // The C library then uses clone, of which the filter sees the flags.
  add(IfEqual(SYS_clone3, 0, 1));
  add(Give(SECCOMP_RET_ERRNO | ENOSYS));
  add(IfEqual(SYS_clone, 0, 4));
  add(Load(offsetof(seccomp_data, args)));
  add(BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, CLONE_THREAD, 0, 1));
  add(Give(SECCOMP_RET_ALLOW));
  add(Give(SECCOMP_RET_TRAP));
  for (std::size_t i = 0; i < kCalls; ++i)
    add(IfEqual(static_cast<std::uint32_t>(kTrapped[i]), static_cast<std::uint8_t>(kCalls - i), 0));
  add(Give(SECCOMP_RET_ALLOW));
  add(Give(SECCOMP_RET_TRAP));
  sock_fprog filter = {static_cast<unsigned short>(size), program};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) != 0)
    return "the kernel refuses a filter for system calls (seccomp)";
  return nullptr;
}

bool Replace(int memory, const char* page, std::uint64_t offset, const void* function) {
  // movabs rax, function; jmp rax
  unsigned char code[12] = {0x48, 0xb8, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xe0};
  std::memcpy(code + 2, &function, sizeof function);
  return pwrite(memory, code, sizeof code, reinterpret_cast<off_t>(page + offset)) == sizeof code;
}

}  // namespace

const char* SetTrap(const Trap& wanted) {
  trap = wanted;
  Handle(SIGSYS, OnTrap, nullptr);
  Handle(SIGSEGV, OnSegment, &segment_action);
  sigset_t own;
  sigemptyset(&own);
  sigaddset(&own, SIGSYS);
  sigprocmask(SIG_UNBLOCK, &own, nullptr);
  if (prctl(PR_SET_TSC, PR_TSC_SIGSEGV) != 0) return "the kernel cannot watch the processor's cycle counter";
  sigevent event = {};
  event.sigev_notify = SIGEV_SIGNAL;
  event.sigev_signo = SIGSYS;
  timer_t timer;
  const itimerspec each_second = {{1, 0}, {1, 0}};
  if (timer_create(CLOCK_PROCESS_CPUTIME_ID, &event, &timer) != 0 ||
      timer_settime(timer, 0, &each_second, nullptr) != 0)
    return "the kernel gives no timer of processor time";
  return SetFilter();
}

const char* ReplaceSharedPage(int (*clock_gettime)(int, void*), int (*gettimeofday)(void*, void*),
                              long (*time)(long*)) {
  const auto* page = reinterpret_cast<const char*>(getauxval(AT_SYSINFO_EHDR));
  if (page == nullptr) return nullptr;  // none: every reading of the clock is a system call
  const auto* header = reinterpret_cast<const Elf64_Ehdr*>(page);
  const auto* sections = reinterpret_cast<const Elf64_Shdr*>(page + header->e_shoff);
  const int memory = open("/proc/self/mem", O_RDWR | O_CLOEXEC);
  int replaced = 0;
  for (int i = 0; memory >= 0 && i < header->e_shnum; ++i) {
    if (sections[i].sh_type != SHT_DYNSYM) continue;
    const auto* symbols = reinterpret_cast<const Elf64_Sym*>(page + sections[i].sh_offset);
    const char* names = page + sections[sections[i].sh_link].sh_offset;
    for (std::size_t k = 0; k < sections[i].sh_size / sizeof *symbols; ++k) {
      const char* name = names + symbols[k].st_name;
      const void* function =
          std::strcmp(name, "__vdso_clock_gettime") == 0  ? reinterpret_cast<const void*>(clock_gettime)
          : std::strcmp(name, "__vdso_gettimeofday") == 0 ? reinterpret_cast<const void*>(gettimeofday)
          : std::strcmp(name, "__vdso_time") == 0         ? reinterpret_cast<const void*>(time)
                                                          : nullptr;
      if (function != nullptr && Replace(memory, page, symbols[k].st_value, function)) ++replaced;
    }
  }
  if (memory >= 0) close(memory);
  return replaced == 3 ? nullptr : "the kernel's clock page (vDSO) cannot be replaced";
}

long SetSegmentAction(const void* action, void* old) {
  const KernelAction before = segment_action;
  if (action != nullptr) std::memcpy(&segment_action, action, sizeof segment_action);
  if (old != nullptr) std::memcpy(old, &before, sizeof before);
  return 0;
}

}  // namespace tiltproof::preload
