#!/usr/bin/env python3
"""A flight firmware as a program with serial ports: Python 3, and nothing but its standard library.

    tiltproof design-lqr tiltrotor --csv gain.csv
    tiltproof run scenarios/paper -k paper-hover --mode realtime \\
      --client 'process:exec python3 hover.py gain.csv {port} {reference_port}'

It speaks the protocol `paper`, or that of a fourth argument: a file with the output of `tiltproof protocol check FILE
--format json`. The control law is u = u_hover - K (x - x_ref). It flies any vehicle: the harness puts what it must know
into TILTPROOF_PARAMETERS, the JSON text of firmware/tiltproof_client.h. In place of gain.csv, a file that ends in .json
holds such a text, and `design` takes the gain that is in the variable. Python is quick enough for 12 ms on a machine that
has nothing else to do; it promises nothing.
"""
import json
import math
import os
import select
import sys
import time
import tty

from serial_protocol import Protocol

SIGNALS = """x_m y_m z_m roll_rad pitch_rad yaw_rad alpha_r_rad alpha_l_rad vx_m_s vy_m_s vz_m_s wx_rad_s wy_rad_s wz_rad_s
             alpha_r_rad_s alpha_l_rad_s""".split()
REFERENCE = "x_m y_m z_m yaw_rad vx_m_s vy_m_s vz_m_s".split()
# Parameters of the paper's vehicle, where the harness passes none.
TILTROTOR = {
    "signals": [{"name": name, "hover": 0.0} for name in SIGNALS],
    # f_r, f_l in N, tau_r, tau_l in N m: what `tiltproof design-lqr tiltrotor` prints as hover.
    "inputs": [{"name": "f_r_n", "min": 0.0, "max": 30.0, "hover": 10.27118},
               {"name": "f_l_n", "min": 0.0, "max": 30.0, "hover": 10.28035},
               {"name": "tau_r_nm", "min": -2.0, "max": 2.0, "hover": 0.0},
               {"name": "tau_l_nm", "min": -2.0, "max": 2.0, "hover": 0.0}],
    "angular_rates": "world",
}
REGULATED = (0, 1, 2, 5)  # x, y, z and yaw among the sensors: the errors that are integrated


def paper(parameters):
    """The protocol `paper`, as the vehicle with these signals speaks it."""

    def message(name, role, sender, line="main", number=None, signals=(), reply=None):
        own_id = None if number is None else {"type": "f32", "byte_order": "little", "value": number}
        first = 0 if number is None else 4
        fields = [{"signal": signal, "type": "f32", "byte_order": "little", "offset": first + 4 * i, "scale": 1, "min": -1e4,
                   "max": 1e4, "content": "signal", "as": "newton"} for i, signal in enumerate(signals)]
        return {"name": name, "role": role, "from": sender, "line": line, "id": own_id, "reply": reply, "fields": fields,
                "starts": role == "start", "payload_bytes": first + 4 * len(fields)}

    return Protocol({
        "control_period_ms": 12,
        "framing": {"type": "hdlc", "check": "fletcher16", "check_bytes": 2},
        "frames": {"world": "enu", "body": "flu"},
        "messages": [message("start", "start", "client", number=1), message("request", "request", "client", number=2, reply="reply"),
                     message("actuators", "actuators", "client", number=3, signals=[own["name"] for own in parameters["inputs"]]),
                     message("reply", "reply", "server", signals=[own["name"] for own in parameters["signals"]]),
                     message("reference", "reference", "server", "reference", signals=REFERENCE)],
    })


class Port:
    """A serial port, and the messages that arrive there."""

    def __init__(self, path, receiver):
        self.descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.descriptor)
        self.receiver = receiver

    def fileno(self):
        return self.descriptor

    def send(self, frame):
        os.write(self.descriptor, frame)

    def messages(self):
        """The names and values of the messages that have arrived whole; anything else is dropped."""
        try:
            received = os.read(self.descriptor, 4096)
        except BlockingIOError:
            return
        yield from self.receiver.feed(received)


def states_of(parameters):
    """The signals of the control law, in the order of the gain's columns."""
    return parameters.get("states") or parameters["signals"]


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
    rows, columns = len(parameters["inputs"]), len(states_of(parameters)) + len(REGULATED)
    if gain is None or [len(row) for row in gain] != [columns] * rows:
        sys.exit(f"{source}: not {rows} rows of {columns} numbers; `tiltproof design-lqr MODEL --csv FILE` writes them")
    return gain


