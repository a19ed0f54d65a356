#!/usr/bin/env python3
"""The command search, on flights in which only one time is bad.

Usage: search_test.py TILTPROOF SOURCE_DIR
"""
import json
import pathlib
import sys
import unittest

from command_line import CommandLineTest

SOURCE = pathlib.Path(sys.argv[2]).resolve()

# Each push alone moves the vehicle by less than a third of what three do together. Only together do they break the
# limit: the second and the third must come when the first does.
GUSTS = """\
name: gusts
duration_s: 10
reference: {type: hover, at_m: [0, 0, 5]}
faults:
  - {id: first, type: plant.force, start_s: 1, end_s: 1.3, parameters: {force_n: 3, direction: [1, 0, 0]}}
  - {id: second, type: plant.force, start_s: 4, end_s: 4.3, parameters: {force_n: 3, direction: [1, 0, 0]}}
  - {id: third, type: plant.force, start_s: 7, end_s: 7.3, parameters: {force_n: 3, direction: [1, 0, 0]}}
criteria:
  - {name: near, stl: "always(abs(x_m) <= LIMIT)"}
"""


class SearchTest(CommandLineTest):
    def search(self, *arguments, code):
        found, out, err = self.tiltproof("search", *arguments, "--format", "jsonl")
        self.assertEqual(found, code, err)
        return [json.loads(line) for line in out.splitlines()], err

    def worst_m(self, file, *over):
        """How far the three pushes move the vehicle together: the limit minus the margin, whose scale is 1 m."""
        lines, _ = self.search(file, "--runs", "1", *over, "--out", "one.yaml", code=0)
        return 9 - lines[-1]["margin"]

    def test_three_gusts_must_coincide(self):
        together = self.scenario("together", GUSTS.replace("start_s: 4, end_s: 4.3", "start_s: 1, end_s: 1.3")
                                 .replace("start_s: 7, end_s: 7.3", "start_s: 1, end_s: 1.3"), LIMIT="9")
        worst_m = self.worst_m(together)
        # Both must begin within some 0.05 s of the first: 0.01 % of all pairs of times, by a grid of flights.
        file = self.scenario("gusts", GUSTS, LIMIT=f"{0.992 * worst_m:.5f}")
        over = ("--over", "faults.second.start_s=0..9", "--over", "faults.third.start_s=0..9")
        (*flights, result), _ = self.search(file, "-j", "2", *over, code=1)
        self.assertLessEqual(result["flights"], 200)
        self.assertTrue(result["failed"] and result["guided"])
        for fault in ("second", "third"):
            self.assertLess(abs(result["values"][f"faults.{fault}.start_s"] - 1), 0.2)
        self.assertEqual(flights[0]["values"]["faults.second.start_s"], 4, "the first flight is the scenario itself")
        # The written scenario fails again, and expects it; -j changes nothing.
        self.assertEqual(self.tiltproof("run", result["file"])[0], 0)
        (*again, _), _ = self.search(file, "--out", "again.yaml", *over, code=1)
        self.assertEqual(again, flights)

    def test_keys(self):
        file = self.scenario("gusts", GUSTS, LIMIT="9")
        lines, _ = self.search(file, "--runs", "30", "--over", "faults.first.parameters.force_n=1..9", "--over",
                               "initial.position_m.0=-2..1", "--over", "link.baud=460800..921600", code=0)
        for line in lines[:-1]:
            values = line["values"]
            self.assertTrue(1 <= values["faults.first.parameters.force_n"] <= 9)
            self.assertTrue(-2 <= values["initial.position_m.0"] <= 1)
            self.assertEqual(values["link.baud"], int(values["link.baud"]))

    def test_a_verdict_without_a_margin_guides_nothing(self):
        file = self.scenario("blind", GUSTS.replace("stl: \"always(abs(x_m) <= LIMIT)\"",
                                                    "metric: firmware.restarts_count, max: 0"))
        lines, err = self.search(file, "--runs", "4", code=0)
        self.assertFalse(lines[-1]["guided"])
        self.assertIn("only pass or fail", err)

    def test_mistakes(self):
        file = self.scenario("gusts", GUSTS, LIMIT="9")
        calm = self.scenario("calm", "name: calm\nduration_s: 1\nreference: {type: hover, at_m: [0, 0, 5]}\n")
        taken = self.scenario("taken", "name: taken\n")
        for arguments, part in (
                ((file, "--over", "faults.frist.start_s=1..2"), "first"),
                ((file, "--over", "faults.first.start=1..2"), "start_s"),
                ((file, "--over", "faults.first.start_s=2..1"), "2 is not less than 1"),
                ((file, "--over", "faults.first.start_s=1"), "A..B"),
                ((file, "--over", "faults.first.parameters.force=1..2"), "force_n"),
                ((file, "--over", "faults.first.parameters.force_n=1..1e9"), "allowed is"),
                ((file, "--over", "link.bauds=1..2"), "baud"),
                ((file, "--over", "nothing"), "KEY=A..B"),
                ((file, "--over", "link.baud=100000..200000", "--over", "link.baud=1000000..2000000"), "given twice"),
                ((file, "--out", str(taken)), "something else is there"),
                ((calm,), "no fault with a severity or a window")):
            code, out, err = self.tiltproof("search", *arguments)
            self.assertEqual(code, 2, err)
            self.assertIn(part, err)
            self.assertEqual(out, "")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
