#!/usr/bin/env python3
"""Faults that come by periods, conditions and each other, in flights: held against the trace, and the same however they are flown.

Usage: triggers_test.py TILTPROOF SOURCE_DIR
"""
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = (pathlib.Path(a).resolve() for a in sys.argv[1:3])

FLIGHT = """\
name: {name}
seed: 3
duration_s: 6
reference: {{type: spiral}}
faults:
  - {{id: bits, type: wire.bit_error, target: both, start_s: 1, parameters: {{ber: 0.0002}}}}
{faults}
criteria:
  - {{name: any, stl: "true"}}
"""

BIAS = "type: sensor.bias, parameters: {signal: x_m, offset: 0.01}"
DROP = "type: frame.drop, target: to_client, parameters: {probability: 0.1}"
LOSS = "type: actuator.loss_of_effectiveness, parameters: {actuator: f_l, factor: 0.998}"

WAITING = f"""\
  - {{id: level-sensor, {BIAS}, when: "speed_m_s > 0.8 or not (z_m < 1.2)"}}
  - {{id: level-wire, {DROP}, start_s: 2, end_s: 5, when: "tilt_rad > 0.075"}}
  - {{id: level-error, {LOSS}, when: "position_error_m > 0.05 and cross_track_error_m > 0.02"}}
  - {{id: rising, {BIAS}, start_s: 1, end_s: 5, when: "z_m > 0.8", edge: rising}}
  - {{id: already-true, {BIAS}, start_s: 5, when: "z_m > 0", edge: rising}}
  - {{id: never, {DROP}, when: "z_m > 100"}}
  - {{id: blind, {BIAS}, when: "sensed_x_m < 1e9"}}
  - {{id: follows-wire, {LOSS}, after: {{fault: bits, delay_s: 0.25}}}}
  - {{id: follows-follower, {DROP}, after: {{fault: follows-wire, delay_s: 0.5}}, period_s: 0.6, duty: 0.5}}
  - {{id: sensor-follows-actuator, {BIAS}, after: {{fault: pulses, delay_s: 0.2}}}}
  - {{id: follows-never, {BIAS}, after: {{fault: never}}}}
  - {{id: pulses, {LOSS}, start_s: 1.1, end_s: 5.3, period_s: 0.7, duty: 0.4}}
"""


class Flown:
    def __init__(self, folder, name):
        with open(folder / name / "trace.csv", newline="") as file:
            self.rows = [{key: float(value) if value else math.nan for key, value in row.items()} for row in csv.DictReader(file)]
        self.faults = [json.loads(line) for line in (folder / name / "faults.jsonl").read_text().splitlines()]
        self.result = next(s for s in json.loads((folder / "results.json").read_text())["scenarios"] if s["name"] == name)

    def active(self, fault):
        return [bool(row[f"active_{fault}"]) for row in self.rows]

    def times(self):
        return [row["t_s"] for row in self.rows]

    def activations(self, fault):
        return next(f["activations"] for f in self.result["faults"] if f["id"] == fault)

    def first(self, fault):
        return min(f["t_s"] if "t_s" in f else f["time_s"] for f in self.faults if (f.get("fault") or f.get("id")) == fault)


def speed(row):
    return math.sqrt(row["vx_m_s"] ** 2 + row["vy_m_s"] ** 2 + row["vz_m_s"] ** 2)


def tilt(row):
    return math.acos(max(-1, min(1, math.cos(row["roll_rad"]) * math.cos(row["pitch_rad"]))))