def turned(heading, x, y):
    """A vector along x and y of the world, along forward and left of the heading."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return cosine * x + sine * y, cosine * y - sine * x


class Controller:
    def __init__(self, gain_source, parameters=None, period_s=0.012):
        self.period_s = period_s
        self.parameters = parameters or TILTROTOR
        self.gain = read_gain(gain_source, self.parameters)
        self.integrals = [0.0] * 4
        self.last_errors = [0.0] * 4

    def step(self, sensors, reference):
        """Sensors: the vehicle's, in SI units. Reference: x, y, z, yaw and the velocities along x, y, z."""
        x, y, z, yaw, vx, vy, vz = reference
        errors = [is_ - signal["hover"] for is_, signal in zip(sensors, states_of(self.parameters))]
        half = len(errors) // 2  # x y z roll pitch yaw and the hinges; then the rates of all these
        for place, wanted in ((0, x), (1, y), (2, z), (5, yaw), (half, vx), (half + 1, vy), (half + 2, vz)):
            errors[place] = sensors[place] - wanted
        errors[5] = math.remainder(errors[5], 2 * math.pi)
        for i, place in enumerate(REGULATED):
            self.integrals[i] += self.period_s / 2 * (errors[place] + self.last_errors[i])
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


class Pilot:
    """The client's side of a protocol: it starts, asks where the protocol has requests, and answers with actuators."""

    def __init__(self, protocol, controller, send):
        self.protocol, self.controller, self.send = protocol, controller, send
        if protocol.description["frames"] != {"world": "enu", "body": "flu"}:
            sys.exit("the control law has the axes enu and flu; this protocol has others")
        self.sensors, self.reference = {}, {}  # by signal, as received last
        # Answered are the reply to the last request and, of a stream, the most frequent message.
        requests, streamed = protocol.of_role("request"), protocol.of_role("streamed")
        self.answered = requests[-1]["reply"] if requests else min(streamed, key=lambda message: message["period_ms"])["name"]

    def say(self, role, values=None):
        for message in self.protocol.of_role(role):
            self.send(self.protocol.frame(message["name"], values))

    def on_the_line(self, inputs):
        """The inputs by signal, each in its unit of the actuator message."""
        fields = {field["signal"]: field["as"] for message in self.protocol.of_role("actuators") for field in message["fields"]}
        values = {}
        for own, value in zip(self.controller.parameters["inputs"], inputs):
            share = value / own["max"]
            unit = fields.get(own["name"], "newton")
            values[own["name"]] = {"newton": value, "share": share, "share_of_speed": math.sqrt(max(share, 0.0))}[unit]
        return values

    def start(self):
        hover = self.on_the_line([own["hover"] for own in self.controller.parameters["inputs"]])
        for message in self.protocol.messages.values():
            if message["starts"]:
                self.send(self.protocol.frame(message["name"], hover))

    def take(self, name, values):
        self.sensors.update(values)
        wanted = [own["name"] for own in states_of(self.controller.parameters)]
        if name != self.answered or not all(signal in self.sensors for signal in wanted):
            return
        for signal in ("x_m", "y_m", "z_m", "yaw_rad"):
            self.reference.setdefault(signal, self.sensors[signal])  # what no reference has said: where it is
        sensors = [self.sensors[signal] for signal in wanted]
        reference = [self.reference.get(signal, 0.0) for signal in REFERENCE]
        self.say("actuators", self.on_the_line(self.controller.step(sensors, reference)))

    def follow(self, values):
        self.reference.update(values)


def fly(protocol, port, reference_port, controller):
    pilot = Pilot(protocol, controller, port.send)
    pilot.start()
    tick_s = time.monotonic()
    while True:
        pilot.say("request")
        tick_s = max(tick_s + protocol.period_s, time.monotonic())  # what was missed is not made up for
        while (left_s := tick_s - time.monotonic()) > 0:
            ready, _, _ = select.select([port, reference_port], [], [], left_s)
            if reference_port in ready:
                for _, values in reference_port.messages():
                    pilot.follow(values)
            if port in ready:
                for name, values in port.messages():
                    pilot.take(name, values)


def main(gain, path, reference_path, protocol_file=None):
    passed = os.environ.get("TILTPROOF_PARAMETERS")
    parameters = json.loads(passed) if passed else TILTROTOR
    if protocol_file is None:
        protocol = paper(parameters)
    else:
        with open(protocol_file, encoding="utf-8") as file:
            protocol = Protocol(json.load(file))
    controller = Controller(gain, parameters, protocol.period_s)
    fly(protocol, Port(path, protocol.receiver()), Port(reference_path, protocol.receiver("reference")), controller)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit("usage: hover.py GAIN.csv|PARAMETERS.json|design PORT REFERENCE_PORT [PROTOCOL.json]")
    main(*sys.argv[1:])
