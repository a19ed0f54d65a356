#!/usr/bin/env python3
"""`run --set`: a grid of values without a file for each.

Usage: sweep_test.py TILTPROOF
"""
import csv
import json
import re
import shlex
import sys
import unittest

from command_line import CommandLineTest

BIASED = """\
name: NAME
duration_s: 1.2
seed: 3
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: z.off, type: sensor.bias, start_s: 0.2, parameters: {signal: z_m, offset: 0.1}}
  - {id: loss, type: frame.drop, target: both, parameters: {probability: 0.01}}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.05)"}
"""


class SweepTest(CommandLineTest):
    def sweep(self, *arguments, code=1):
        self.scenario("biased", BIASED)
        found, out, err = self.tiltproof("run", "biased.yaml", "--no-report", *arguments)
        self.assertEqual(found, code, out + err)
        return out, err

    def csv(self):
        with open(self.latest() / "results.csv", newline="") as file:
            return list(csv.DictReader(file))

    def test_a_grid_flies_what_files_would(self):
        out, _ = self.sweep("--set", "faults.z.off.parameters.offset=0.001,0.5", "--set", "faults.loss.parameters.probability=0,0.02")
        rows = self.csv()
        offset, probability = "faults.z.off.parameters.offset", "faults.loss.parameters.probability"
        self.assertEqual([(row[offset], row[probability]) for row in rows], [("0.001", "0"), ("0.001", "0.02"), ("0.5", "0"), ("0.5", "0.02")])
        self.assertEqual([row["verdict"] for row in rows][2:], ["fail", "fail"])
        hashes = {flight["name"]: flight["trace_hash"] for flight in self.results()["scenarios"]}
        for row in rows:
            text = BIASED.replace("offset: 0.1", f"offset: {row[offset]}").replace("probability: 0.01", f"probability: {row[probability]}")
            self.scenario("file", text)
            self.tiltproof("run", "file.yaml", "--no-report", "--out", "files")
            flown = json.loads((self.folder / "files/latest/results.json").read_text())["scenarios"][0]
            self.assertEqual(hashes[row["scenario"]], flown["trace_hash"], row["scenario"])
            self.assertAlmostEqual(float(row["tracking.rmse_m"]), flown["metrics"]["tracking.rmse_m"], places=12)
        table = out[out.index("\noffset"):].splitlines()[1:6]
        self.assertEqual(table[0].split(), ["offset", "probability", "passed", "margin", "rmse_m", "fails"])
        self.assertEqual(table[3].split()[:5], ["0.5", "0", "0", "of", "1"])
        self.assertEqual(table[3].split()[-1], "near")

    def test_replay_and_the_commands_that_are_printed(self):
        out, _ = self.sweep("--set", "initial.position_m.2=1.9,2.2")
        self.assertEqual([row["initial.position_m.2"] for row in self.csv()], ["1.9", "2.2"])
        resolved = (self.latest() / "biased-2-2.2/scenario.resolved.yaml").read_text()
        self.assertRegex(resolved, r"position_m: \[0, 0, 2\.2\]")
        self.assertEqual(self.tiltproof("replay", self.latest())[0], 0)
        before = {flight["name"]: flight["trace_hash"] for flight in self.results()["scenarios"]}
        out, _ = self.sweep("--set", "initial.position_m.2=1.9,2.2", "--keep", "verdicts")
        command = re.search(r"tiltproof (run .*--set '?initial\.position_m\.2=2\.2.*)", out)[1]
        self.assertEqual(self.tiltproof(*shlex.split(command), "--no-report")[0], 1)
        [flight] = self.results()["scenarios"]
        self.assertEqual(flight["trace_hash"], before[flight["name"]])

    def test_repeats_and_jobs(self):
        tables = []
        for jobs in ("1", "3"):
            out, _ = self.sweep("--set", "faults.loss.parameters.probability=0,0.3", "--repeat", "3", "-j", jobs)
            tables.append((self.csv(), [line for line in out.splitlines() if re.match(r"0(\.3)? +\d of 3", line)]))
        self.assertEqual(*tables)
        self.assertEqual([row["seed"] for row in tables[0][0]], ["3", "4", "5"] * 2)
        self.assertEqual(len(tables[0][1]), 2)

    def test_other_values_than_numbers(self):
        out, _ = self.sweep("--set", "faults.loss.target=to_client,reference", "--set", "initial.position_m=[0, 0, 2],[0.3, 0, 2]", "--set", "link.baud=115200,921600", "--dry-run", code=0)
        self.assertEqual(len(out.splitlines()), 8)
        self.assertEqual(len(set(out.splitlines())), 8)

    def test_the_last_failed(self):
        self.sweep("--set", "faults.z.off.parameters.offset=0.001,0.5")
        failed = [row["scenario"] for row in self.csv() if row["verdict"] == "fail"]
        self.sweep("--set", "faults.z.off.parameters.offset=0.001,0.5", "--last-failed")
        self.assertEqual([row["scenario"] for row in self.csv()], failed)

    def test_several_scenarios_share_a_grid(self):
        self.scenario("other", BIASED)
        out, _ = self.sweep("other.yaml", "--set", "duration_s=0.6,1.2")
        self.assertRegex(out, r"\nscenario +duration_s +passed")
        self.assertEqual(len(self.csv()), 4)

    def test_mistakes(self):
        for setting, message in (("faults.loss.parameters.probabilty=1", "--set faults.loss.parameters.probabilty=1: unknown key 'probabilty'; did you mean 'probability'?"),
                                 ("faults.los.parameters.probability=1", "faults has no 'los'; did you mean 'loss'?"),
                                 ("lnk.baud=9600", "unknown key 'lnk'; did you mean 'link'?"),
                                 ("initial.position_m.3=1", "initial.position_m has no item '3': it is a list of 3, from 0"),
                                 ("duration_s.x=1", "'duration_s' is one value: it has no keys"),
                                 ("faults.loss.parameters.probability=2", "probability: 2 is out of range; must be from 0 to 1"),
                                 ("duration_s=abc", "duration_s: expected a number"),
                                 ("duration_s", "expected PATH=VALUE,..."), ("duration_s=1,,2", "a value is empty"), ("duration_s=[1", "no value"),
                                 ("a..b=1", "a part of the path is empty"), ("name=a,b", "a name of its own"),
                                 ("faults.z.off.end_s=0.1", "end_s")):
            _, err = self.sweep("--set", setting, code=2)
            self.assertIn(message, err)
            self.assertIn("--set", err)
            self.assertNotIn(":-", err)
        _, err = self.sweep("--set", "seed=1", "--set", "seed=2", code=2)
        self.assertIn("given twice", err)
        _, err = self.sweep("--set", "firmware=paper,tolerant", "--firmware", "paper", code=2)
        self.assertIn("--firmware paper sets the build of every flight", err)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
