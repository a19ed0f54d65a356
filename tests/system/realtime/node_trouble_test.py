#!/usr/bin/env python3
"""Every part of a run in real time is killed, stopped and told to end, from outside and in mid-flight.
Usage: node_trouble_test.py TILTPROOF PTY_FIRMWARE FIRMWARE_LIBRARY MINIMAL_LIBRARY"""
import os
import pathlib
import shutil
import signal
import sys
import tempfile
import time
import unittest

from flight import Flight, become_subreaper, wait_until, write_hover

PROGRAM, *_ = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(4))

# Duration of the flight before the trouble starts.
EVENT_S = 1.2
# The lease is 200 ms; the rest is for a machine that is busy.
DETECTION_S_MAX = 1.0
# Until the other nodes have handed in their logs and ended: they wait half a second for one that is dead.
WOUND_UP_S_MAX = 2.0
# A flight that this machine disturbed before anything happened to it says nothing.
ATTEMPTS_COUNT = 3

SIGNALS = {"kill": signal.SIGKILL, "stop": signal.SIGSTOP, "exit": signal.SIGTERM}
HOW = {"kill": r"killed by signal 9 \(Killed\)", "stop": "does not answer: its process is stopped", "exit": r"(exited with code 0|was ended \(signal 15, Terminated\))"}


class NodeTroubleTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-realtime-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def fly_until_event(self, duration_s=6):
        for attempt in range(ATTEMPTS_COUNT):
            folder = self.folder / str(attempt)
            folder.mkdir()
            flight = Flight(PROGRAM, folder, write_hover(folder, duration_s=duration_s))
            self.addCleanup(flight.end)
            flight.wait_flying()
            nodes = flight.wait_fly_for(EVENT_S)
            if nodes is not None:
                return flight, nodes
        self.fail(f"no flight lasted for {EVENT_S} s: {flight.text()}")

    def trouble_with(self, role, how, verdict, code, reason):
        flight, nodes = self.fly_until_event()
        sent = time.monotonic()
        os.kill(nodes[role], SIGNALS[how])
        # Once it has noticed, the run is wound up: the other nodes end.
        others = [pid for name, pid in nodes.items() if name not in (role, "worker", "main")]
        wait_until(lambda: not all(os.path.exists(f"/proc/{pid}") for pid in others), 15, "the run did not end")
        wound_up_s = time.monotonic() - sent
        self.assertEqual(flight.wait(15), code, flight.text())
        result = flight.result()
        self.assertEqual(result["verdict"], verdict, flight.text())
        self.assertRegex(result["reason"], reason)
        self.assertRegex(result["reason"], r"\(at \d+\.\d+ s\)")
        # By the flight's clock, which starts a moment after the ports are open, and stands when the plant is dead.
        detection_s = flight.events("node_lost")[0]["time_s"] - (sent - flight.armed_at)
        print(f"{role} {how}: seen after {1e3 * detection_s:.0f} ms, wound up after {1e3 * wound_up_s:.0f} ms; {result['reason']}",
              file=sys.stderr, flush=True)
        self.assertLess(detection_s, DETECTION_S_MAX)
        self.assertLess(wound_up_s, WOUND_UP_S_MAX)
        flight.check_results(self)
        flight.check_nothing_left(self)

    # the worker process, which conducts

    def trouble_with_worker(self, how, timeout_s, reason, duration_s=6):
        flight, nodes = self.fly_until_event(duration_s)
        sent = time.monotonic()
        os.kill(nodes["worker"], SIGNALS[how])
        self.assertEqual(flight.wait(timeout_s), 3, flight.text())
        print(f"worker {how}: ended after {time.monotonic() - sent:.1f} s; {flight.result()['reason']}", file=sys.stderr, flush=True)
        self.assertEqual(flight.result()["verdict"], "error")
        self.assertRegex(flight.result()["reason"], reason)
        flight.check_results(self)
        flight.check_nothing_left(self)

    def test_worker_kill(self):
        self.trouble_with_worker("kill", 5, r"killed by signal 9 \(Killed\) at \d\.\d+ s of the flight")

    def test_worker_exit(self):
        self.trouble_with_worker("exit", 5, r"a signal ended the worker process alone: .*(interrupted|the flight ended) at [1-9]\.")

    def test_worker_stop(self):
        self.trouble_with_worker("stop", 30, r"stood still for 12 s at \d\.\d+ s of the flight and was killed", duration_s=2)

    # the process that the user started

    def test_main_kill(self):
        flight, nodes = self.fly_until_event()
        os.kill(nodes["main"], signal.SIGKILL)
        self.assertEqual(flight.wait(5), -signal.SIGKILL)
        flight.check_nothing_left(self)
        flight.check_results(self, finished=False)

    def test_main_exit(self):
        for _ in range(ATTEMPTS_COUNT):
            flight, nodes = self.fly_until_event()
            os.kill(nodes["main"], signal.SIGTERM)
            self.assertEqual(flight.wait(5), 130)
            # On a busy machine a node may be given up just before the signal.
            if not flight.events("node_lost"):
                break
        self.assertEqual(flight.result()["verdict"], "inconclusive")
        self.assertRegex(flight.result()["reason"], r"(interrupted|the flight ended) at [1-9]\.")
        flight.check_results(self)
        flight.check_nothing_left(self)

    def test_main_stop(self):
        # It only waits: the flight goes on without it, and it reports when it is continued.
        flight, nodes = self.fly_until_event(duration_s=2)
        os.kill(nodes["main"], signal.SIGSTOP)
        wait_until(lambda: set(flight.nodes()) == {"main"}, 10, "the flight did not end by itself")
        os.kill(nodes["main"], signal.SIGCONT)
        code = flight.wait(5)
        verdict = flight.result()["verdict"]
        self.assertIn((verdict, code), (("pass", 0), ("inconclusive", 4)), flight.text())
        flight.check_results(self)
        flight.check_nothing_left(self)


def add_matrix():
    for role in ("plant", "link", "base_station", "client"):
        for how, ended in HOW.items():
            verdict, code = ("fail", 1) if role == "client" else ("error", 3)
            who = f"the {role} node"
            if role == "client" and how == "stop":
                # Not by itself: that is this machine's doing.
                verdict, code = "error", 3
            elif role == "client":
                who = "firmware lost at .* node"

            def test(self, role=role, how=how, verdict=verdict, code=code, reason=f"{who}.* {ended}"):
                self.trouble_with(role, how, verdict, code, reason)
            setattr(NodeTroubleTest, f"test_{role}_{how}", test)


add_matrix()
if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
