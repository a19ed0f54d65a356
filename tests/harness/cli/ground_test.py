#!/usr/bin/env python3
"""Flights that stand, take off and land: the shipped ones, the same however they are flown, and what is refused.

Usage: ground_test.py TILTPROOF SOURCE_DIR
"""
import csv
import json
import math
import pathlib
import sys
import unittest

from command_line import CommandLineTest

SOURCE = pathlib.Path(sys.argv[2]).resolve()
GROUND = SOURCE / "scenarios/ground"

# The reference is lower than the vehicle stands, so its thrust does not carry the whole weight.
STANDING = """\
name: standing
duration_s: 3
reference: {type: hover, at_m: [0, 0, 0.053]}
initial: {on_ground: true}
ground: {solid: true}
criteria:
  - {name: stands, stl: "always(on_ground > 0.5 and tilt_rad <= 0.001)"}
"""


class GroundTest(CommandLineTest):
    def fly(self, *arguments, out="out"):
        code, text, err = self.tiltproof("run", *arguments, "--no-report", "--no-progress", "--out", out)
        results = json.loads((self.folder / out / "latest/results.json").read_text())
        return code, text + err, {s["name"]: s for s in results["scenarios"]}

    def trace(self, name, out="out"):
        with open(self.folder / out / "latest" / name / "trace.csv", newline="") as file:
            return [{key: float(value) if value else math.nan for key, value in row.items()} for row in csv.DictReader(file)]

    def write(self, text, name="standing.yaml"):
        (self.folder / name).write_text(text)
        return name

    def test_the_shipped_flights_stand_take_off_and_land(self):
        code, text, flights = self.fly(GROUND)
        self.assertEqual(code, 0, text)
        flight = self.trace("ground-take-off-and-land")
        self.assertEqual({row["on_ground"] for row in flight if row["t_s"] <= 1}, {1})
        self.assertEqual({row["on_ground"] for row in flight if 3 <= row["t_s"] <= 17}, {0})
        self.assertEqual({row["on_ground"] for row in flight[-80:]}, {1})
        # Half the box's height below its centre, 0.018 m below the origin.
        for row in (flight[0], flight[-1]):
            self.assertAlmostEqual(row["z_m"], 0.095 + 0.018, delta=1e-5)
        hard = flights["ground-hard-landing-fail"]
        survival = next(c for c in hard["criteria"] if c["name"] == "survival")
        self.assertEqual(survival["verdict"], "fail")
        self.assertRegex(survival["explanation"], r"^ground strike at [0-9.]+ s: 'body' touches the ground at .* with 1\.[0-9]+ m/s, limit 1 m/s$")
        # The speed in the text is that of the last row before, to what a period changes.
        last = self.trace("ground-hard-landing-fail")[-2]
        self.assertAlmostEqual(float(survival["explanation"].split(" with ")[1].split()[0]), -last["vz_m_s"], delta=0.1)

    def test_the_same_however_it_is_flown(self):
        def hashes(*more, out):
            return {name: s["trace_hash"] for name, s in self.fly(GROUND, *more, out=out)[2].items()}
        one = hashes("-j1", out="one")
        self.assertEqual(len(one), 2)
        self.assertEqual(one, hashes("-j2", out="two"))
        self.assertEqual(one, hashes("--distributed=socket", out="socket"))
        resolved = self.folder / "one/latest/ground-take-off-and-land/scenario.resolved.yaml"
        self.assertIn("ground:\n  solid: true\n  touch_down_max_m_s: 1\n", resolved.read_text())
        _, _, again = self.fly(resolved, out="again")
        self.assertEqual(again["ground-take-off-and-land"]["trace_hash"], one["ground-take-off-and-land"])

    def test_standing_and_its_signal(self):
        code, text, _ = self.fly(self.write(STANDING))
        self.assertEqual(code, 0, text)
        self.assertEqual({row["on_ground"] for row in self.trace("standing")}, {1})
        # A condition of a fault reads it; without solid ground there is no column, and it is 0.
        fault = "faults:\n  - {id: gone, type: frame.drop, target: to_client, when: \"on_ground < 1\", parameters: {probability: 1}}\n"
        code, text, flights = self.fly(self.write(STANDING + fault), out="condition")
        self.assertEqual(flights["standing"]["faults"][0]["activations"], 0, text)
        hover = "name: hover\nduration_s: 1\nreference: {type: hover, at_m: [0, 0, 2]}\ncriteria:\n  - {name: flies, stl: \"always(on_ground < 0.5)\"}\n"
        code, text, _ = self.fly(self.write(hover, "hover.yaml"), out="hover")
        self.assertEqual(code, 0, text)
        self.assertNotIn("on_ground", self.trace("hover", "hover")[0])

    def test_a_start_in_the_ground_is_refused_with_the_fix(self):
        low = STANDING.replace("{on_ground: true}", "{position_m: [0, 0, 0.05]}")
        code, _, err = self.tiltproof("check", self.write(low))
        self.assertEqual(code, 2)
        self.assertIn("the vehicle would start 0.063 m deep in the ground: `on_ground: true` starts it on the ground, and from position_m[2] = 0.113 on", err)
        code, _, err = self.tiltproof("check", self.write(STANDING.replace("{on_ground: true}", "{on_ground: true, attitude_rad: [1.3, 0, 0]}")))
        self.assertEqual(code, 2)
        self.assertRegex(err, r"'body' touches the ground at \(.*\) m tilted by 74\.5 deg, limit 60 deg")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
