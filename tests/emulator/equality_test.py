#!/usr/bin/env python3
"""One firmware in three shapes: library on the host, cyclic executive and FreeRTOS's tasks on the emulated board. In lockstep, on a line that loses
frames and bytes and falls silent, all three must fly the vehicle and command it alike, to the bit; and the two images must leave the same trace.

Usage: equality_test.py TILTPROOF FOLDER-OF-IMAGES SOURCE-FOLDER
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

from same_flight import earlier

TILTPROOF, IMAGES, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:4])
del sys.argv[1:4]

# Their faults act on frames by number, so that some microseconds of computing change nothing. Between them the firmware misses replies, repeats
# commands, goes blind and comes back.
SCENARIOS = ["wire-byte-drop-survive", "wire-frame-babble-survive", "wire-frame-drop-survive", "wire-frame-unsolicited-survive",
             "wire-link-silence-survive"]


def fly(folder, client, firmware):
    """{scenario: (its entry in results.json, rows of its trace)}"""
    folder.mkdir()
    files = []
    for name in SCENARIOS:
        # 8 s without a fault show nothing more than the first two.
        text = (SOURCE / "scenarios/wire" / f"{name.removeprefix('wire-')}.yaml").read_text()
        files.append(folder / f"{name}.yaml")
        files[-1].write_text(earlier(text, 8, duration_s=12))
    command = [TILTPROOF, "run", *files, "--client", client, "--firmware", firmware, "--out", folder, "--no-report", "--no-progress"]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode not in (0, 1):  # a firmware may fail a scenario that was written for another
        raise RuntimeError(f"{client}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    results = {s["name"]: s for s in json.loads((folder / "latest/results.json").read_text())["scenarios"]}
    if sorted(results) != sorted(SCENARIOS):
        raise RuntimeError(f"flown: {sorted(results)}")
    flights = {}
    for name, result in results.items():
        with open(folder / "latest" / name / "trace.csv", newline="") as file:
            flights[name] = (result, list(csv.DictReader(file)))
    return flights


class Equality(unittest.TestCase):
    maxDiff = None

    def check(self, firmware):
        tasks = IMAGES / f"freertos-{firmware}.elf"
        clients = {"executive": f"qemu:{IMAGES / f'executive-{firmware}.elf'}", "library": "host"}
        if tasks.exists():
            clients["tasks"] = f"qemu:{tasks}"
        with tempfile.TemporaryDirectory() as folder:
            flights = {name: fly(pathlib.Path(folder, name), client, firmware) for name, client in clients.items()}
        executive = flights.pop("executive")
        for other, flown in flights.items():
            for name, (result, rows) in flown.items():
                with self.subTest(f"{firmware}: executive and {other}", scenario=name):
                    self.assertEqual(len(rows), len(executive[name][1]))
                    self.assertEqual(len(rows), 1001)  # 12 s
                    self.assertTrue(all(fault["activations"] > 0 for fault in result["faults"]), result)
                    # Counters of frames on their way depend on when in a period they are sent.
                    for mine, theirs in zip(executive[name][1], rows):
                        flight = [{k: v for k, v in row.items() if not k.endswith("_count")} for row in (mine, theirs)]
                        if mine["t_s"] == "0":  # an image begins with its first tick, and has no state before
                            for row in flight:
                                row.pop("supervisor_state", None)
                        self.assertEqual(*flight)
                    for metric in ("firmware.failsafe_entered_count", "timing.firmware_missed_count"):
                        self.assertEqual(result["metrics"].get(metric), executive[name][0]["metrics"].get(metric), metric)
                    if other == "tasks":
                        self.assertEqual(result["trace_hash"], executive[name][0]["trace_hash"])
        return executive

    def test_paper(self):
        self.check("paper")

    def test_tolerant(self):
        executive = self.check("tolerant")
        self.assertGreater(executive["wire-link-silence-survive"][0]["metrics"]["firmware.failsafe_entered_count"], 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