class Triggers(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="tiltproof-triggers-")
        cls.root = pathlib.Path(cls.folder.name)
        cls.fly_faults("waiting", WAITING)
        cls.waiting = Flown(cls.root / "waiting/latest", "waiting")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def fly_faults(cls, name, faults, *options, out=None):
        (cls.root / f"{name}.yaml").write_text(FLIGHT.format(name=name, faults=faults))
        return cls.fly(cls.root / f"{name}.yaml", *options, out=out or name)

    @classmethod
    def fly(cls, path, *options, out):
        done = subprocess.run([PROGRAM, "run", path, "--no-progress", "--out", cls.root / out, *options], capture_output=True, text=True, timeout=300, check=False)
        if done.returncode not in (0, 4):
            raise AssertionError(done.stdout + done.stderr)
        return cls.root / out / "latest"

    def hashes(self, path, *options, out):
        results = json.loads((self.fly(path, *options, out=out) / "results.json").read_text())
        return {s["name"]: (s["verdict"], s["trace_hash"]) for s in results["scenarios"]}

    def test_a_level_follows_its_condition_in_every_row(self):
        flown = self.waiting
        for row, active in zip(flown.rows, flown.active("level-sensor")):
            self.assertEqual(active, speed(row) > 0.8 or not row["z_m"] < 1.2, row["t_s"])
        inside = 0
        for row, active in zip(flown.rows, flown.active("level-wire")):
            self.assertEqual(active, 2 <= row["t_s"] < 5 and tilt(row) > 0.075, row["t_s"])
            inside += active
        self.assertGreater(inside, 10)
        self.assertLess(inside, 240)

    def test_a_rising_edge_opens_until_the_end_of_the_window(self):
        flown = self.waiting
        rows = flown.rows
        turns = [row["t_s"] for before, row in zip(rows, rows[1:]) if row["z_m"] > 0.8 and not before["z_m"] > 0.8 and row["t_s"] >= 1]
        for t, active in zip(flown.times(), flown.active("rising")):
            self.assertEqual(active, bool(turns) and turns[0] <= t < 5, t)
        self.assertTrue(turns)
        self.assertFalse(any(flown.active("already-true")))

    def test_never_true_is_never_active(self):
        flown = self.waiting
        self.assertFalse(any(flown.active("never")))
        self.assertEqual(flown.activations("never"), 0)
        self.assertFalse(any(flown.active("follows-never")))
        self.assertEqual(flown.result["verdict"], "inconclusive")

    def test_nan_compares_false(self):
        """Nothing was sent before the first request, which comes after the first row was looked at."""
        active = self.waiting.active("blind")
        self.assertFalse(active[0])
        self.assertTrue(all(active[2:]))

    def test_what_follows_begins_a_delay_after_the_first_activation(self):
        flown = self.waiting
        begins = flown.first("bits") + 0.25
        for t, active in zip(flown.times(), flown.active("follows-wire")):
            self.assertEqual(active, t >= begins, t)
        opened = flown.first("follows-wire") + 0.5
        self.assertGreater(opened, begins + 0.5 - 1e-9)
        for t, active in zip(flown.times(), flown.active("follows-follower")):
            self.assertEqual(active, t >= opened and math.fmod(t - opened, 0.6) < 0.3, t)
        self.assertGreater(flown.activations("follows-follower"), 3)

    def test_periods_are_counted_from_the_start(self):
        flown = self.waiting
        for t, active in zip(flown.times(), flown.active("pulses")):
            phase = round((t - 1.1) * 1000) % 700
            self.assertEqual(active, 1.1 <= t < 5.3 and phase < 280, t)

    def test_a_compound_gives_faults_of_every_kind_its_window(self):
        compound = f"""\
  - id: storm
    start_s: 2
    end_s: 4
    compound:
      - {{id: sensor, {BIAS}}}
      - {{id: actuator, {LOSS}, end_s: 3}}
      - {{id: sensor-pulses, {BIAS}, period_s: 0.5, duty: 0.4}}
      - {{id: actuator-when, {LOSS}, when: "z_m > 0"}}
      - {{id: sensor-follows, {BIAS}, after: {{fault: actuator, delay_s: 0.5}}}}
      - {{id: push-pulses, type: plant.force, period_s: 0.25, duty: 0.4, parameters: {{force_n: 0.1, direction: [1, 0, 0]}}}}
      - {{id: push-when, type: plant.force, when: "z_m > 0", parameters: {{force_n: 0.1, direction: [0, 1, 0]}}}}
      - {{id: push-follows, type: plant.mass, after: {{fault: push-when, delay_s: 0.5}}, parameters: {{factor: 1.001}}}}
      - {{id: frame-pulses, type: frame.duplicate, target: reference, period_s: 0.25, duty: 0.4, parameters: {{probability: 1}}}}
      - {{id: wire-when, type: wire.bit_error, target: reference, when: "z_m > 0", parameters: {{ber: 0.001}}}}
      - {{id: link-follows, type: link.silence, target: reference, after: {{fault: wire-when, delay_s: 1.5}}}}
      - {{id: nothing-pulses, type: harness.null, period_s: 0.25, duty: 0.4}}
"""
        flown = Flown(self.fly_faults("compound", compound), "compound")
        expected = {
            "sensor": lambda t: 2 <= t < 4,
            "actuator": lambda t: 2 <= t < 3,
            "sensor-pulses": lambda t: 2 <= t < 4 and round((t - 2) * 1000) % 500 < 200,
            "actuator-when": lambda t: 2 <= t < 4,
            "sensor-follows": lambda t: flown.first("actuator") + 0.5 <= t < 4,
            "push-pulses": lambda t: 2 <= t < 4 and round((t - 2) * 1000) % 250 < 100,
            "push-when": lambda t: 2 <= t < 4,
            "push-follows": lambda t: flown.first("push-when") + 0.5 <= t < 4,
            "frame-pulses": lambda t: 2 <= t < 4 and round((t - 2) * 1000) % 250 < 100,
            "wire-when": lambda t: 2 <= t < 4,
            "link-follows": lambda t: flown.first("wire-when") + 1.5 <= t < 4,
            "nothing-pulses": lambda t: 2 <= t < 4 and round((t - 2) * 1000) % 250 < 100,
        }
        # A disturbance of the vehicle counts once, when it begins.
        begins = {"push-pulses": 8, "push-when": 1, "push-follows": 1}
        for fault, is_active in expected.items():
            self.assertEqual(flown.active(fault), [is_active(t) for t in flown.times()], fault)
            if fault in begins:
                self.assertEqual(flown.activations(fault), begins[fault], fault)
            else:
                self.assertGreater(flown.activations(fault), 10, fault)

    def test_one_that_never_acts_changes_nothing(self):
        without = Flown(self.fly_faults("without", ""), "without")
        with_it = Flown(self.fly_faults("with", f'  - {{id: never, {DROP}, when: "z_m > 100"}}\n  - {{id: also, {BIAS}, after: {{fault: never}}}}'), "with")
        columns = [c for c in without.rows[0] if not c.startswith(("active_", "faults_active"))]
        # NaN is the same text in both.
        self.assertEqual([[str(row[c]) for c in columns] for row in without.rows], [[str(row[c]) for c in columns] for row in with_it.rows])
        self.assertGreater(without.activations("bits"), 0)

    def test_the_same_however_it_is_flown(self):
        (self.root / "all").mkdir()
        (self.root / "all/waiting.yaml").write_text(FLIGHT.format(name="waiting", faults=WAITING))
        for file in (SOURCE / "scenarios/triggers").glob("*.yaml"):
            (self.root / "all" / file.name).write_text(file.read_text())
        one = self.hashes(self.root / "all", "-j1", out="j1")
        self.assertEqual(len(one), 4)
        self.assertEqual(one, self.hashes(self.root / "all", "-j2", out="j2"))
        self.assertEqual(one, self.hashes(self.root / "all", "--distributed=socket", out="socket"))

    def test_what_was_resolved_flies_the_same(self):
        for file in (SOURCE / "scenarios/triggers").glob("*.yaml"):
            first = self.fly(file, out=file.stem)
            name = json.loads((first / "results.json").read_text())["scenarios"][0]["name"]
            again = self.fly(first / name / "scenario.resolved.yaml", out=file.stem + "-again")
            self.assertEqual(Flown(first, name).result["trace_hash"], Flown(again, name).result["trace_hash"])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
