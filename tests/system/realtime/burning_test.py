#!/usr/bin/env python3
"""A program whose own processes take the processors has itself to blame; one that others keep from them has not.

Usage: burning_test.py TILTPROOF SOURCE_DIR
"""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from flight import Flight, become_subreaper

PROGRAM, SOURCE = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(2))
SKIPPED = 77
ATTEMPTS_MAX = 3
OWN = "the firmware's own processes"
BURNERS_COUNT = 40
IDLE_MIN = 0.75  # of the processors, before a flight; others' load makes the flight inconclusive, as it must
# Orphans, each in a session of its own.
BURN = """\
import os, sys, time
for _ in range(int(sys.argv[1])):
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            time.sleep(float(sys.argv[2]))
            while True:
                pass
        os._exit(0)
    os.wait()
"""
SCENARIO = """\
name: hover
duration_s: 6
start_within_s: 30
reference: {type: hover, at_m: [0, 0, 2]}
control_period: {tolerance_percent: 50}
criteria:
  - {name: never, stl: "CRITERION"}
"""


def idle_share():
    """Of the processors' time within a second (proc(5), stat)."""
    def now():
        return [int(word) for word in pathlib.Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    before = now()
    time.sleep(1)
    spent = [b - a for a, b in zip(before, now())]
    return spent[3] / max(sum(spent), 1)


class BurningTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-burning-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        (self.folder / "burn.py").write_text(BURN)
        # As a user without the right to real-time scheduling, whose nodes have no precedence.
        self.program = PROGRAM
        if os.geteuid() == 0:
            self.program = self.folder / "tiltproof"
            self.program.write_text(f'#!/bin/sh\nexec setpriv --inh-caps=-sys_nice --bounding-set=-sys_nice {PROGRAM} "$@"\n')
            self.program.chmod(0o755)
        subprocess.run([PROGRAM, "design-lqr", "tiltrotor", "--csv", self.folder / "gain.csv"], stdout=subprocess.DEVNULL, check=True)

    def fly(self, criterion, before=""):
        (self.folder / "hover.yaml").write_text(SCENARIO.replace("CRITERION", criterion))
        example = SOURCE / "firmware/examples/python/hover.py"
        command = f"{before} exec {sys.executable} {example} {self.folder}/gain.csv {{port}} {{reference_port}}"
        flight = Flight(self.program, self.folder, "hover.yaml", "--client", f"process:{command}")
        self.addCleanup(flight.end)
        return flight

    def own(self):
        share = idle_share()
        if share < IDLE_MIN:
            self.skipTest(f"others use this machine: {share:.0%} idle")
        return f"{sys.executable} {self.folder}/burn.py {BURNERS_COUNT} 0.3;"

    def fly_late(self, criterion):
        """A flight that its own processes made too late, and its exit code. In some attempts: others may use the machine, or too few periods be late."""
        for _ in range(ATTEMPTS_MAX):
            flight = self.fly(criterion, self.own())
            code = flight.wait(60)
            if OWN in flight.result()["reason"]:
                return flight, code
        self.fail(flight.text())

    def test_its_own_processes_excuse_no_failure(self):
        flight, code = self.fly_late("always(position_error_m <= -1)")
        self.assertEqual(code, 1, flight.text())
        self.assertRegex(flight.result()["reason"], rf"used [\d.]+ s of the [\d.]+ s that {len(os.sched_getaffinity(0))} processors had")
        # None is left, in whatever session.
        self.assertFalse(flight.processes())

    def test_its_own_processes_give_no_pass(self):
        flight, code = self.fly_late("always(position_error_m <= 1000)")
        self.assertIn(code, (1, 4), flight.text())

    def test_processes_of_others_excuse_it(self):
        flight = self.fly("always(position_error_m <= -1)")
        flight.wait_flying()
        burners = []
        try:
            for _ in range(BURNERS_COUNT):
                burners.append(subprocess.Popen([sys.executable, "-c", "while True: pass"], start_new_session=True))
            code = flight.wait(60)
        finally:
            for burner in burners:
                os.kill(burner.pid, signal.SIGKILL)
                burner.wait()
        self.assertEqual(code, 4, flight.text())
        self.assertIn("too busy to judge", flight.result()["reason"])
        self.assertNotIn(OWN, flight.result()["reason"])

    def test_one_busy_processor_is_the_program_s_right(self):
        flight = self.fly("always(position_error_m <= -1)", f"{sys.executable} {self.folder}/burn.py 1 0 &")
        self.assertIn(flight.wait(60), (1, 4), flight.text())
        self.assertNotIn(OWN, flight.result()["reason"])


if __name__ == "__main__":
    become_subreaper()
    if len(os.sched_getaffinity(0)) < 2:
        print("not run: on one processor a program may use it")
        sys.exit(SKIPPED)
    unittest.main(argv=sys.argv[:1], verbosity=2)
