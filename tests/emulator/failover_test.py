#!/usr/bin/env python3
"""Images of the builds failover and triplex: emulated boards that talk to each other decide as libraries of the same build do.

Usage: failover_test.py TILTPROOF [Failover | FlyingAgain]

The flights are those of scenarios/redundancy/{failover,triplex}-*-survive.yaml, shortened.
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
duration_s: DURATION
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
TRIO = PAIR.replace("firmware: failover", "firmware: triplex").replace("{id: b}]", "{id: b}, {id: c}]").replace(
    "[{id: cross, between: [a, b]}]", "[{id: ab, between: [a, b]}, {id: ac, between: [a, c]}, {id: bc, between: [b, c]}]").replace("active_claims", "mid_value")
DEATH = "type: device.reset, parameters: {boot_ms: 60000}"


class Boards(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def fly(self, name, faults, client, *flags, text=PAIR, duration_s=3):
        """Metrics of a flight that passes, and its rows."""
        text = text.replace("NAME", name).replace("DURATION", str(duration_s)).replace("FAULTS", "faults:\n" + "".join(f"  - {{{fault}}}\n" for fault in faults))
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

    def check(self, name, faults, columns=("arbiter_selected",), **flight):
        here, rows = self.fly(name, faults, "host", **flight)
        there, board_rows = self.fly(name, faults, "qemu", **flight)
        self.assertEqual(self.story(board_rows, *columns), self.story(rows, *columns))
        self.assertEqual(there["metrics"]["redundancy.switches_count"], here["metrics"]["redundancy.switches_count"])
        return there, board_rows


class Failover(Boards):
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


class FlyingAgain(Boards):
    def test_a_board_that_was_reset_flies_again_though_its_first_commands_did_not_act(self):
        # Its first command is that of a vehicle at rest: it boots while the reference arrives, and the next one comes after the first reply.
        faults = ["id: reset-a, client: a, type: device.reset, start_s: 4, parameters: {boot_ms: 500}", f"id: death-b, client: b, start_s: 7.5, {DEATH}"]
        verdict, rows = self.fly("again", faults, "qemu", duration_s=9.5)
        self.assertEqual(self.story(rows, "arbiter_selected"), [(0,), (1,), (0,)])
        self.assertLessEqual(verdict["metrics"]["redundancy.split_brain_s"], 0.05)
        first = next(row for row in rows if float(row["t_s"]) > 4.51)
        self.assertGreater(abs(float(first["commanded_a_tau_r_nm"]) - float(first["commanded_b_tau_r_nm"])), 0.05)

    def test_the_last_of_three_boards_flies_on_with_the_integrals_of_the_others(self):
        verdict, rows = self.check("trio", [f"id: death-a, client: a, start_s: 1, {DEATH}", f"id: death-b, client: b, start_s: 1.4, {DEATH}",
                                            "id: reset-c, client: c, type: device.reset, start_s: 0.4, parameters: {boot_ms: 200}"], text=TRIO, duration_s=2)
        self.assertEqual(self.story(rows, "arbiter_selected"), [(-2,), (2,)])
        self.assertEqual(verdict["metrics"]["redundancy.without_control_s"], 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
