#!/usr/bin/env python3
"""A node that waits for a processor, as on a busy host of virtual machines, does not hang.

Usage: stolen_time_test.py TILTPROOF
"""
import multiprocessing
import os
import pathlib
import shutil
import sys
import tempfile
import time
import unittest

from flight import Flight, become_subreaper, write_hover

PROGRAM = pathlib.Path(sys.argv.pop(1)).resolve()
SKIPPED = 77
# Longer than a node may be silent when it has a processor: lease and limit together are 1 s.
STOLEN_S = 1.6
EVENT_S = 1.2


def steal(processor):
    """Takes the processor before all others."""
    os.sched_setaffinity(0, {processor})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))
    end = time.monotonic() + STOLEN_S
    while time.monotonic() < end:
        pass


def pin(pid, processors):
    for thread in os.listdir(f"/proc/{pid}/task"):
        os.sched_setaffinity(int(thread), processors)


class StolenTimeTest(unittest.TestCase):
    def test_a_node_without_a_processor_is_waited_for(self):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-realtime-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        flight = Flight(PROGRAM, folder, write_hover(folder, duration_s=5))
        self.addCleanup(flight.end)
        flight.wait_flying()
        nodes = flight.wait_fly_for(EVENT_S)
        self.assertIsNotNone(nodes, flight.text())
        stolen, *others = sorted(os.sched_getaffinity(0))
        for role, pid in nodes.items():
            pin(pid, {stolen} if role == "base_station" else others)
        thief = multiprocessing.Process(target=steal, args=(stolen,), daemon=True)
        thief.start()
        thief.join()
        code = flight.wait(20)
        # A hover needs no more words from the base station. What else this machine did is another matter.
        self.assertIn(code, (0, 4), flight.text())
        self.assertEqual(flight.result()["end_reason"], "completed", flight.text())
        silent = [event["text"] for event in flight.events("node_silent")]
        self.assertTrue(any("base_station" in text for text in silent), silent)


if __name__ == "__main__":
    become_subreaper()
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, *before)
    except PermissionError:
        print("not run: real-time scheduling is not permitted here")
        sys.exit(SKIPPED)
    if len(os.sched_getaffinity(0)) < 2:
        print("not run: it takes one of two processors")
        sys.exit(SKIPPED)
    unittest.main(argv=sys.argv[:1], verbosity=1)
