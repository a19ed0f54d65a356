#!/usr/bin/env python3
"""The command why, against flights whose fault ends earlier.

Usage: why_test.py TILTPROOF SOURCE_DIR
"""
import json
import pathlib
import sys
import unittest

from command_line import PROGRAM, CommandLineTest

SOURCE = pathlib.Path(sys.argv[2]).resolve()

LATE = """\
name: NAME
duration_s: 16
reference: {type: spiral}
faults:
  - {id: late, type: frame.delay, target: to_client, start_s: 10, end_s: END, parameters: {mean_ms: DELAY}}
criteria:
  - {name: stays-on-path, stl: "always[8,16](position_error_m <= 0.5)"}
"""

# Sensors with noise, on the vehicle with the sensors of its source.
NOISY = """\
name: noisy
model: quadrotor
firmware: lqr
duration_s: 14
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: bias, type: sensor.bias, start_s: 5, parameters: {signal: roll_rad, offset: 0.3}}
criteria:
  - {name: near, stl: "always[4,14](position_error_m <= 0.5)"}
"""


def late(name, end_s=14, delay_ms=12):
    return LATE.replace("NAME", name).replace("END", str(end_s)).replace("DELAY", str(delay_ms))


class WhyTest(CommandLineTest):
    def fly(self, out, *texts):
        """The folder of the run's first flight."""
        paths = []
        for i, text in enumerate(texts):
            paths.append(self.folder / f"{out}-{i}.yaml")
            paths[-1].write_text(text)
        self.tiltproof("run", *paths, "--out", self.folder / out)
        name = texts[0].splitlines()[0].removeprefix("name: ")
        return self.folder / out / "latest" / name

    def why(self, flight, *arguments):
        code, out, err = self.tiltproof("why", flight, *arguments)
        self.assertEqual(code, 0, err)
        return json.loads((flight / "why.json").read_text()), out

    def verdict(self, end_s):
        flight = self.fly(f"end-{end_s}", late("shorter", end_s))
        return json.loads((flight / "verdict.json").read_text())["verdict"]

    def test_the_flight_passes_when_its_fault_ends_at_the_last_chance(self):
        flight = self.fly("late", late("late"))
        why, out = self.why(flight)
        self.assertEqual(self.verdict(why["last_chance_s"]), "pass")
        self.assertEqual(self.verdict(why["point_of_no_return_s"]), "fail")
        self.assertEqual(why["needed"], ["late"])
        self.assertEqual(why["sets"], [])
        self.assertEqual(why["criterion"], "stays-on-path")
        self.assertIn(f"point of no return: {why['point_of_no_return_s']:.3f} s", out)
        self.assertLessEqual(len(why["curve"]), 40)
        for point in why["curve"]:
            self.assertEqual(point["futures_count"], 1)
            self.assertEqual(point["low"], point["high"])
        # With two jobs it is the same.
        self.assertEqual(self.why(flight, "-j", "2")[0]["curve"], why["curve"])

    def test_randomness_is_drawn_again(self):
        flight = self.fly("noisy", NOISY)
        why, _ = self.why(flight, "--futures", "8")
        self.assertEqual({point["futures_count"] for point in why["curve"]}, {8})
        self.assertIn("bias", why["needed"])
        self.assertEqual(self.why(flight, "--futures", "8", "-j", "2")[0]["curve"], why["curve"])

    def refused(self, flight, message, code=2):
        found, _, err = self.tiltproof("why", flight)
        self.assertEqual(found, code, err)
        self.assertIn(message, err)
        self.assertFalse((flight / "why.json").exists())

    def test_what_it_cannot_explain(self):
        flight = self.fly("mild", late("mild", delay_ms=1))
        self.refused(flight, "the verdict is pass")
        self.refused(self.fly("two", late("one"), late("other")).parent, "a run with 2 flights")
        healthy = late("healthy").replace("0.5)", "0.0001)").replace("[8,16]", "[0,9]")
        self.refused(self.fly("healthy", healthy), "no fault acted before")

    def test_a_flight_in_real_time(self):
        flight = self.fly("real", late("real"))
        info = flight.parent / "run.json"
        info.write_text(info.read_text().replace('"lockstep"', '"realtime"'))
        self.refused(flight, "real time")

    def test_a_flight_that_is_not_the_same_any_more(self):
        flight = self.fly("changed", late("changed"))
        scenario = flight / "scenario.resolved.yaml"
        text = scenario.read_text()
        scenario.write_text(text.replace("mean_ms: 12", "mean_ms: 25"))
        self.assertNotEqual(scenario.read_text(), text)
        self.refused(flight, "the flight is not the same any more", code=3)

    def test_criteria_that_are_not_those_of_the_verdict_any_more(self):
        flight = self.fly("edited", late("edited"))
        scenario = flight / "scenario.resolved.yaml"
        text = scenario.read_text()
        self.assertEqual(text.count("<= 0.5"), 1)
        for limit, now in (("<= 50", "today 'survival' (at "), ("<= 0.6", "today 'stays-on-path' (at ")):
            scenario.write_text(text.replace("<= 0.5", limit))
            self.refused(flight, "the criteria in", code=3)
            self.assertIn(now, self.tiltproof("why", flight)[2])
        scenario.write_text(text)
        self.why(flight)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
