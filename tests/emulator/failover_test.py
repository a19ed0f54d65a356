#!/usr/bin/env python3
"""Images of the build failover: two emulated boards that talk to each other decide as two libraries of the same build do.

Usage: failover_test.py TILTPROOF

The flights are those of scenarios/redundancy/failover-*-survive.yaml, shortened.
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

TILTPROOF = pathlib.Path(sys.argv.pop(1)).resolve()

PAIR = """\
name: NAME
firmware: failover
seed: 12
duration_s: 3
reference: {type: spiral, time_s: 60}
clients: [{id: a}, {id: b}]
lines: [{id: cross, between: [a, b]}]
arbiter: {type: active_claims, timeout_ms: 36}
FAULTS
criteria:
  - {name: stays-on-path, stl: "always(position_error_m <= 1.0)"}
  - {name: always-flown, metric: redundancy.without_control_s, max: 0.2}
  - {name: no-bump, metric: redundancy.largest_bump, max: 0.05}
"""
DEATH = "type: device.reset, parameters: {boot_ms: 60000}"


class Failover(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def fly(self, name, faults, client, *flags):
        """Metrics of a flight that passes, and its rows."""
        text = PAIR.replace("NAME", name).replace("FAULTS", "faults:\n" + "".join(f"  - {{{fault}}}\n" for fault in faults))
        (self.folder / f"{name}.yaml").write_text(text)
        done = subprocess.run([TILTPROOF, "run", self.folder / f"{name}.yaml", "--out", self.folder / "out", "--no-progress", "--client", client, *flags],
                              capture_output=True, text=True, timeout=500)
        self.assertEqual(done.returncode, 0, f"{client}: {done.stdout}{done.stderr}")
        latest = self.folder / "out/latest" / name
        with open(latest / "trace.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        verdict = json.loads((latest / "verdict.json").read_text())
        return verdict, rows

    def story(self, rows, *columns):
        """The values of these columns, each run of equal ones once, without the first moment."""
        values = [tuple(int(float(row[column])) for column in columns) for row in rows if float(row["t_s"]) > 0.2]
        return [value for i, value in enumerate(values) if i == 0 or value != values[i - 1]]

    def check(self, name, faults, columns=("arbiter_selected",)):
        here, rows = self.fly(name, faults, "host")
        there, board_rows = self.fly(name, faults, "qemu")
        self.assertEqual(self.story(board_rows, *columns), self.story(rows, *columns))
        self.assertEqual(there["metrics"]["redundancy.switches_count"], here["metrics"]["redundancy.switches_count"])
        return there, board_rows

    def test_a_standby_flies_on_after_a_death_and_each_way_to_fly_is_the_same(self):
        faults = [f"id: death-a, client: a, start_s: 1, {DEATH}"]
        verdict, rows = self.check("death", faults)
        self.assertEqual(self.story(rows, "arbiter_selected"), [(0,), (1,)])
        self.assertEqual(verdict["metrics"]["redundancy.split_brain_s"], 0)
        again, _ = self.fly("death", faults, "qemu", "--distributed=socket")
        self.assertEqual(again["trace_hash"], verdict["trace_hash"])

    def test_a_board_that_was_reset_is_the_standby_of_the_other_one(self):
        _, rows = self.check("reset", ["id: reset-a, client: a, type: device.reset, start_s: 0.6, parameters: {boot_ms: 300}",
                                       f"id: death-b, client: b, start_s: 2, {DEATH}"])
        self.assertEqual(self.story(rows, "arbiter_selected"), [(0,), (1,), (0,)])

    def test_two_claims_on_a_line_that_is_lost_and_one_when_it_is_back(self):
        _, rows = self.check("lost", ["id: cut, type: link.silence, target: cross, start_s: 0.6, end_s: 1.4"],
                             ("arbiter_selected", "role_a", "role_b"))
        self.assertEqual(self.story(rows, "arbiter_selected", "role_a", "role_b"), [(0, 1, 0), (0, 1, 1), (0, 1, 0)])


if __name__ == "__main__":
    unittest.main(verbosity=2)
