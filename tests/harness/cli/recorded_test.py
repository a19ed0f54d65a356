#!/usr/bin/env python3
"""Recorded references, from other loggers and from tiltproof itself. Usage: recorded_test.py TILTPROOF"""
import csv
import sys
import unittest

from command_line import SHORT_HOVER, CommandLineTest

RECORDED = SHORT_HOVER.replace("{type: hover, at_m: [0, 0, 2]}", "{type: recorded, file: path.csv}")


class RecordedTest(CommandLineTest):
    def columns(self, flight):
        with open(flight / "trace.csv", newline="") as file:
            return list(csv.DictReader(file))

    def fly(self, name):
        code, out, err = self.tiltproof("run", f"{name}.yaml", "--no-progress")
        self.assertEqual(code, 0, out + err)
        return self.columns(self.latest() / name)

    def test_a_trace_is_a_reference(self):
        """The path that one flight flew is what the next one is asked to fly, to the last digit."""
        self.scenario("flown", SHORT_HOVER.replace("hover, at_m: [0, 0, 2]", "circle, radius_m: 1, period_s: 20").replace("0.6", "1.8"))
        flown = self.fly("flown")
        self.assertGreater(len(flown[0]), 40)
        (self.folder / "path.csv").write_bytes((self.latest() / "flown/trace.csv").read_bytes())
        self.scenario("again", RECORDED)
        again = self.fly("again")
        self.assertEqual(len(again), 51)
        for before, row in zip(flown, again):
            for name in ("x_m", "y_m", "z_m", "yaw_rad"):
                self.assertAlmostEqual(float(row[name.replace("_", "_ref_")]), float(before[name]), delta=1e-12)

    def test_columns_in_any_order_beside_others(self):
        (self.folder / "path.csv").write_text("roll_rad,z_m,yaw_rad,x_m,y_m,t_s\n0,2,0,0,0,0\n0.1,2,0,1,0,4\n")
        self.scenario("reordered", RECORDED)
        self.assertAlmostEqual(float(self.fly("reordered")[-1]["x_ref_m"]), 0.15, delta=1e-3)

    def test_one_in_the_time_of_day_is_refused_with_what_to_subtract(self):
        (self.folder / "path.csv").write_text("t_s,x_m,y_m,z_m,yaw_rad\n1700000000,0,0,2,0\n1700000004,4,0,2,0\n")
        self.scenario("epoch", RECORDED)
        for command in ("check", "run"):
            code, _, err = self.tiltproof(command, "epoch.yaml")
            self.assertEqual(code, 2)
            self.assertIn("begins at t_s = 1700000000, when the flight of 0.6 s is over; subtract 1700000000 from t_s", err)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
