#!/usr/bin/env python3
"""A machine that is too slow decides nothing in lockstep: flights beside 16 endless loops are those of a quiet machine.

Usage: load_test.py TILTPROOF [stm32f4_images]: also in the emulator, where its images are built
"""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
MODES = ((), ("--distributed=socket",), ("--distributed=dds",), *([("--client", "qemu")] if any(sys.argv[2:]) else []))
LOOPS_COUNT = 16

FAULTY_FLIGHT = """\
name: faulty
duration_s: 3
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: bits, type: wire.bit_error, target: both, start_s: 1, end_s: 2, parameters: {ber: 0.0003}}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


class LoadTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-load-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        (self.folder / "faulty.yaml").write_text(FAULTY_FLIGHT)

    def fly(self, *flags):
        done = subprocess.run([PROGRAM, "run", "faulty.yaml", *flags], capture_output=True, cwd=self.folder, timeout=500, check=False, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        [flight] = json.loads((self.folder / "results/latest/results.json").read_text())["scenarios"]
        return flight["verdict"], flight["trace_hash"], flight["outcome"]

    def test_load_changes_no_flight(self):
        quiet = {mode: self.fly(*mode) for mode in MODES}
        loops = []
        try:
            for _ in range(LOOPS_COUNT):
                loops.append(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
            busy = {mode: self.fly(*mode) for mode in MODES}
        finally:
            for loop in loops:
                loop.kill()
                loop.wait()
        self.assertEqual(busy, quiet)
        # In the emulator another processor keeps the time.
        self.assertEqual(len({quiet[mode] for mode in MODES[:3]}), 1)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=1)
