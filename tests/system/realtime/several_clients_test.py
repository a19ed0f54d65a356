#!/usr/bin/env python3
"""Two clients on one vehicle in real time: a client node and a link node for each, and one that dies alone.
Usage: several_clients_test.py TILTPROOF PTY_FIRMWARE FIRMWARE_LIBRARY MINIMAL_LIBRARY"""
import csv
import json
import os
import pathlib
import shutil
import signal
import struct
import sys
import tempfile
import unittest

from flight import Flight, become_subreaper, read, write_hover

PROGRAM, PTY_FIRMWARE, LIBRARY, _ = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(4))
NODES = {"main", "worker", "plant", "base_station", "link-a", "link-b", "client-a", "client-b"}
CLIENTS = "clients: [{id: a}, {id: b}]\narbiter: {type: single, client: a}\n"


def records_of_line(content, owner):
    """Begin, direction, side and bytes of each record of the owner (docs/wire.md)."""
    at = 8
    while at < len(content):
        begin_ns, client, direction, side, size = struct.unpack_from("<qBBBH", content, at)
        at += 13 + size
        if client == owner:
            yield begin_ns, direction, side, content[at - size:at]


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
        flight = self.start("--client", "host", "--client", f"a=process:exec {PTY_FIRMWARE} {LIBRARY}")
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
        lost = flight.events("client_crashed")
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

    def test_a_backup_takes_over_from_a_client_that_dies(self):
        """Two boards of `failover`, a program and a library, talk on a line. It is noisy for a while, and then one board dies."""
        path = write_hover(self.folder)
        path.write_text(path.read_text() + "firmware: failover\nclients: [{id: a}, {id: b}]\nlines: [{id: cross, between: [a, b]}]\n"
                        "arbiter: {type: primary_backup, timeout_ms: 60}\n"
                        "faults: [{id: noise, type: wire.byte_swap, target: cross_to_b, start_s: 1, end_s: 2, parameters: {probability: 0.01}},\n"
                        "         {id: killed, type: node.kill, client: a, start_s: 3, parameters: {node: client}}]\n")
        flight = Flight(PROGRAM, self.folder, path, "--client",
                        f"a=process:exec {PTY_FIRMWARE} {LIBRARY} {{port}} {{reference_port}} {{cross_port}}")
        self.addCleanup(flight.end)
        flight.wait(40)
        self.check_line(flight)
        metrics = flight.result()["metrics"]
        self.assertEqual(metrics["survival.time_s"], 6, flight.result()["reason"])
        self.assertLess(metrics["tracking.max_error_m"], 0.5)
        self.assertEqual(metrics["redundancy.clients_lost_count"], 1)
        self.assertGreaterEqual(metrics["redundancy.switches_count"], 1)
        last = read(flight.run_folder / "hover/trace.csv").split(b"\n")
        selected = last[0].decode().split(",").index("arbiter_selected")
        self.assertEqual(float(last[-2].split(b",")[selected]), 1)

    def check_line(self, flight):
        """Byte by byte, one end gets what the other one sends, but for bytes that the fault has swapped. The boards hear it."""
        streams = {}
        for begin_ns, direction, side, data in records_of_line(read(flight.run_folder / "hover/link.bin"), 2):
            streams.setdefault((direction, side), []).extend((begin_ns, byte) for byte in data)
        to_b, to_a = (tuple(streams[direction, side] for side in (0, 1)) for direction in (0, 1))
        self.assertGreater(len(to_a[0]), 6 / 0.012 * 30 * 0.9)
        self.assertEqual(*([byte for _, byte in stream] for stream in to_a))
        sent, got = ([byte for _, byte in stream] for stream in to_b)
        wrong = [i for i, pair in enumerate(zip(sent, got)) if pair[0] != pair[1]]
        for i in wrong[::2]:
            self.assertTrue(0.99e9 < to_b[0][i][0] < 2.01e9, to_b[0][i])
            got[i:i + 2] = got[i + 1], got[i]
        self.assertGreater(len(wrong), 0)
        self.assertEqual(got, sent)
        rows = list(csv.DictReader(read(flight.run_folder / "hover/trace.csv").decode().splitlines()))
        self.assertEqual({row["role_b"] for row in rows if 2.5 < float(row["t_s"]) < 3}, {"0"})
        self.assertEqual({row["role_b"] for row in rows if float(row["t_s"]) > 3.2}, {"1"})

    def test_a_fault_on_a_node_means_the_node_of_its_client(self):
        flight = self.start(more="faults: [{id: killed, type: node.kill, client: b, start_s: 2, parameters: {node: client}}]\n")
        flight.wait(40)
        self.check_flown_by_a(flight)
        self.assertEqual([event["client"] for event in flight.events("client_crashed")], ["b"])
        self.assertEqual(json.loads(read(flight.run_folder / "results.json"))["scenarios"][0]["faults"][0]["activations"], 1)


if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
