// The virtual serial ports of the program: what it opens, reads, writes and sets there.
//
// A port is one end of a socket pair, so that poll(), select() and epoll work in the kernel. The other end is this module's: it
// puts the bytes in when they arrive. What the program writes goes to the harness at once.
//
//   if (const int uart = PortOf(descriptor); uart >= 0) WritePort(uart, parts, 1);
#pragma once

#include <sys/uio.h>
#include <ucontext.h>

#include <cstddef>

namespace tiltproof::preload {

// The path of each UART's port, which need not exist. Returns null, or what went wrong.
const char* MakePorts(const char* path, const char* reference_path);
// Bytes that have arrived. Those for a port that is not open are lost, as are those that find it full.
void ReceiveBytes(int uart, const unsigned char* bytes, std::size_t count);

// The UART behind a descriptor; -1: it is no port.
int PortOf(long descriptor);
// True: the path is that of a port.
bool IsPortPath(const char* path);
// Opens the port if the path is one; -1: it is none.
long OpenPort(const char* path, int flags);
// The program has a copy of a descriptor, or has closed it.
void NoteCopy(long from, long copy);
void NoteClosed(long descriptor);

long WritePort(int uart, const iovec* parts, int count);
// As a terminal without line editing: VMIN and VTIME hold.
long ReadPort(int uart, long descriptor, const iovec* parts, int count, ucontext_t* context);
// Terminal settings. -ENOTTY for what a serial port does not have; kNotOfPort: the kernel's answer is right.
inline constexpr long kNotOfPort = -4096;
long ControlPort(int uart, unsigned long request, void* argument, ucontext_t* context);

}  // namespace tiltproof::preload
