#!/usr/bin/env python3
"""A client that was written from docs/protocol.md alone flies that page's protocol `hum`: COBS, CRC-16, scaled integers, a stream of 250 Hz. The
same source is a library, a program behind pseudo-terminals, and an image on the emulated board.

Usage: streaming_test.py TILTPROOF IMAGE LIBRARY PROGRAM SOURCE-FOLDER
"""
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, IMAGE, LIBRARY, PROGRAM, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:6])
del sys.argv[1:6]

PERIOD_S = 0.004
HOVER = """\
name: quiet
model: quadrotor
duration_s: 8
link: {protocol: hum.yaml}
reference: {type: hover, at_m: [0, 0, 2]}
initial: {position_m: [0.2, -0.1, 1.8]}
criteria:
  - {name: arrives, stl: "always[5,8](position_error_m <= 0.02)"}
"""
NOISE = """\
faults:
  - {id: lost, type: frame.drop, target: both, start_s: 1, end_s: 7, parameters: {probability: 0.1}}
  - {id: noise, type: wire.bit_error, target: both, start_s: 1, end_s: 7, parameters: {ber: 0.0005}}
"""
CLIENTS = {"library": f"library:{LIBRARY}", "program": f"clocked:{PROGRAM} {{port}} {{reference_port}} {{baud}}", "image": f"qemu:{IMAGE}"}


class Streaming(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        [protocol] = re.findall(r"^```yaml\n(protocol: hum\n.*?)^```$", (SOURCE / "docs/protocol.md").read_text(), re.MULTILINE | re.DOTALL)
        (cls.folder / "hum.yaml").write_text(protocol)
        (cls.folder / "quiet.yaml").write_text(HOVER)
        (cls.folder / "noisy.yaml").write_text(HOVER.replace("quiet", "noisy") + NOISE)
        cls.flights = {}
        for name, client in CLIENTS.items():
            done = subprocess.run([TILTPROOF, "run", "quiet.yaml", "noisy.yaml", "--client", client, "--out", name, "--no-report", "--no-progress"],
                                  cwd=cls.folder, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{name}: {done.stdout}{done.stderr}"
            results = json.loads((cls.folder / name / "latest/results.json").read_text())
            cls.flights[name] = {flight["name"]: flight for flight in results["scenarios"]}

    def counts(self, client, flight, what):
        metrics = self.flights[client][flight]["metrics"]
        return [metrics[f"link.{line}.frames_{what}_count"] for line in ("to_client", "to_plant")]

    def test_every_message_is_taken_and_answered(self):
        periods = 8 / PERIOD_S
        for client in CLIENTS:
            with self.subTest(client):
                self.assertEqual(self.counts(client, "quiet", "rejected"), [0, 0])
                for count in self.counts(client, "quiet", "accepted"):
                    self.assertAlmostEqual(count, periods, delta=1)

    def test_what_is_damaged_is_refused_at_both_ends(self):
        for client in CLIENTS:
            with self.subTest(client):
                self.assertTrue(all(count > 50 for count in self.counts(client, "noisy", "rejected")), self.counts(client, "noisy", "rejected"))
                self.assertEqual(self.flights[client]["noisy"]["metrics"]["link.accepted_wrong_count"], 0)
                # One command for each state, and one start, as in the flight without faults.
                [states, _], [_, commands] = self.counts(client, "noisy", "accepted"), self.counts(client, "noisy", "sent")
                self.assertAlmostEqual(commands, states + 1, delta=1)

    def test_all_three_fly_the_same_bits(self):
        def motion(client, flight):
            with (self.folder / client / "latest" / flight / "trace.csv").open() as file:
                return [{name: text for name, text in row.items() if not name.endswith("_count") and name != "supervisor_state"}
                        for row in csv.DictReader(file)]
        for flight in ("quiet", "noisy"):
            flown = motion("library", flight)
            self.assertEqual(len(flown), 8 / PERIOD_S + 1)
            for client in ("program", "image"):
                self.assertEqual(motion(client, flight), flown, f"{client} {flight}")


if __name__ == "__main__":
    unittest.main(verbosity=2)
