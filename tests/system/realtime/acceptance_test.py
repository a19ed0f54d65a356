#!/usr/bin/env python3
"""A firmware that is not ours, firmware/examples/minimal_c as a program with serial ports, passes the mild levels of scenarios/acceptance that need
real time.
Usage: acceptance_test.py TILTPROOF PTY_FIRMWARE FIRMWARE_LIBRARY MINIMAL_LIBRARY"""
import pathlib
import shutil
import sys
import tempfile
import unittest

from flight import Flight, become_subreaper

PROGRAM, PTY_FIRMWARE, _, MINIMAL = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(4))
SUITE = pathlib.Path(__file__).resolve().parents[3] / "scenarios/acceptance/mild"


class AcceptanceTest(unittest.TestCase):
    def test_minimal_c_passes_the_mild_levels_that_need_real_time(self):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-acceptance-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        flight = Flight(PROGRAM, folder, SUITE, "-k", "node-pause or dds-loss", "--client", f"process:exec {PTY_FIRMWARE} {MINIMAL}")
        self.addCleanup(flight.end)
        flight.wait(120)
        results = flight.run_results()
        self.assertEqual({result["name"] for result in results}, {"acceptance-mild-node-pause", "acceptance-mild-dds-loss"})
        # A machine that was too busy to judge the firmware has still flown it.
        for result in results:
            if not result["green"]:
                self.assertIn("too busy to judge", result["reason"], flight.text())
        flight.check_results(self)
        flight.check_nothing_left(self)


if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
