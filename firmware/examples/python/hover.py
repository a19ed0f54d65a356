#!/usr/bin/env python3
"""A flight firmware as a program with serial ports: Python 3, and nothing but its standard library.

    tiltproof design-lqr tiltrotor --csv gain.csv
    tiltproof run scenarios/paper -k paper-hover --mode realtime \\
      --client 'process:exec python3 hover.py gain.csv {port} {reference_port}'

The bytes are those of docs/wire.md, protocol `paper`; the control law is the paper's: u = u_eq - K (x - x_ref). Python
is quick enough for 12 ms on a machine that has nothing else to do; it promises nothing.
"""
import os
import select
import struct
import sys
import time
import tty

PERIOD_S = 0.012
START, READ, ACTUATORS = 1.0, 2.0, 3.0
# f_r, f_l in N, tau_r, tau_l in N m: what `tiltproof design-lqr tiltrotor` prints as hover.
HOVER_INPUT = (10.27118, 10.28035, 0.0, 0.0)
INPUT_RANGES = ((0.0, 30.0), (0.0, 30.0), (-2.0, 2.0), (-2.0, 2.0))  # what the actuators have
PLAUSIBLE_MAX = 1e4
STATE_COUNT = 20  # 16 sensors, then the integrals of the errors of x, y, z and yaw
REGULATED = (0, 1, 2, 5)  # x, y, z and yaw among the sensors


def fletcher16(payload):
    first = second = 0
    for byte in payload:
        first = (first + byte) % 255
        second = (second + first) % 255
    return bytes((first, second))


def frame(*numbers):
    """The bytes of a message: binary32 numbers, their check, escapes, and a flag on both sides."""
    payload = struct.pack(f"<{len(numbers)}f", *numbers)
    body = payload + fletcher16(payload)
    return b"\x7e" + body.replace(b"\x7d", b"\x7d\x5d").replace(b"\x7e", b"\x7d\x5e") + b"\x7e"


class Port:
    """A serial port, and the frames that arrive there."""

    def __init__(self, path):
        self.descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.descriptor)
        self.received = b""

    def fileno(self):
        return self.descriptor

    def send(self, *numbers):
        os.write(self.descriptor, frame(*numbers))

    def frames(self, count):
        """The messages of `count` numbers that have arrived whole; anything else is dropped."""
        try:
            self.received += os.read(self.descriptor, 4096)
        except BlockingIOError:
            return
        *bodies, self.received = self.received.split(b"\x7e")
        self.received = self.received[-600:]
        for body in bodies:
            body = body.replace(b"\x7d\x5e", b"\x7e").replace(b"\x7d\x5d", b"\x7d")
            payload, check = body[:-2], body[-2:]
            if len(payload) == 4 * count and fletcher16(payload) == check:
                numbers = struct.unpack(f"<{count}f", payload)
                # The check cannot tell a byte 00 from FF: what no vehicle does is damaged. NaN fails, too.
                if all(abs(number) <= PLAUSIBLE_MAX for number in numbers):
                    yield numbers


class Controller:
    def __init__(self, gain_file):
        with open(gain_file, encoding="ascii") as file:
            self.gain = [[float(value) for value in line.split(",")] for line in file]
        if [len(row) for row in self.gain] != [STATE_COUNT] * 4:
            sys.exit(f"{gain_file}: not 4 rows of {STATE_COUNT} numbers; `tiltproof design-lqr MODEL --csv FILE` writes them")
        self.integrals = [0.0] * 4
        self.last_errors = [0.0] * 4

    def step(self, sensors, reference):
        """Sensors: 16 numbers in SI units. Reference: x, y, z, yaw and the velocities along x, y, z."""
        x, y, z, yaw, vx, vy, vz = reference
        errors = [is_ - wanted for is_, wanted in zip(sensors, (x, y, z, 0, 0, yaw, 0, 0, vx, vy, vz, 0, 0, 0, 0, 0))]
        for i, place in enumerate(REGULATED):
            self.integrals[i] += PERIOD_S / 2 * (errors[place] + self.last_errors[i])
            self.last_errors[i] = errors[place]
        state = errors + self.integrals
        wanted = [u - sum(k * s for k, s in zip(row, state)) for u, row in zip(HOVER_INPUT, self.gain)]
        return [min(max(u, low), high) for u, (low, high) in zip(wanted, INPUT_RANGES)]


def fly(port, reference_port, controller):
    reference = None  # until one arrives: where it is
    port.send(START)
    tick_s = time.monotonic()
    while True:
        port.send(READ)
        tick_s = max(tick_s + PERIOD_S, time.monotonic())  # what was missed is not made up for
        while (left_s := tick_s - time.monotonic()) > 0:
            ready, _, _ = select.select([port, reference_port], [], [], left_s)
            if reference_port in ready:
                for reference in reference_port.frames(7):
                    pass  # the last one counts
            if port in ready:
                for sensors in port.frames(16):
                    if reference is None:
                        reference = (*sensors[:3], sensors[5], 0.0, 0.0, 0.0)
                    port.send(ACTUATORS, *controller.step(sensors, reference))


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit("usage: hover.py GAIN.csv PORT REFERENCE_PORT")
    fly(Port(sys.argv[2]), Port(sys.argv[3]), Controller(sys.argv[1]))
