#!/usr/bin/env python3
"""A process on the bus that is no part of the flight says all that nodes and harness say: the flight is as without it.
Usage: intruder_test.py TILTPROOF DDS_PEER"""
import csv
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

from flight import Flight, become_subreaper, read, write_hover

PROGRAM, PEER = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(2))
DURATION_S = 4


class IntruderTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-bus-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def fly(self, *arguments):
        flight = Flight(PROGRAM, self.folder, write_hover(self.folder, duration_s=DURATION_S), *arguments)
        self.addCleanup(flight.end)
        return flight

    def intrude(self, flight, mode="intrude"):
        peer = subprocess.Popen([PEER, mode, *flight.place(), "55"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.addCleanup(lambda: (peer.kill(), peer.wait(), peer.stdin.close(), peer.stdout.close()))
        self.assertEqual(peer.stdout.readline(), b"ready\n")
        return peer

    def assert_as_without(self, flight):
        self.assertIn(flight.process.returncode, (0, 4), flight.text())
        result = flight.result()
        if flight.process.returncode == 4:
            self.assertIn("too busy to judge", result["reason"])
        self.assertEqual(result["metrics"]["survival.time_s"], DURATION_S)
        with open(flight.run_folder / "hover/trace.csv", newline="", encoding="utf-8") as file:
            times_ms = [round(1000 * float(row["t_s"])) for row in csv.DictReader(file)]
        self.assertEqual(times_ms, [*range(0, 1000 * DURATION_S, 12), 1000 * DURATION_S])
        for file in ("events.jsonl", "results.json", "hover/faults.jsonl", "hover/flight.json", "hover/firmware.log"):
            self.assertNotIn(b"intruder", read(flight.run_folder / file), file)

    def test_real_time_is_as_without(self):
        flight = self.fly()
        self.intrude(flight)
        flight.wait(60)
        self.assert_as_without(flight)
        # Each participant that takes a place is named, once.
        ignored = flight.events("node_ignored")
        self.assertEqual(len(ignored), 1, ignored)
        self.assertRegex(ignored[0]["text"], r"the \w+ node \w+ on .* \(process \d+\) is ignored: this flight has \w+")
        self.assertEqual(flight.text().count("is ignored: this flight has"), 1, flight.text())
        flight.check_results(self)
        flight.check_nothing_left(self)

    def test_a_foreign_joystick_does_not_end_a_base_station(self):
        domain = "87"
        with open(self.folder / "said", "w+", encoding="utf-8") as said:
            station = subprocess.Popen([PROGRAM, "node", "base-station", "--domain", domain], stderr=said, stdout=subprocess.DEVNULL)
            self.addCleanup(lambda: (station.kill(), station.wait()))
            time.sleep(6)  # it is no newcomer any more, 3 s after it has found its bus
            peer = subprocess.Popen([PEER, "heartbeat", domain, "tiltproof", "a-joystick", "joystick"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            self.addCleanup(lambda: (peer.kill(), peer.wait(), peer.stdin.close(), peer.stdout.close()))
            self.assertEqual(peer.stdout.readline(), b"ready\n")
            time.sleep(1)
            self.assertIsNone(station.poll())
            said.seek(0)
            text = said.read()
            self.assertEqual(text.count("a-joystick (joystick on"), 1)
            self.assertRegex(text, r"^tiltproof: base-station node '\S+' listens on domain 87 with the tag 'tiltproof', on this machine only; ")
            # Who comes later has to stand back.
            late = subprocess.run([PROGRAM, "node", "base-station", "--domain", domain], capture_output=True, text=True, timeout=30, check=False)
            self.assertEqual(late.returncode, 3, late.stderr)


if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
