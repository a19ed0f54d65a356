/* A firmware as a plain POSIX program: it opens two serial ports, waits in ppoll(), and reads the system's clock. It knows
 * nothing of tiltproof's harness. The controller is that of ../minimal_c/minimal_firmware.c, behind its functions.
 *
 *   gcc -O2 -ffp-contract=off -I ../../.. posix_firmware.c ../minimal_c/minimal_firmware.c -o posix_firmware
 *   tiltproof run scenarios/paper/hover.yaml --client 'clocked:./posix_firmware {port} {reference_port} {baud}'
 *   tiltproof run scenarios/paper/hover.yaml --mode realtime --client 'process:./posix_firmware {port} {reference_port} {baud}'
 */
#define _DEFAULT_SOURCE
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "firmware/tiltproof_client.h"

enum { kBitsOfCharacter = 10 };

static int ports[2];
static long baud;
static int64_t power_on_ns = 0;

static int64_t Now(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * (int64_t)1000000000 + now.tv_nsec - power_on_ns;
}

static int OpenPort(const char* path) {
  struct termios settings;
  const int port = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK);
  if (port < 0 || tcgetattr(port, &settings) != 0) {
    fprintf(stderr, "%s: %s\n", path, strerror(errno));
    exit(1);
  }
  cfmakeraw(&settings);
  cfsetspeed(&settings, baud == 921600 ? B921600 : baud == 460800 ? B460800 : B115200);
  tcsetattr(port, TCSANOW, &settings);
  return port;
}

/* Returns when the last stop bit leaves, on a transmitter that is idle. */
static int64_t Transmit(void* context, int uart, int64_t now_ns, const uint8_t* bytes, size_t count) {
  (void)context;
  if (write(ports[uart], bytes, count) != (ssize_t)count) exit(1);
  return now_ns + (int64_t)count * kBitsOfCharacter * 1000000000 / baud;
}

int main(int count, char** words) {
  if (count != 4) {
    fprintf(stderr, "usage: posix_firmware PORT REFERENCE_PORT BAUD\n");
    return 2;
  }
  baud = atol(words[3]);
  for (int uart = 0; uart < 2; ++uart) ports[uart] = OpenPort(words[1 + uart]);
  power_on_ns = Now();
  const TiltproofHost host = {.abi_version = TILTPROOF_CLIENT_ABI_VERSION,
                              .firmware = "",
                              .dialect = "paper",
                              .transmit = Transmit,
                              .parameters = getenv("TILTPROOF_PARAMETERS")};
  TiltproofClient* firmware = tiltproof_client_create(&host);
  if (firmware == NULL) return 1;
  int64_t wake_ns = tiltproof_client_start(firmware, Now());
  for (;;) {
    struct pollfd polled[2] = {{ports[0], POLLIN, 0}, {ports[1], POLLIN, 0}};
    const int64_t left_ns = wake_ns > Now() ? wake_ns - Now() : 0;
    const struct timespec left = {left_ns / 1000000000, left_ns % 1000000000};
    if (ppoll(polled, 2, &left, NULL) < 0 && errno != EINTR) return 1;
    for (int uart = 0; uart < 2; ++uart) {
      uint8_t bytes[256];
      const ssize_t received = polled[uart].revents == 0 ? 0 : read(ports[uart], bytes, sizeof bytes);
      if (received > 0) tiltproof_client_receive(firmware, uart, Now(), bytes, (size_t)received);
    }
    wake_ns = tiltproof_client_grant(firmware, Now());
  }
}
