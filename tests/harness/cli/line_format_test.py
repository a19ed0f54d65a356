#!/usr/bin/env python3
"""Characters of the line: link.data_bits, parity and stop_bits.

Usage: line_format_test.py TILTPROOF
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

TILTPROOF = pathlib.Path(sys.argv.pop(1)).resolve()

SCENARIO = """\
name: flight
duration_s: 3
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
"""
# Faults whose effect depends on the time of a byte, and on nothing else of the line.
TIMED = """\
faults:
  - {id: pieces, type: wire.chunking, target: to_client, start_s: 0.5, end_s: 1, parameters: {max_bytes_count: 16, gap_ms: 0.1}}
  - {id: stuck, type: wire.stuck_byte, target: both, start_s: 1, end_s: 1.5, parameters: {value: 17, length_bytes: 2, rate_hz: 50}}
  - {id: break, type: wire.break, target: to_client, start_s: 1.6, end_s: 1.6507}
  - {id: cap, type: wire.bandwidth_cap, target: to_client, start_s: 2, end_s: 2.2, parameters: {bytes_per_s: 20000}}
"""
NOISE = """\
faults:
  - {id: noise, type: wire.bit_error, target: both, start_s: 0.5, end_s: 2.5, parameters: {ber: 0.0001}}
  - {id: more, type: wire.bit_error, target: reference, start_s: 0.5, end_s: 2.5, parameters: {ber: 0.0001}}
"""


class LineFormat(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)
        self.folder = pathlib.Path(self._folder.name)

    def run_it(self, command, text, *more):
        (self.folder / "flight.yaml").write_text(text)
        out = ["--out", self.folder / "out", "--no-progress", "--no-report"] if command == "run" else []
        return subprocess.run([TILTPROOF, command, self.folder / "flight.yaml", *out, *more], capture_output=True, text=True)

    def fly(self, text, *more):
        done = self.run_it("run", text, *more)
        self.assertIn(done.returncode, (0, 1), done.stdout + done.stderr)
        return json.loads((self.folder / "out/latest/results.json").read_text())["scenarios"][0]

    def test_equal_byte_times_fly_equally(self):
        """10 bits at 921600 baud, 11 at 1013760 and 12 at 1105920 take the same time: the flights have the same bits."""
        for faults in ("", TIMED):
            usual = self.fly(SCENARIO + faults)
            self.assertEqual(usual["metrics"]["link.to_client.parity_errors_count"], 0)
            for link in ("baud: 1013760, reference_baud: 1013760, parity: even", "baud: 1013760, reference_baud: 1013760, stop_bits: 2",
                         "baud: 1105920, reference_baud: 1105920, parity: odd, stop_bits: 2"):
                other = self.fly(f"{SCENARIO}{faults}link: {{{link}}}\n")
                self.assertEqual(other["trace_hash"], usual["trace_hash"], link)
        other = self.fly(SCENARIO + TIMED + "link: {stop_bits: 2}\n")
        self.assertNotEqual(other["trace_hash"], usual["trace_hash"])

    def test_parity_errors_are_counted(self):
        text = SCENARIO + NOISE + "link: {parity: even}\n"
        result = self.fly(text)
        for line in ("to_client", "to_plant", "reference"):
            self.assertGreater(result["metrics"][f"link.{line}.parity_errors_count"], 0, line)
        # Two flips in one byte are rare, and so is each flip of a parity bit (1 of 9).
        both = sum(result["metrics"][f"link.{line}.bytes_corrupted_count"] for line in ("to_client", "to_plant", "reference"))
        errors = sum(result["metrics"][f"link.{line}.parity_errors_count"] for line in ("to_client", "to_plant", "reference"))
        self.assertAlmostEqual(both / errors, 8 / 9, delta=0.25)
        spread = self.fly(text, "--distributed")
        self.assertEqual(spread["trace_hash"], result["trace_hash"])
        self.assertEqual(spread["metrics"]["link.to_client.parity_errors_count"], result["metrics"]["link.to_client.parity_errors_count"])
        self.assertIn("parity: even", (self.folder / "out/latest/flight/scenario.resolved.yaml").read_text().replace('"', ""))

    def test_seven_data_bits(self):
        """The protocols have bytes above 7F. A warning says so, and the flight shows it."""
        text = SCENARIO + "link: {data_bits: 7}\n"
        done = self.run_it("check", text)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("flight.yaml: link.data_bits: 7: every byte loses its top bit, and protocol 'paper' needs it", done.stderr)
        self.assertEqual(self.fly(text)["verdict"], "fail")
        done = self.run_it("check", SCENARIO)
        self.assertEqual(done.stderr, "")

    def test_mistakes(self):
        for link, wanted in (("data_bits: 9", "data_bits: 9 is out of range; must be from 7 to 8"), ("stop_bits: 0", "stop_bits: 0 is out of range; must be from 1 to 2"),
                             ("parity: mark", "parity")):
            done = self.run_it("check", SCENARIO + f"link: {{{link}}}\n")
            self.assertEqual(done.returncode, 2, link)
            self.assertIn("flight.yaml:6:", done.stderr)
            self.assertIn(wanted, done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
