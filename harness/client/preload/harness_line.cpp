#include "harness/client/preload/harness_line.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "firmware/tiltproof_program.h"
#include "harness/client/preload/kernel.h"

namespace tiltproof::preload {
namespace {

constexpr int kRefusedExit = 97;

int line = -1;
UartRate rates[kUartsMax];

constexpr std::size_t kHeader = TILTPROOF_PROGRAM_HEADER_BYTES;
// A message as long as the protocol allows fits, and what is written ahead of it.
unsigned char in[TILTPROOF_PROGRAM_BODY_BYTES_MAX + 65536];
std::size_t in_size = 0, in_taken = 0;
unsigned char out[65536];
std::size_t out_size = 0;

// Room for a message's body.
unsigned char* Message(int kind, int number, std::size_t body) {
  if (out_size + kHeader + body > sizeof out) Flush();
  unsigned char* at = out + out_size;
  tiltproof_put_u32(at, static_cast<std::uint32_t>(body));
  at[4] = static_cast<unsigned char>(kind);
  at[5] = static_cast<unsigned char>(number);
  at[6] = at[7] = 0;
  out_size += kHeader + body;
  return at + kHeader;
}

// The next message, header first; null: the harness is gone.
const unsigned char* Read() {
  for (;;) {
    const std::size_t left = in_size - in_taken;
    if (left >= kHeader) {
      const std::size_t whole = kHeader + tiltproof_get_u32(in + in_taken);
      if (left >= whole) {
        in_taken += whole;
        return in + in_taken - whole;
      }
      if (whole > sizeof in) return nullptr;
    }
    std::memmove(in, in + in_taken, left);
    in_size = left;
    in_taken = 0;
    const long count = Kernel(SYS_recvfrom, line, in + in_size, sizeof in - in_size, 0, nullptr, nullptr);
    if (count > 0) in_size += static_cast<std::size_t>(count);
    if (count == 0 || (count < 0 && count != -EINTR)) return nullptr;
  }
}

bool ReadHello() {
  const unsigned char* hello = Read();
  if (hello == nullptr || hello[4] != TILTPROOF_PROGRAM_HELLO) return false;
  const std::size_t size = tiltproof_get_u32(hello);
  const unsigned char* at = hello + kHeader;
  if (size < 8 || tiltproof_get_u32(at) < TILTPROOF_PROGRAM_VERSION) return false;
  const std::size_t uarts = tiltproof_get_u32(at + 4);
  for (std::size_t i = 0; i < uarts && i < kUartsMax && 16 + 8 * i <= size; ++i)
    rates[i] = {tiltproof_get_u32(at + 8 + 8 * i), tiltproof_get_u32(at + 12 + 8 * i)};
  return true;
}

}  // namespace

void Flush() {
  std::size_t done = 0;
  while (done < out_size) {
    const long count =
        Kernel(SYS_sendto, line, out + done, out_size - done, static_cast<int>(MSG_NOSIGNAL), nullptr, 0);
    if (count > 0) done += static_cast<std::size_t>(count);
    if (count < 0 && count != -EINTR) Kernel(SYS_exit_group, 0);  // the flight is over
  }
  out_size = 0;
}

const char* Connect(const char* path) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  if (std::strlen(path) >= sizeof address.sun_path) return "the path of the harness's socket is too long";
  std::strcpy(address.sun_path, path);
  line = AboveOthers(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (line < 0 || connect(line, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return "the harness's socket takes no connection";
  if (!ReadHello()) return "the harness does not speak this version of the protocol of programs";
  tiltproof_put_u32(Message(TILTPROOF_PROGRAM_READY, 0, 4), TILTPROOF_PROGRAM_VERSION);
  Flush();
  return nullptr;
}

int AboveOthers(int descriptor) {
  const int moved = descriptor < 0 ? -1 : fcntl(descriptor, F_DUPFD_CLOEXEC, kOwnDescriptorMin);
  if (moved < 0) return descriptor;
  close(descriptor);
  return moved;
}

UartRate RateOf(int uart) { return rates[uart]; }

void Transmit(int uart, std::int64_t now_ns, const unsigned char* bytes, std::size_t count) {
  constexpr std::size_t kPart = 32768;
  for (std::size_t done = 0; done < count; done += kPart) {
    const std::size_t part = count - done < kPart ? count - done : kPart;
    unsigned char* body = Message(TILTPROOF_PROGRAM_TRANSMIT, uart, 8 + part);
    tiltproof_put_i64(body, now_ns);
    std::memcpy(body + 8, bytes + done, part);
  }
}

void Log(std::int64_t now_ns, const char* text) {
  const std::size_t size = std::strlen(text);
  unsigned char* body = Message(TILTPROOF_PROGRAM_LOG, 0, 8 + size);
  tiltproof_put_i64(body, now_ns);
  std::copy_n(text, size, body + 8);
}

std::int64_t FirstGrant(ByteSink sink) {
  for (;;) {
    const unsigned char* message = Read();
    if (message == nullptr || message[4] == TILTPROOF_PROGRAM_END) Kernel(SYS_exit_group, 0);
    const unsigned char* body = message + kHeader;
    if (message[4] == TILTPROOF_PROGRAM_BYTES)
      sink(message[5], body + 8, tiltproof_get_u32(message) - 8);
    else if (message[4] == TILTPROOF_PROGRAM_GRANT)
      return tiltproof_get_i64(body);
    else if (message[4] == TILTPROOF_PROGRAM_RESET)
      Kernel(SYS_exit_group, 0);  // the harness starts it again
  }
}

std::int64_t Exchange(std::int64_t until_ns, ByteSink sink) {
  tiltproof_put_i64(Message(TILTPROOF_PROGRAM_WAITING, 0, 8), until_ns);
  Flush();
  return FirstGrant(sink);
}

void Refuse(const char* reason) {
  const std::size_t size = strnlen(reason, 512);
  constexpr char kBegin[] = "tiltproof: the virtual clock cannot hold this program: ";
  Kernel(SYS_write, 2, kBegin, sizeof kBegin - 1);
  Kernel(SYS_write, 2, reason, size);
  Kernel(SYS_write, 2, "\n", 1);
  if (line >= 0) {
    // Beside `out`, which another thread may be using.
    unsigned char message[kHeader + 512] = {};
    tiltproof_put_u32(message, static_cast<std::uint32_t>(size));
    message[4] = TILTPROOF_PROGRAM_REFUSED;
    std::memcpy(message + kHeader, reason, size);
    Kernel(SYS_sendto, line, message, kHeader + size, static_cast<int>(MSG_NOSIGNAL), nullptr, 0);
  }
  for (;;) Kernel(SYS_exit_group, kRefusedExit);
}

}  // namespace tiltproof::preload
