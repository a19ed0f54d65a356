/* C interface of a firmware build that tiltproof flies as a shared library (`--client library:FILE`).
 *
 * The library is one board: two UARTs, a clock, no operating system. It never reads the machine's clock and
 * never sleeps; the harness owns time. A run is:
 *
 *   c = tiltproof_client_create(&host);
 *   wake = tiltproof_client_start(c, 0);                   power-on, client time 0
 *   repeat:
 *     t = earlier of wake and the arrival of bytes for the client
 *     tiltproof_client_receive(c, uart, t, bytes, count);  as a receive interrupt would; any number of calls
 *     wake = tiltproof_client_grant(c, t);                 run at t until it waits; returns "waiting until"
 *   tiltproof_client_destroy(c);
 *
 * All times are nanoseconds of the client's own clock since power-on. Within receive, grant, start and reset
 * the client may call host->transmit. A call must return: one that runs or sleeps for more than 5 s is a hung
 * firmware and fails the run (time without a processor does not count). So does one that crashes, calls exit or
 * exec, or lets an exception out, and a client that wants to be woken more than 20000 times within 12 ms. What the
 * library prints on standard output and error goes to the run's firmware.log. Every call comes from one thread,
 * and only that thread may call the host, within a call. Several boards may exist at once, so keep state in the
 * TiltproofClient.
 *
 * UART 0 is the main line (sensors and actuators), UART 1 brings references; from 2 on, lines to other boards
 * (docs/redundancy.md). Frames and messages: docs/wire.md; in C++, link/frame.h and firmware/messages.h.
 *
 * Version 2 adds TiltproofHost.parameters, version 3 adds compute. A library of an older version works as before: it
 * gets a host of its version.
 */
#ifndef TILTPROOF_CLIENT_H
#define TILTPROOF_CLIENT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TILTPROOF_CLIENT_ABI_VERSION 3u

/* Build your library with hidden visibility: these functions are all that it has to show. */
#define TILTPROOF_CLIENT_API __attribute__((visibility("default")))

#define TILTPROOF_UART_MAIN 0
#define TILTPROOF_UART_REFERENCE 1
#define TILTPROOF_NEVER INT64_MAX /* "waiting for bytes only" */

typedef struct TiltproofClient TiltproofClient;

typedef struct {
  uint32_t abi_version; /* the version of the library, at most that of the harness */
  const char* firmware; /* the scenario's `firmware` key: which build to be; ignore it if there is only one */
  const char* dialect;  /* the protocol's name: "paper", "provant", "hardened", or that of a file */
  void* context;        /* pass back to the functions below */
  /* Gives bytes to the UART's transmitter at client time now_ns (that of the call in progress, or later
   * within it). They are sent back to back after what it still holds. Returns the client time at which the
   * last stop bit leaves. */
  int64_t (*transmit)(void* context, int uart, int64_t now_ns, const uint8_t* bytes, size_t count);
  /* One line of text for the run's firmware.log. NULL when there is no log. */
  void (*log)(void* context, int64_t now_ns, const char* text);
  /* From version 2 on: what a controller must know of the vehicle, as one JSON object. NULL for most of the shipped
   * builds that fly the tilt-rotor.
   *   vehicle           {"name", "model" (of the scenario, as written), "mass_kg"}
   *   control_period_s  of the protocol
   *   angular_rates     axes of the sensed angular rates: "world", "body" or "euler"
   *   signals           of the server's messages, in their order: [{"name", "unit", "hover"}, ...]
   *   states            of the vehicle, in the order of the gain: the same
   *   inputs            of the vehicle: [{"name", "unit", "min", "max", "hover"}, ...]
   *   gain              K of u = u_hover - K (x - x_ref): a row for each input, a column for each state, then one for
   *                     the integral of the error of each of x, y, z and yaw; that of the scenario's `gain`, else of
   *                     `tiltproof design-lqr`. null when the vehicle has none.
   *   geometry          {"base": BODY, "hinges": [{"point_m", "axis", "angle_min_rad", "angle_max_rad", "servo": "torque" or
   *                     "position", "body": BODY}, ...], "rotors": [{"hinge": its place among the hinges or null, "point_m",
   *                     "axis", "drag_ratio_m"}, ...]} with BODY {"mass_kg", "com_m", "inertia_kg_m2": [xx, yy, zz, xy, xz,
   *                     yz], about com_m}; all in the main body's frame, with the hinges at angle 0
   *   client            {"id", "place" (from 0) and "of": which of the clients on the vehicle this board is}
   *   firmware_parameters  the numbers of the scenario's key of that name: {"name": value, ...}
   *   protocol          {"name", "framing": {"type", "check", "sync", "length"}, "world", "body", "messages": [{"name",
   *                     "role", "from", "line", "id": {"type", "byte_order", "bits"}, "reply", "starts", "period_ns",
   *                     "fields": [{"signal", "type", "byte_order", "scale", "min", "max", "as"}, ...]}, ...]}; the id is
   *                     null for a message without, "sync" and "length" are those of a length-prefixed frame
   * Numbers have the shortest text that reads back as the same double. */
  const char* parameters;
  /* From version 3 on, within receive, grant, start or reset. In lockstep a call takes no time, however much it computes. A
   * firmware whose computing takes long says so: it begins at now_ns (that of the call in progress, or later within it)
   * and takes length_ns on a sound processor. Returns the client time at which it ends, which is later where a fault
   * slows the processor or holds the task. What depends on the result is to be transmitted at that time or later. The
   * client may be called meanwhile, as by interrupts. Metric timing.deadline_missed_count counts computations that end
   * after deadline_ns, such as the time at which the next request is due. In real time, where computing takes its own
   * time, it returns now_ns. */
  int64_t (*compute)(void* context, int64_t now_ns, int64_t length_ns, int64_t deadline_ns);
} TiltproofHost;

