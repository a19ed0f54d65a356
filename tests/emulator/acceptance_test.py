#!/usr/bin/env python3
"""An image that is not ours, firmware/examples/minimal_c, passes every mild level of scenarios/acceptance that the emulated board can take: among
them those that a library cannot.

The library of the same firmware passes the others (tests/harness/cli/acceptance_test.py). Where little depends on the board's own time, the image
flies a shorter flight with the same fault, and stays within a centimetre of the library.

Usage: acceptance_test.py TILTPROOF FOLDER-OF-IMAGES SOURCE-FOLDER
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

from same_flight import earlier

TILTPROOF, IMAGES, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
del sys.argv[1:4]

IMAGE, LIBRARY = f"qemu:{IMAGES / 'minimal_c.elf'}", TILTPROOF.parent / "lib/minimal_firmware.so"
ONLY_HERE = {"acceptance-mild-uart-overrun", "acceptance-mild-device-stall"}
NOT_HERE = {"acceptance-mild-node-pause", "acceptance-mild-dds-loss"}  # real time
MILD = SOURCE / "scenarios/acceptance/mild"
# Faults of the vehicle, and of the line by number of frame or byte.
AS_THE_LIBRARY = sorted(file for kind in ("actuator-*", "plant-*", "sensor-*", "frame-d[ru]*", "frame-n*", "frame-re*", "*-silence", "wire-byte-drop")
                        for file in MILD.glob(f"{kind}.yaml"))


class Acceptance(unittest.TestCase):
    def fly(self, scenarios, client, folder, *flags):
        done = subprocess.run([TILTPROOF, "run", *scenarios, "--client", client, "--out", folder, "-j", "2", "--no-report", "--no-progress", *flags],
                              capture_output=True, text=True, check=False)
        results = json.loads((folder / "latest/results.json").read_text())
        verdicts = {flight["name"]: flight["verdict"] for flight in results["scenarios"]}
        self.assertEqual({name: verdict for name, verdict in verdicts.items() if verdict != "pass"}, {}, done.stdout + done.stderr)
        for flight in results["scenarios"]:
            self.assertTrue(all(fault["activations"] > 0 for fault in flight["faults"]), flight)
        return verdicts.keys(), {flight["name"] for flight in results["not_applicable"]}

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_minimal_c_passes_every_mild_level(self):
        suite, others = self.folder / "mild", sorted(set(MILD.glob("*.yaml")) - set(AS_THE_LIBRARY))
        self.assertEqual(len(AS_THE_LIBRARY), 20)
        suite.mkdir()
        for file in others:
            (suite / file.name).symlink_to(file)
        flown, not_applicable = self.fly([suite], IMAGE, self.folder / "out", "--keep", "verdicts")
        self.assertEqual(not_applicable, NOT_HERE)
        self.assertLessEqual(ONLY_HERE, flown)
        self.assertEqual(len(flown), len(others) - len(NOT_HERE))

    def test_minimal_c_flies_as_its_library(self):
        scenarios = []
        for file in AS_THE_LIBRARY:
            scenarios.append(self.folder / file.name)
            scenarios[-1].write_text(earlier(file.read_text(), 8, duration_s=9))
        for name, client in (("image", IMAGE), ("library", f"library:{LIBRARY}")):
            flown, _ = self.fly(scenarios, client, self.folder / name)
            self.assertEqual(len(flown), len(scenarios))
        for flight in flown:
            with self.subTest(flight):
                image, library = (self.rows(self.folder / name / "latest" / flight) for name in ("image", "library"))
                self.assertEqual((len(image), len(library)), (751, 751))
                for columns, apart_max in ((("x_m", "y_m", "z_m"), 0.01), (("roll_rad", "pitch_rad", "yaw_rad"), 0.005)):
                    for column in columns:
                        self.assertLessEqual(max(abs(float(a[column]) - float(b[column])) for a, b in zip(image, library)), apart_max, column)

    def rows(self, folder):
        with open(folder / "trace.csv", newline="") as file:
            return list(csv.DictReader(file))


if __name__ == "__main__":
    unittest.main(verbosity=2)
