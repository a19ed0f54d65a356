#!/usr/bin/env python3
"""Several clients on one vehicle, as a user flies them. Usage: clients_test.py TILTPROOF SOURCE_DIR"""
import csv
import json
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = (pathlib.Path(a).resolve() for a in sys.argv[1:3])

FLIGHT = """\
name: {name}
firmware: tolerant
seed: 5
duration_s: 3
reference: {{type: spiral, time_s: 60}}
{more}
criteria:
  - {{name: near, stl: "always(position_error_m <= 3.0)"}}
"""
TWO = "clients: [{id: a}, {id: b}]"
SILENT = "faults: [{id: silent, type: link.silence, client: %s, target: both}]"
NOISY = "faults: [{id: noisy, type: wire.bit_error, client: b, target: both, start_s: 0.5, parameters: {ber: 0.002}}]"


class ClientsTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-clients-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def tiltproof(self, *arguments):
        return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=self.folder, timeout=120, check=False)

    def scenario(self, name, *more):
        file = self.folder / f"{name}.yaml"
        file.write_text(FLIGHT.format(name=name, more="\n".join(more)))
        return file

    def fly(self, name, *more, flags=()):
        """The folder of one flight."""
        done = self.tiltproof("run", self.scenario(name, *more), "--no-progress", *flags)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return (self.folder / "results/latest").resolve() / name

    def motion(self, flight):
        """The 21 columns of time, states and inputs, as text."""
        with open(flight / "trace.csv", newline="") as file:
            rows = list(csv.reader(file))
        self.assertEqual((rows[0][0], rows[0][20]), ("t_s", "tau_l_nm"))
        self.assertEqual(len(rows), 3000 // 12 + 2)
        return [row[:21] for row in rows]

    def hash(self, flight):
        return json.loads((flight / "verdict.json").read_text())["trace_hash"]

    def lines_of(self, flight, client):
        """The records of one client's lines."""
        content = (flight / "link.bin").read_bytes()
        self.assertEqual(content[:8], b"TPLINK2\n")
        at, records = 8, []
        while at < len(content):
            begin_ns, of, direction, side, size = struct.unpack_from("<qBBBH", content, at)
            at += 13 + size
            if of == client:
                records.append((begin_ns, direction, side, content[at - size:at]))
        self.assertEqual(at, len(content))
        return records

    def test_a_silent_second_client_changes_nothing(self):
        alone = self.fly("alone")
        for silent, flies in (("b", "a"), ("a", "b")):
            both = self.fly("both", TWO, f"arbiter: {{type: single, client: {flies}}}", SILENT % silent)
            self.assertEqual(self.motion(both), self.motion(alone))
            self.assertEqual(self.lines_of(both, "ab".index(flies)), self.lines_of(alone, 0))

    def test_apart_they_fly_the_same(self):
        together = self.fly("together", TWO, NOISY)
        for transport in ("socket", "dds"):
            apart = self.fly("together", TWO, NOISY, flags=[f"--distributed={transport}"])
            self.assertEqual(self.hash(apart), self.hash(together), transport)
            self.assertEqual((apart / "link.bin").read_bytes(), (together / "link.bin").read_bytes(), transport)
        self.assertEqual(self.tiltproof("replay", together.parent).returncode, 0)
        self.assertEqual(self.tiltproof("score", together.parent).returncode, 0)

    def test_a_fault_on_one_line_leaves_the_other_as_it_was(self):
        clean, noisy = self.fly("clean", TWO), self.fly("noisy", TWO, NOISY)
        self.assertEqual(self.motion(noisy), self.motion(clean))
        self.assertEqual(self.lines_of(noisy, 0), self.lines_of(clean, 0))
        self.assertNotEqual(self.lines_of(noisy, 1), self.lines_of(clean, 1))
        metrics = json.loads((noisy / "verdict.json").read_text())["metrics"]
        self.assertEqual(metrics["link.a.to_client.frames_rejected_count"], 0)
        self.assertGreater(metrics["link.b.to_client.frames_rejected_count"], 0)

    def test_a_fault_for_all_draws_for_each(self):
        flight = self.fly("all", TWO, NOISY.replace("client: b, ", "").replace("0.002", "0.0001"))
        a, b = self.lines_of(flight, 0), self.lines_of(flight, 1)
        # Both clients are sent the same at first, but different bytes arrive.
        self.assertNotEqual([record for record in a if record[2]], [record for record in b if record[2]])

    def test_names_of_columns_metrics_and_files(self):
        flight = self.fly("names", TWO)
        header = (flight / "trace.csv").read_text().splitlines()[0].split(",")
        for column in ("sensed_a_x_m", "sensed_b_x_m", "commanded_a_f_r_n", "commanded_b_tau_l_nm", "arbiter_selected", "to_plant_b_frames_sent_count"):
            self.assertIn(column, header)
        self.assertNotIn("commanded_f_r_n", header)
        metrics = json.loads((flight / "verdict.json").read_text())["metrics"]
        for metric in ("link.a.to_client.frames_sent_count", "timing.b.request_period_mean_ms", "firmware.a.restarts_count", "tracking.rmse_m"):
            self.assertIn(metric, metrics)
        self.assertNotIn("link.resync_max_ms", metrics)
        self.assertTrue((flight / "firmware.a.log").exists() and (flight / "firmware.b.log").exists())
        self.assertFalse((flight / "firmware.log").exists())
        dumped = self.tiltproof("link-dump", flight / "link.bin").stdout.splitlines()
        self.assertEqual(dumped[0].split()[:3], ["#", "begin_s", "client"])
        self.assertEqual({line.split()[1] for line in dumped[1:]}, {"a", "b"})

    def test_a_client_of_its_own_for_an_id(self):
        library = next(PROGRAM.parent.rglob("libtiltproof_firmware.so"))
        flight = self.fly("own", TWO, flags=["--client", "host", "--client", f"b=library:{library}"])
        run = json.loads((flight.parent / "run.json").read_text())
        self.assertEqual((run["client"], run["clients"]), ("host", {"b": f"library:{library}"}))
        self.assertEqual(self.tiltproof("replay", flight.parent).returncode, 0)

    def test_mistakes(self):
        two = self.scenario("two", TWO)
        for arguments, why in ((["--client", "c=host"], "no scenario has a client 'c'; there are: a, b"), (["--client", "a=hots"], "did you mean host"),
                               (["--client", "a=host", "--client", "a=host"], "has one already")):
            done = self.tiltproof("run", two, *arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertIn(why, done.stderr)
        for more, why in (("clients: [{id: a}, {id: a}]", "'a' is taken already"), ("clients: [{id: a-b}]", "letters, digits and '_'"),
                          (f"{TWO}\narbiter: {{type: single, client: c}}", "there is no client 'c'"),
                          (f"{TWO}\narbiter: {{type: voting_of_all}}", "valid: single"), (f"{TWO}\n{SILENT % 'x'}", "there is no client 'x'"),
                          (f"{TWO}\nfaults: [{{id: f, type: actuator.loss_of_effectiveness, client: a, parameters: {{actuator: f_r, factor: 0.9}}}}]",
                           "acts on the vehicle")):
            done = self.tiltproof("check", self.scenario("wrong", more))
            self.assertEqual(done.returncode, 2, more)
            self.assertIn(why, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
