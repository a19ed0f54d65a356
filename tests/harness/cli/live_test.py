#!/usr/bin/env python3
"""`run --live` in lockstep, and what its server refuses, over real sockets.
Usage: live_test.py TILTPROOF"""
import csv
import json
import pathlib
import signal
import socket
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from command_line import PROGRAM, CommandLineTest
from live_viewer import DeafViewer, LiveCommand, Viewer

LONG = """\
name: NAME
duration_s: 40
seed: 5
reference: {type: circle, radius_m: 2, period_s: 20, start_m: [2, 0, 2]}
faults:
  - {id: lost, type: frame.drop, target: to_client, start_s: 10, end_s: 20, parameters: {probability: 0.1}}
criteria:
  - {name: near, stl: "always(position_error_m <= 2.0)"}
"""


class LiveTest(CommandLineTest):
    def live(self, *arguments):
        command = LiveCommand(PROGRAM, self.folder, *arguments)
        self.addCleanup(command.end)
        return command.wait_page()

    def hashes(self):
        return {flight["name"]: flight["trace_hash"] for flight in self.results()["scenarios"]}

    def test_viewers_see_the_flights_and_change_nothing(self):
        path = self.scenario("far", LONG)
        repeated = ["run", path, "--repeat", 60, "--no-report"]
        self.assertEqual(self.tiltproof(*repeated)[0], 0)
        alone = self.hashes()
        live = self.live(*repeated, "--live", "0")
        deaf = [DeafViewer(live.port) for _ in range(3)]
        viewers = [Viewer(live.port) for _ in range(3)]
        self.assertEqual(live.wait(), 0, live.errors)
        self.assertEqual(self.hashes(), alone)
        for viewer in deaf:
            viewer.socket.close()
        for viewer in viewers:
            viewer.thread.join(20)
            self.assertEqual(viewer.of("status")[-1]["phase"], "ended")
            finished = viewer.of("finished")
            self.assertEqual([entry["name"] for entry in finished], list(alone))
            self.assertEqual({entry["name"]: entry["trace_hash"] for entry in finished}, alone)
            self.assertTrue(viewer.of("flight"))
        # A sample on the page is that row of the trace.
        viewer = max(viewers, key=lambda v: len(v.events))
        flights = {head["flight"]: head for head in viewer.of("flight")}
        data = viewer.of("rows")[0]
        head = flights[data["flight"]]
        with open(self.latest() / head["name"] / "trace.csv", newline="") as file:
            trace = {float(row["t_s"]): row for row in csv.DictReader(file)}
        seen = 0
        for row in data["rows"]:
            values = dict(zip(head["row"], row))
            for column in ("x_m", "z_m", "f_r_n", "x_ref_m", "active_lost", "sensed_z_m", "to_client_frames_sent_count"):
                value = float(trace[values["t_s"]][column])
                if value == value:
                    self.assertAlmostEqual(values[column], value, delta=1e-6 * max(abs(value), 1e-3))
                    seen += 1
            error = sum((float(trace[values["t_s"]][f"{axis}_m"]) - float(trace[values["t_s"]][f"{axis}_ref_m"])) ** 2 for axis in "xyz") ** 0.5
            self.assertAlmostEqual(values["position_error_m"], error, delta=1e-6)
        self.assertGreater(seen, 6)

    def test_a_finished_flight_is_shown_as_in_the_report(self):
        path = self.scenario("far", LONG)
        live = self.live("run", path, "--repeat", 80, "--live", "0", "--no-report")
        viewer = Viewer(live.port).wait_for(lambda v: v.of("finished"), "a flight ends")
        entry = viewer.of("finished")[0]
        connection = socket.create_connection(("127.0.0.1", live.port))
        connection.sendall(f"GET /{entry['details']} HTTP/1.1\r\nHost: localhost:{live.port}\r\nConnection: close\r\n\r\n".encode())
        answer = b""
        while piece := connection.recv(65536):
            answer += piece
        head, _, body = answer.partition(b"\r\n\r\n")
        self.assertIn(b" 200 ", head)
        import zlib
        size = int.from_bytes(body[:4], "little")
        pack = zlib.decompress(body[4:4 + size])
        text = json.loads(pack[4:4 + int.from_bytes(pack[:4], "little")])
        self.assertEqual(text["result"]["trace_hash"], entry["trace_hash"])
        live.process.send_signal(signal.SIGINT)
        self.assertEqual(live.wait(30), 130)

    def test_refuses_what_is_not_for_it(self):
        live = self.live("run", self.scenario("far", LONG), "--repeat", 2000, "--live", "0", "--no-report", "--keep", "verdicts")
        status, headers, body = live.request("GET", "/")
        self.assertEqual(status, 200)
        self.assertIn('"live":', body)
        self.assertIn("connect-src 'self'", body)
        self.assertNotIn("Access-Control-Allow-Origin", headers)
        self.assertEqual(headers["X-Content-Type-Options"], "nosniff")
        self.assertIn("frame-ancestors 'none'", headers["Content-Security-Policy"])
        # Another name that leads to 127.0.0.1, and none at all.
        for host in ("evil.example", f"evil.example:{live.port}", "127.0.0.1:1", f"127.0.0.1:{live.port}.evil.example"):
            for path in ("/", "/events", "/flights/0"):
                self.assertEqual(live.request("GET", path, host=host)[0], 403, host)
        for method in ("PUT", "DELETE", "OPTIONS", "HEAD"):
            self.assertEqual(live.request(method, "/")[0], 405, method)
        for path in ("/nothing", "/flights/", "/flights/x", "/flights/99999999999999999999", "/../etc/passwd"):
            self.assertEqual(live.request("GET", path)[0], 404, path)
        # Buttons are for flights in real time.
        for button in ("start", "abort", "inject"):
            status, text = live.press(button, "{}")
            self.assertEqual(status, 403)
            self.assertIn("--mode realtime", text)
        self.assertEqual(live.request("POST", "/abort", "x" * 100_000)[0], 413)
        with socket.create_connection(("127.0.0.1", live.port)) as connection:
            connection.sendall(b"\x16\x03\x01 this is no HTTP\r\n\r\n")
            self.assertIn(b"400", connection.recv(100))
        # It listens on this machine alone.
        with socket.socket() as other:
            other.settimeout(5)
            self.assertNotEqual(other.connect_ex(("127.0.0.2", live.port)), 0)
        viewers = [Viewer(live.port).wait_for(lambda v: v.of("rows"), "it flies") for _ in range(2)]
        live.process.send_signal(signal.SIGINT)
        self.assertEqual(live.wait(30), 130, live.errors)
        for viewer in viewers:
            viewer.thread.join(20)
            self.assertEqual(viewer.of("status")[-1]["phase"], "ended")
        with socket.socket() as gone:
            self.assertNotEqual(gone.connect_ex(("127.0.0.1", live.port)), 0)

    def test_a_port_in_use(self):
        path = self.scenario("hover")
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = taken.getsockname()[1]
            code, out, err = self.tiltproof("run", path, "--live", port)
        self.assertEqual(code, 2)
        self.assertIn(f"--live: port {port} of 127.0.0.1 is in use", err)
        self.assertIn("or 0 for any that is free", err)
        self.assertFalse((self.folder / "results").exists())
        for arguments in (["--live", "70000"], ["--live", "0", "--live-wait"]):
            self.assertEqual(self.tiltproof("run", path, *arguments)[0], 2)
        self.assertEqual(self.tiltproof("node", "plant", "--http", "0")[0], 2)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
