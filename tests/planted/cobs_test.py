#!/usr/bin/env python3
"""`tiltproof fuzz --protocol FILE` finds the defects of a decoder of another framing: each one of cobs_client.c, with a
fixed seed and a fixed number of inputs, as a scenario that breaks that client and not the correct one.

Usage: cobs_test.py TILTPROOF FOLDER-OF-LIBRARIES
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
TILTPROOF, LIBRARIES = (pathlib.Path(argument) for argument in sys.argv[1:3])
del sys.argv[1:3]
DEFECTS = {
    "code_beyond_end": "crash", "full_block": "crash", "length_unchecked": "crash", "check_ignored": "stale",
    "range_unchecked": "command", "state_kept": "silence", "reset_missing": "silence",
}
RUNS = 1000


class Cobs(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def client(self, name):
        return f"library:{LIBRARIES}/planted_cobs_{name}.so"

    def fuzz(self, name):
        out = self.root / name
        done = subprocess.run([TILTPROOF, "fuzz", "--protocol", HERE / "cobs.yaml", "--client", self.client(name), "--runs", str(RUNS),
                               "--seed", "1", "--out", out, "--no-progress"], capture_output=True, text=True, timeout=300)
        return done, json.loads((out / "fuzz.json").read_text())

    def verdict(self, name, scenario):
        done = subprocess.run([TILTPROOF, "run", scenario, "--client", self.client(name), "--out", self.root / "out", "--no-report",
                               "--no-progress"], capture_output=True, text=True, timeout=120)
        self.assertIn(done.returncode, (0, 1), done.stdout + done.stderr)
        return json.loads((self.root / "out/latest/results.json").read_text())["scenarios"][0]["verdict"]

    def test_fuzz_finds_each_defect(self):
        for name, kind in DEFECTS.items():
            with self.subTest(name):
                done, summary = self.fuzz(name)
                self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
                found = [finding for finding in summary["findings"] if finding["kind"] == kind and finding["confirmed"]]
                self.assertTrue(found, summary["findings"])
                self.assertEqual(self.verdict(name, found[0]["file"]), "fail")
                self.assertEqual(self.verdict("correct", found[0]["file"]), "pass")

    def test_fuzz_finds_nothing_in_the_correct_client(self):
        done, summary = self.fuzz("correct")
        self.assertEqual((done.returncode, summary["findings"]), (0, []), done.stdout + done.stderr)
        self.assertGreater(summary["executions"], RUNS * 0.9)


if __name__ == "__main__":
    unittest.main()
