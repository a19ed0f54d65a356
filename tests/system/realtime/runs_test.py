#!/usr/bin/env python3
"""Runs in real time as a whole: several at once, interrupted, and with faults on their own nodes.
Usage: runs_test.py TILTPROOF PTY_FIRMWARE FIRMWARE_LIBRARY MINIMAL_LIBRARY"""
import json
import os
import pathlib
import shutil
import signal
import sys
import tempfile
import time
import unittest

from flight import Flight, become_subreaper, read, write_hover

PROGRAM, *_ = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(4))
NODES_SUITE = pathlib.Path(__file__).resolve().parents[3] / "scenarios/nodes"

TAKES_OFF = """\
name: takes-off
duration_s: 4
ground: {solid: true, touch_down_max_m_s: 1}
initial: {on_ground: true}
reference: {type: hover, at_m: [0, 0, 1]}
criteria:
  - {name: stands, stl: "eventually[0,0.1](on_ground > 0.5)"}
  - {name: takes-off, stl: "always[3,4](on_ground < 0.5 and z_m > 0.5)"}
"""


class RunsTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-runs-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def start(self, name, *arguments):
        folder = self.folder / name
        folder.mkdir()
        flight = Flight(PROGRAM, folder, *(arguments or [write_hover(folder)]))
        self.addCleanup(flight.end)
        return flight

    def check(self, flight):
        flight.check_results(self)
        flight.check_nothing_left(self)

    def assert_green_or_too_busy(self, flight):
        """Of every scenario; a machine that was too busy to judge the firmware has still flown it."""
        self.assertIn(flight.process.returncode, (0, 4), flight.text())
        busy = 0
        for result in flight.run_results():
            if not result["green"]:
                self.assertIn("too busy to judge", result["reason"])
                busy += 1
        self.assertEqual(flight.process.returncode, 4 if busy else 0)

    def place_of_nodes(self, flight):
        """Domain and tag, as the nodes were started with."""
        places = {tuple(command[command.index(flag) + 1] for flag in ("--domain", "--tag"))
                  for command in flight.processes().values() if "--domain" in command}
        self.assertEqual(len(places), 1)
        return places.pop()

    def test_run_json_and_the_first_event_say_where_a_flight_is_on_the_bus(self):
        flight = self.start("bus")
        flight.wait_flying()
        bus = flight.bus()
        self.assertIsNone(flight.process.poll(), "it does not fly any more")
        self.assertEqual((str(bus["domain"]), bus["tag"]), self.place_of_nodes(flight))
        flight.process.send_signal(signal.SIGINT)
        flight.wait(5)
        event = flight.events()[0]
        self.assertEqual(event["kind"], "bus")
        self.assertTrue(event["text"].startswith(f"domain {bus['domain']}, tag {bus['tag']}, run id {bus['run_id']};"), event)
        self.assertEqual(json.loads(read(flight.run_folder / "run.json"))["flights"][0]["bus"], bus)
        self.check(flight)

    def test_a_vehicle_takes_off_from_the_ground(self):
        (self.folder / "takes-off.yaml").write_text(TAKES_OFF)
        flight = self.start("ground", self.folder / "takes-off.yaml")
        flight.wait(60)
        self.assert_green_or_too_busy(flight)
        self.check(flight)

    def test_two_runs_at_once(self):
        one, other = self.start("one"), self.start("other")
        one.wait_flying(), other.wait_flying()
        self.assertNotEqual(self.place_of_nodes(one)[0], self.place_of_nodes(other)[0])
        for flight in (one, other):
            flight.wait(30)
        for flight in (one, other):
            self.assert_green_or_too_busy(flight)
            self.check(flight)

    def test_one_run_dies_and_the_other_goes_on(self):
        one, other = self.start("one"), self.start("other")
        one.wait_flying(), other.wait_flying()
        one.process.kill()
        one.wait(5)
        one.check_nothing_left(self)
        other.wait(30)
        self.assert_green_or_too_busy(other)
        self.check(other)

    def interrupted(self, send):
        flight = self.start("interrupted")
        flight.wait_flying()
        self.assertIsNotNone(flight.wait_fly_for(1.2), flight.text())
        sent = time.monotonic()
        send(flight)
        self.assertEqual(flight.wait(5), 130, flight.text())
        print(f"{self.id().split('.')[-1]}: ended after {time.monotonic() - sent:.2f} s", file=sys.stderr, flush=True)
        self.assertEqual(flight.result()["verdict"], "inconclusive")
        # The run keeps what was flown: a row every 12 ms.
        self.assertGreater(len(read(flight.run_folder / "hover/trace.csv").splitlines()), 50)
        self.check(flight)

    def test_interrupt_of_the_main_process(self):
        self.interrupted(lambda flight: flight.process.send_signal(signal.SIGINT))

    def test_interrupt_on_the_terminal(self):
        # It reaches the worker at the same time; nodes are in groups of their own.
        def send(flight):
            nodes = flight.nodes()
            os.kill(nodes["main"], signal.SIGINT)
            os.kill(nodes["worker"], signal.SIGINT)
        self.interrupted(send)

    def test_faults_on_nodes_two_flights_at_a_time(self):
        flight = self.start("nodes", NODES_SUITE, "-k", "kill or pause-client or restart-base", "-j", "2")
        flight.wait(60)
        self.assert_green_or_too_busy(flight)
        self.assertEqual(len(flight.run_results()), 4)
        self.check(flight)


if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
