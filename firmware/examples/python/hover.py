#!/usr/bin/env python3
"""A flight firmware as a program with serial ports: Python 3, and nothing but its standard library.

    tiltproof design-lqr tiltrotor --csv gain.csv
    tiltproof run scenarios/paper -k paper-hover --mode realtime \\
      --client 'process:exec python3 hover.py gain.csv {port} {reference_port}'

The bytes are those of docs/wire.md, protocol `paper`; the control law is u = u_hover - K (x - x_ref). It flies any
vehicle: the harness puts what it must know into TILTPROOF_PARAMETERS, the JSON text of firmware/tiltproof_client.h. In
place of gain.csv, a file that ends in .json holds such a text, and `design` takes the gain that is in the variable.
Python is quick enough for 12 ms on a machine that has nothing else to do; it promises nothing.
"""
import json
import math
import os
import select
import struct
import sys
import time
import tty

PERIOD_S = 0.012
START, READ, ACTUATORS = 1.0, 2.0, 3.0
# Parameters of the paper's vehicle, where the harness passes none.
TILTROTOR = {
    "signals": [{"hover": 0.0}] * 16,
    # f_r, f_l in N, tau_r, tau_l in N m: what `tiltproof design-lqr tiltrotor` prints as hover.
    "inputs": [{"min": 0.0, "max": 30.0, "hover": 10.27118}, {"min": 0.0, "max": 30.0, "hover": 10.28035},
               {"min": -2.0, "max": 2.0, "hover": 0.0}, {"min": -2.0, "max": 2.0, "hover": 0.0}],
    "angular_rates": "world",
}
PLAUSIBLE_MAX = 1e4
REGULATED = (0, 1, 2, 5)  # x, y, z and yaw among the sensors: the errors that are integrated


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


def read_gain(source, parameters):
    """The rows of the gain: of a CSV file, of a JSON file with parameters, or for `design` of the parameters."""
    if source == "design":
        gain = parameters.get("gain")
    elif str(source).endswith(".json"):
        with open(source, encoding="utf-8") as file:
            gain = json.load(file).get("gain")
    else:
        with open(source, encoding="ascii") as file:
            gain = [[float(value) for value in line.split(",")] for line in file]
    rows, columns = len(parameters["inputs"]), len(parameters["signals"]) + len(REGULATED)
    if gain is None or [len(row) for row in gain] != [columns] * rows:
        sys.exit(f"{source}: not {rows} rows of {columns} numbers; `tiltproof design-lqr MODEL --csv FILE` writes them")
    return gain


def turned(heading, x, y):
    """A vector along x and y of the world, along forward and left of the heading."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return cosine * x + sine * y, cosine * y - sine * x


class Controller:
    def __init__(self, gain_source, parameters=None):
        self.parameters = parameters or TILTROTOR
        self.gain = read_gain(gain_source, self.parameters)
        self.integrals = [0.0] * 4
        self.last_errors = [0.0] * 4

    @property
    def sensor_count(self):
        return len(self.parameters["signals"])

    def step(self, sensors, reference):
        """Sensors: the vehicle's, in SI units. Reference: x, y, z, yaw and the velocities along x, y, z."""
        x, y, z, yaw, vx, vy, vz = reference
        errors = [is_ - signal["hover"] for is_, signal in zip(sensors, self.parameters["signals"])]
        half = self.sensor_count // 2  # x y z roll pitch yaw and the hinges; then the rates of all these
        for place, wanted in ((0, x), (1, y), (2, z), (5, yaw), (half, vx), (half + 1, vy), (half + 2, vz)):
            errors[place] = sensors[place] - wanted
        errors[5] = math.remainder(errors[5], 2 * math.pi)
        for i, place in enumerate(REGULATED):
            self.integrals[i] += PERIOD_S / 2 * (errors[place] + self.last_errors[i])
            self.last_errors[i] = errors[place]
        # The gain holds for a heading of 0: what is level turns from the world to the heading. The paper's law does not.
        heading, integrals = 0.0 if self.parameters is TILTROTOR else sensors[5], list(self.integrals)
        integrals[:2] = turned(heading, *integrals[:2])
        for place in (0, half, half + 3) if self.parameters["angular_rates"] == "world" else (0, half):
            errors[place : place + 2] = turned(heading, *errors[place : place + 2])
        state = errors + integrals
        inputs = self.parameters["inputs"]
        wanted = [own["hover"] - sum(k * s for k, s in zip(row, state)) for own, row in zip(inputs, self.gain)]
        return [min(max(u, own["min"]), own["max"]) for own, u in zip(inputs, wanted)]


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
                for sensors in port.frames(controller.sensor_count):
                    if reference is None:
                        reference = (*sensors[:3], sensors[5], 0.0, 0.0, 0.0)
                    port.send(ACTUATORS, *controller.step(sensors, reference))


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit("usage: hover.py GAIN.csv|PARAMETERS.json|design PORT REFERENCE_PORT")
    passed = os.environ.get("TILTPROOF_PARAMETERS")
    fly(Port(sys.argv[2]), Port(sys.argv[3]), Controller(sys.argv[1], json.loads(passed) if passed else None))
