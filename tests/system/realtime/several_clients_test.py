#!/usr/bin/env python3
"""Two clients on one vehicle in real time: a client node and a link node for each, and one that dies alone.
Usage: several_clients_test.py TILTPROOF PTY_FIRMWARE FIRMWARE_LIBRARY MINIMAL_LIBRARY"""
import json
import os
import pathlib
import shutil
import signal
import sys
import tempfile
import unittest

from flight import Flight, become_subreaper, read, write_hover

PROGRAM, PTY_FIRMWARE, LIBRARY, _ = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(4))
NODES = {"main", "worker", "plant", "base_station", "link-a", "link-b", "client-a", "client-b"}
CLIENTS = "clients: [{id: a}, {id: b}]\narbiter: {type: single, client: a}\n"


class SeveralClientsTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-several-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def start(self, *arguments, more="", duration_s=6):
        path = write_hover(self.folder, duration_s=duration_s)
        path.write_text(path.read_text() + CLIENTS + more)
        flight = Flight(PROGRAM, self.folder, path, *arguments)
        self.addCleanup(flight.end)
        return flight

    def check_flown_by_a(self, flight, duration_s=6):
        """To the end, as if the other were not there."""
        flight.check_results(self)
        flight.check_nothing_left(self)
        result = flight.result()
        metrics = result["metrics"]
        self.assertEqual(metrics["survival.time_s"], duration_s, result["reason"])
        self.assertLess(metrics["tracking.max_error_m"], 0.5)
        self.assertGreater(metrics["link.a.to_plant.frames_accepted_count"], 0.9 * 2 * duration_s / 0.012)
        for direction in ("to_client", "to_plant", "reference"):
            self.assertEqual(metrics[f"link.a.{direction}.frames_rejected_count"], 0)
        return result

    def test_two_clients_have_nodes_lines_and_logs_of_their_own(self):
        flight = self.start("--client", "host", "--client", f"b=process:exec {PTY_FIRMWARE} {LIBRARY}")
        self.assertEqual(set(flight.wait_flying(count=8)), NODES)
        flight.wait(30)
        metrics = self.check_flown_by_a(flight)["metrics"]
        for name in ("to_client", "to_plant", "reference"):
            self.assertGreater(metrics[f"link.b.{name}.frames_accepted_count"], 400)
        for client in "ab":
            self.assertAlmostEqual(metrics[f"timing.{client}.request_period_mean_ms"], 12, delta=0.5)
        header = read(flight.run_folder / "hover/trace.csv").split(b"\n")[0].decode().split(",")
        for column in ("commanded_a_f_r_n", "commanded_b_f_r_n", "sensed_b_x_m"):
            self.assertIn(column, header)

    def test_a_client_that_dies_leaves_the_other_alone(self):
        flight = self.start()
        flight.wait_flying(count=8)
        nodes = flight.wait_fly_for(2)
        self.assertIsNotNone(nodes, flight.text())
        os.kill(nodes["client-b"], signal.SIGKILL)
        flight.wait(30)
        result = self.check_flown_by_a(flight)
        lost = flight.events("client_lost")
        self.assertEqual([event["client"] for event in lost], ["b"])
        self.assertLess(result["metrics"]["link.b.to_plant.frames_sent_count"], 2 * 4 / 0.012)

    def test_the_death_of_the_client_that_flies_is_the_end(self):
        flight = self.start()
        flight.wait_flying(count=8)
        nodes = flight.wait_fly_for(1)
        self.assertIsNotNone(nodes, flight.text())
        os.kill(nodes["client-a"], signal.SIGKILL)
        flight.wait(30)
        result = flight.result()
        self.assertEqual(result["verdict"], "fail")
        self.assertIn("its node client-a", result["reason"])

    def test_a_fault_on_a_node_means_the_node_of_its_client(self):
        flight = self.start(more="faults: [{id: killed, type: node.kill, client: b, start_s: 2, parameters: {node: client}}]\n")
        flight.wait(40)
        self.check_flown_by_a(flight)
        self.assertEqual([event["client"] for event in flight.events("client_lost")], ["b"])
        self.assertEqual(json.loads(read(flight.run_folder / "results.json"))["scenarios"][0]["faults"][0]["activations"], 1)


if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
