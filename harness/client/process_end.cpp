// Ways for code in this process to end it, by a signal, too, or to put another program in its place. Functions of a program bind before
// those of its libraries: a firmware library that calls them ends the call that it is in, and the flight is kept. For
// everybody else, and in processes that the firmware starts, they are what they always were.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "harness/client/code_place.h"
#include "harness/client/firmware_guard.h"

using tiltproof::harness::FirmwareGuard;

namespace {

constexpr std::size_t kTextBytes = 300;

void EndCallWithCode(const char* function, int code) {
  char text[kTextBytes];
  std::snprintf(text, sizeof text, "called %s(%d)", function, code);
  FirmwareGuard::EndCall(text);
}

void EndCallWithProgram(const char* program) {
  char text[kTextBytes];
  std::snprintf(text, sizeof text, "called exec (%.200s)", program == nullptr ? "" : program);
  FirmwareGuard::EndCall(text);
}

// A signal that would end this process, unless the firmware handles it itself. Those of a crash have handlers
// (FirmwareGuard), and a process that stops is seen from outside.
bool WouldEndProcess(int number) {
  constexpr std::array kOfOthers = {SIGTERM, SIGINT, SIGHUP, SIGQUIT, SIGKILL};
  if (std::find(kOfOthers.begin(), kOfOthers.end(), number) == kOfOthers.end()) return false;
  if (number == SIGKILL) return true;
  struct sigaction present {};
  if (sigaction(number, nullptr, &present) != 0) return false;
  Dl_info info{};
  // Ours, or the default.
  return (present.sa_flags & SA_SIGINFO) != 0 || present.sa_handler == SIG_DFL ||
         dladdr(reinterpret_cast<void*>(present.sa_handler), &info) == 0 ||
         !FirmwareGuard::IsFirmwares(info.dli_fbase);
}

void EndCallWithSignal(const char* function, int number) {
  if (!WouldEndProcess(number)) return;
  const char* const name = sigabbrev_np(number);
  char text[kTextBytes];
  std::snprintf(text, sizeof text, "raised SIG%s in its process (%s)", name == nullptr ? "?" : name,
                function);
  FirmwareGuard::EndCall(text);
}

// The function of this name in the libraries that follow.
template <class Function>
Function* Next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

// A list of arguments that ends with a null pointer.
std::vector<char*> Collect(const char* first, va_list& rest) {
  std::vector<char*> arguments;
  for (const char* word = first; word != nullptr; word = va_arg(rest, const char*))
    arguments.push_back(const_cast<char*>(word));
  arguments.push_back(nullptr);
  return arguments;
}

}  // namespace

// The functions that do not return are declared so in <stdlib.h> and others.
extern "C" {

// The C library's names.
// NOLINTBEGIN(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl50-cpp,cert-dcl51-cpp,readability-identifier-naming)

void exit(int code) noexcept {
  EndCallWithCode("exit", code);
  Next<void(int)>("exit")(code);
  abort();
}
void quick_exit(int code) noexcept {
  EndCallWithCode("quick_exit", code);
  Next<void(int)>("quick_exit")(code);
  abort();
}
void _exit(int code) {
  EndCallWithCode("_exit", code);
  for (;;) syscall(SYS_exit_group, code);
}
void _Exit(int code) noexcept {
  EndCallWithCode("_Exit", code);
  for (;;) syscall(SYS_exit_group, code);
}
void pthread_exit(void* value) {
  FirmwareGuard::EndCall("called pthread_exit");
  Next<void(void*)>("pthread_exit")(value);
  abort();
}

// Compilers call it (-fstack-protector) when the guard of a function's frame has another value at its end.
void __stack_chk_fail() {
  tiltproof::harness::CodePlace place;
  tiltproof::harness::FindCode(tiltproof::harness::CallBefore(__builtin_return_address(0)), place);
  FirmwareGuard::EndCall("damaged a stack guard (Aborted: *** stack smashing detected ***)", place);
  Next<void()>("__stack_chk_fail")();
  abort();
}

int raise(int number) noexcept {
  EndCallWithSignal("raise", number);
  return static_cast<int>(syscall(SYS_tgkill, getpid(), syscall(SYS_gettid), number));
}
int kill(pid_t process, int number) noexcept {
  // Also with its whole group, or with all that it may reach.
  if (process == getpid() || process == 0 || process == -1 || process == -getpgrp())
    EndCallWithSignal("kill", number);
  return static_cast<int>(syscall(SYS_kill, process, number));
}
int killpg(pid_t group, int number) noexcept { return kill(group == 0 ? 0 : -group, number); }
int sigqueue(pid_t process, int number, const union sigval value) noexcept {
  if (process == getpid()) EndCallWithSignal("sigqueue", number);
  return Next<int(pid_t, int, union sigval)>("sigqueue")(process, number, value);
}
int tgkill(pid_t process, pid_t thread, int number) {
  if (process == getpid()) EndCallWithSignal("tgkill", number);
  return static_cast<int>(syscall(SYS_tgkill, process, thread, number));
}
int pthread_kill(pthread_t thread, int number) noexcept {
  EndCallWithSignal("pthread_kill", number);
  return Next<int(pthread_t, int)>("pthread_kill")(thread, number);
}

int execve(const char* path, char* const arguments[], char* const environment[]) noexcept {
  EndCallWithProgram(path);
  return static_cast<int>(syscall(SYS_execve, path, arguments, environment));
}
int execv(const char* path, char* const arguments[]) noexcept { return execve(path, arguments, environ); }
int fexecve(int descriptor, char* const arguments[], char* const environment[]) noexcept {
  EndCallWithProgram("fexecve");
  return static_cast<int>(syscall(SYS_execveat, descriptor, "", arguments, environment, AT_EMPTY_PATH));
}
int execvpe(const char* file, char* const arguments[], char* const environment[]) noexcept {
  EndCallWithProgram(file);
  return Next<int(const char*, char* const*, char* const*)>("execvpe")(file, arguments, environment);
}
int execvp(const char* file, char* const arguments[]) noexcept { return execvpe(file, arguments, environ); }
int execl(const char* path, const char* first, ...) noexcept {
  va_list rest;
  va_start(rest, first);
  const std::vector<char*> arguments = Collect(first, rest);
  va_end(rest);
  return execve(path, arguments.data(), environ);
}
int execlp(const char* file, const char* first, ...) noexcept {
  va_list rest;
  va_start(rest, first);
  const std::vector<char*> arguments = Collect(first, rest);
  va_end(rest);
  return execvpe(file, arguments.data(), environ);
}
int execle(const char* path, const char* first, ...) noexcept {
  va_list rest;
  va_start(rest, first);
  const std::vector<char*> arguments = Collect(first, rest);
  char* const* const environment = va_arg(rest, char* const*);
  va_end(rest);
  return execve(path, arguments.data(), environment);
}

// NOLINTEND(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl50-cpp,cert-dcl51-cpp,readability-identifier-naming)

}  // extern "C"
