#!/usr/bin/env python3
"""An image that is not ours, firmware/examples/minimal_c, passes every mild level of scenarios/acceptance that the emulated board can take: among
them those that a library cannot.

Usage: acceptance_test.py TILTPROOF FOLDER-OF-IMAGES SOURCE-FOLDER
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, IMAGES, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
del sys.argv[1:4]

ONLY_HERE = {"acceptance-mild-uart-overrun", "acceptance-mild-device-stall"}
NOT_HERE = {"acceptance-mild-node-pause", "acceptance-mild-dds-loss"}  # real time


class Acceptance(unittest.TestCase):
    def test_minimal_c_passes_every_mild_level(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([TILTPROOF, "run", SOURCE / "scenarios/acceptance/mild", "--client", f"qemu:{IMAGES / 'minimal_c.elf'}",
                                   "--out", folder, "-j", "2", "--keep", "verdicts", "--no-progress"], capture_output=True, text=True, check=False)
            results = json.loads(pathlib.Path(folder, "latest/results.json").read_text())
        verdicts = {flight["name"]: flight["verdict"] for flight in results["scenarios"]}
        self.assertEqual({name: verdict for name, verdict in verdicts.items() if verdict != "pass"}, {}, done.stdout + done.stderr)
        self.assertEqual({flight["name"] for flight in results["not_applicable"]}, NOT_HERE)
        self.assertLessEqual(ONLY_HERE, verdicts.keys())
        self.assertGreater(len(verdicts), 27)


if __name__ == "__main__":
    unittest.main(verbosity=2)