typedef struct {
  uint32_t supervisor_state; /* 0 = normal; the firmware's own numbering */
  uint32_t failsafe_count;   /* how often it entered a fail-safe state since power-on */
} TiltproofClientStatus;

/* Must return TILTPROOF_CLIENT_ABI_VERSION, of the header with which the library was built. */
TILTPROOF_CLIENT_API uint32_t tiltproof_client_abi_version(void);
/* NULL when it cannot be the build asked for, or does not speak the dialect or this ABI version. `host` and
 * its strings stay valid until destroy. The place for a library's allocations: on a board there are none
 * later. */
TILTPROOF_CLIENT_API TiltproofClient* tiltproof_client_create(const TiltproofHost* host);
TILTPROOF_CLIENT_API void tiltproof_client_destroy(TiltproofClient* client);
TILTPROOF_CLIENT_API int64_t tiltproof_client_start(TiltproofClient* client, int64_t now_ns);
TILTPROOF_CLIENT_API void tiltproof_client_receive(TiltproofClient* client, int uart, int64_t now_ns,
                                                   const uint8_t* bytes, size_t count);
TILTPROOF_CLIENT_API int64_t tiltproof_client_grant(TiltproofClient* client, int64_t now_ns);
/* Optional (may be missing from the library): metrics and columns that need it are then absent. Asked every 12 ms of
 * the flight and at its end; it changes nothing. */
TILTPROOF_CLIENT_API void tiltproof_client_status(const TiltproofClient* client,
                                                  TiltproofClientStatus* status);
/* Roles of one of several boards on a vehicle (docs/redundancy.md). */
#define TILTPROOF_ROLE_STANDBY 0u
#define TILTPROOF_ROLE_ACTIVE 1u
#define TILTPROOF_ROLE_FAILED 2u
/* Optional: the board's present role, for the arbiter `active_claims` and the column role_<id>. Asked of several clients
 * every 12 ms of the flight, from t = 0 on; it changes nothing. */
TILTPROOF_CLIENT_API uint32_t tiltproof_client_role(const TiltproofClient* client);
/* A reset of the board at now_ns: all state but the clock is lost. Returns the next wake-up. */
TILTPROOF_CLIENT_API int64_t tiltproof_client_reset(TiltproofClient* client, int64_t now_ns);

#ifdef __cplusplus
}
#endif

#endif
