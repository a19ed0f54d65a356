#!/usr/bin/env python3
"""The controller of hover.py as a program in lockstep: the same bits in every flight, replay, margins, campaigns.

    export PYTHONPATH=python                    # of the sources; the Debian package has it in place
    tiltproof run scenarios/acceptance/sound \\
      --client 'program:python3 firmware/examples/python/program_hover.py'

It flies any vehicle with the gain that the harness designs, in the protocol `paper`, or in that of an argument: a file with
the output of `tiltproof protocol check FILE --format json`.
"""
import json
import sys

import hover
from serial_protocol import Protocol
from tiltproof.program import MAIN, REFERENCE, Program


class Firmware:
    """All state of the board: a reset makes a new one."""

    def __init__(self, program, protocol_file=None):
        self.now_ns = 0
        if protocol_file is None:
            self.protocol = hover.paper(program.parameters)
        else:
            with open(protocol_file, encoding="utf-8") as file:
                self.protocol = Protocol(json.load(file))
        self.protocol.now_ns = lambda: self.now_ns
        self.receivers = {MAIN: self.protocol.receiver(), REFERENCE: self.protocol.receiver("reference")}
        controller = hover.Controller("design", program.parameters, self.protocol.period_s)
        self.pilot = hover.Pilot(self.protocol, controller, lambda frame: program.transmit(MAIN, self.now_ns, frame))
        self.tick_ns = None  # of the next request; none: it has not started

    def receive(self, uart, now_ns, data):
        self.now_ns = now_ns
        for name, values in self.receivers[uart].feed(data):
            self.pilot.take(name, values) if uart == MAIN else self.pilot.follow(values)

    def run(self, now_ns):
        """Until when it waits."""
        self.now_ns = now_ns
        if self.tick_ns is None:
            self.pilot.start()
            self.tick_ns = now_ns
        if now_ns >= self.tick_ns:
            self.pilot.say("request")
            self.tick_ns += round(self.protocol.period_s * 1e9)
        return self.tick_ns


def main(protocol_file=None):
    program = Program()
    firmware = Firmware(program, protocol_file)
    for event in program:
        if event.kind == "bytes":
            firmware.receive(event.uart, event.now_ns, event.data)
            continue
        if event.kind == "reset":
            firmware = Firmware(program, protocol_file)
        program.wait(firmware.run(event.now_ns))


if __name__ == "__main__":
    main(*sys.argv[1:])
