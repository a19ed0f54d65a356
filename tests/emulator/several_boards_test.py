#!/usr/bin/env python3
"""Three emulated boards on one vehicle with two faults: each acts on its board alone, and every way to fly is the same flight.

Usage: several_boards_test.py TILTPROOF FOLDER-OF-IMAGES
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, IMAGES = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
del sys.argv[1:3]

# The crystal of board a loses 37.5 ppm, that of board c gains 50, as real ones may.
CLIENTS = [f"a=qemu:{IMAGES / 'executive-tolerant.elf'},hse=7999700", f"b=qemu:{IMAGES / 'executive-tolerant.elf'}",
           f"c=qemu:{IMAGES / 'executive-tolerant.elf'},hse=8000400"]
REPEATS_COUNT = 3

THREE = """\
name: three
duration_s: 3
firmware: tolerant
reference: {type: spiral, time_s: 60}
clients: [{id: a}, {id: b}, {id: c}]
arbiter: {type: primary_backup, timeout_ms: 36, return: 200}
FAULTS
criteria:
  - {name: stays-on-path, stl: "always(position_error_m <= 1.0)"}
"""
FAULTS = """\
faults:
  - {id: reset-a, type: device.reset, client: a, start_s: 1, parameters: {boot_ms: 400}}
  - {id: drift-b, type: clock.drift, client: b, start_s: 0.5, parameters: {node: client, ppm: 2000}}
"""


class SeveralBoards(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def fly(self, faults, *flags):
        """The verdict of the flight, its rows, and its events."""
        (self.folder / "three.yaml").write_text(THREE.replace("FAULTS\n", faults))
        done = subprocess.run([TILTPROOF, "run", self.folder / "three.yaml", "--out", self.folder / "out", "--no-progress",
                               *(word for client in CLIENTS for word in ("--client", client)), *flags],
                              capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        latest = self.folder / "out/latest"
        with open(latest / "three/trace.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        events = [json.loads(line) for line in (latest / "events.jsonl").read_text().splitlines()]
        return json.loads((latest / "three/verdict.json").read_text()), rows, events

    def test_two_faults_on_three_boards_are_one_flight_in_every_way_to_fly(self):
        first, rows, events = self.fly(FAULTS)
        metrics = first["metrics"]
        # Board b flies while a boots.
        selected = [(float(row["t_s"]), row["arbiter_selected"]) for row in rows]
        self.assertEqual({place for at, place in selected if 1.06 < at < 1.38}, {"1"})
        self.assertEqual((selected[-1][1], metrics["redundancy.switches_count"]), ("0", 2))
        self.assertEqual((metrics["redundancy.without_control_s"], metrics["redundancy.clients_lost_count"]), (0, 0))
        # Each fault is seen in its board's metrics and events alone.
        self.assertEqual([metrics[f"firmware.{board}.restarts_count"] for board in "abc"], [1, 0, 0])
        self.assertEqual([event["client"] for event in events if event["kind"] == "device_reset"], ["a"])
        self.assertGreater(metrics["timing.a.firmware_missed_count"], 25)
        # From 0.5 s on b's period is 12 ms / 1.002, and c's is 12 ms / 1.00005 from power-on.
        self.assertAlmostEqual(metrics["timing.b.request_period_p50_ms"], 12 / 1.002, delta=0.003)
        self.assertAlmostEqual(metrics["timing.c.request_period_mean_ms"], 12 / 1.00005, delta=0.0005)
        for flags in [()] * (REPEATS_COUNT - 1) + [("--distributed=socket",), ("--distributed=dds",)]:
            again, _, _ = self.fly(FAULTS, *flags)
            self.assertEqual((again["trace_hash"], again["metrics"]), (first["trace_hash"], metrics), flags)

    def test_the_hash_has_each_of_both_faults(self):
        hashes = {self.fly(f"faults:\n{line}\n")[0]["trace_hash"] for line in FAULTS.splitlines()[1:]}
        self.assertEqual(len(hashes | {self.fly("")[0]["trace_hash"]}), 3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
