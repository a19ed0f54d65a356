#!/usr/bin/env python3
"""The commands campaign compare and campaign merge, with campaigns that are flown here.

Usage: campaign_results_test.py TILTPROOF SOURCE_DIR
"""
import json
import pathlib
import sqlite3
import subprocess
import sys
import unittest

from command_line import CommandLineTest

SOURCE = pathlib.Path(sys.argv[2]).resolve()
HOVER = """\
name: NAME
duration_s: 1.2
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.1)"}
"""
FILE = """\
campaign: night
scenarios: [hover.yaml]
runs_count: 40
seed: SEED
draw: {types: ["wire.*", "actuator.*", frame.drop]}
"""


class CampaignResultsTest(CommandLineTest):
    def fly(self, out, *options, seed=5, code=(0, 1)):
        self.scenario("hover", HOVER)
        (self.folder / "night.yaml").write_text(FILE.replace("SEED", str(seed)))
        found, text, err = self.tiltproof("campaign", "night.yaml", "-j", "2", "--no-report", "--out", out, *options)
        self.assertIn(found, code, text + err)

    def sql(self, folder, query):
        with sqlite3.connect(self.folder / folder / "campaign.sqlite") as database:
            return database.execute(query).fetchall()

    def test_merged_shards_are_the_whole_campaign(self):
        self.fly("whole")
        for part in (1, 2, 3):
            self.fly(f"part{part}", "--shard", f"{part}/3")
        code, out, err = self.tiltproof("campaign", "merge", "part3", "part1", "part2", "--out", "merged")
        self.assertEqual(code, 0, err)
        self.assertRegex(out, r"campaign night: 40 of 40 runs from 3 folders, \d+ failed in \d+ way")
        self.assertEqual((self.folder / "merged/campaign.json").read_bytes(), (self.folder / "whole/campaign.json").read_bytes())
        flights = {folder: sorted(str(path.relative_to(self.folder / folder)) for path in (self.folder / folder).glob("failures/*/*/verdict.json")) for folder in ("merged", "whole")}
        self.assertEqual(flights["merged"], flights["whole"])
        self.assertTrue(flights["whole"])
        for path in flights["merged"]:
            self.assertEqual(self.tiltproof("replay", self.folder / "merged" / path.removesuffix("/verdict.json"))[0], 0)
        everything = "SELECT number, seed, verdict, trace_hash FROM run ORDER BY number"
        self.assertEqual(self.sql("merged", everything), self.sql("whole", everything))
        self.assertTrue((self.folder / "merged/campaign.html").exists())
        oracle = SOURCE / "tests/harness/campaign/campaign_oracle.py"
        found = subprocess.run([sys.executable, "-B", oracle, self.folder / "merged"], capture_output=True, text=True)
        self.assertEqual(found.returncode, 0, found.stdout + found.stderr)
        # A merged campaign can be read and goes on like any other.
        code, out, _ = self.tiltproof("campaign", "status", "merged")
        self.assertRegex(out, r"campaign night: 40 of 40 runs")
        code, _, err = self.tiltproof("campaign", "merge", "part1", "--out", "merged")
        self.assertEqual((code, "holds a campaign already" in err), (2, True), err)
        # A contradiction is no result.
        with sqlite3.connect(self.folder / "part1/campaign.sqlite") as database:
            database.execute("UPDATE runs SET trace_hash = x'0123456789abcdef' WHERE number = 3")
        code, _, err = self.tiltproof("campaign", "merge", "whole", "part1", "--out", "no")
        self.assertEqual(code, 2)
        self.assertIn("run 3 of part1 contradicts", err)
        self.assertFalse((self.folder / "no/campaign.sqlite").exists())

    def test_two_firmwares_are_compared_by_pairs(self):
        self.fly("a", "--firmware", "paper")
        self.fly("b", "--firmware", "tolerant")
        code, out, err = self.tiltproof("campaign", "compare", "a", "b", "--format", "jsonl")
        found = json.loads(out)
        verdicts = {folder: dict(self.sql(folder, "SELECT number, verdict FROM run")) for folder in "ab"}
        pairs = [(verdicts["a"][n], verdicts["b"][n]) for n in verdicts["a"]]
        for key, pair in (("worse", ("pass", "fail")), ("better", ("fail", "pass"))):
            self.assertEqual(found[key], pairs.count(pair), key)
        self.assertEqual(found["all"]["both"], pairs.count(("pass", "pass")))
        self.assertEqual(code, 1 if found["worse"] else 0)
        # The ways to fail are those of the folders.
        ways = {folder: {row[0] for row in self.sql(folder, "SELECT signature FROM failure")} for folder in "ab"}
        self.assertEqual((found["new_signatures"], found["gone_signatures"]), (sorted(ways["b"] - ways["a"]), sorted(ways["a"] - ways["b"])))
        self.assertNotEqual(ways["a"], {row[0] for row in self.sql("a", "SELECT signature FROM run WHERE verdict = 'fail'")}, "the first ones are others")
        code, out, _ = self.tiltproof("campaign", "compare", "a", "a")
        self.assertEqual(code, 0)
        self.assertIn("40 runs of both, 40 with the same trace; B is better in 0, worse in 0", out)
        self.assertTrue(any(line.startswith("passes of B less those of A") for line in out.splitlines()), out)
        # While one of them has no final ones yet, the first ones of both are compared.
        with sqlite3.connect(self.folder / "b/campaign.sqlite") as database:
            database.execute("DELETE FROM failures")
        found = json.loads(self.tiltproof("campaign", "compare", "a", "b", "--format", "jsonl")[1])
        ways = {folder: {row[0] for row in self.sql(folder, "SELECT signature FROM run WHERE verdict = 'fail'")} for folder in "ab"}
        self.assertEqual((found["new_signatures"], found["gone_signatures"]), (sorted(ways["b"] - ways["a"]), sorted(ways["a"] - ways["b"])))

    def test_errors_name_the_cause(self):
        self.fly("a", "--runs", "3")
        self.fly("b", "--runs", "3", seed=6)
        code, _, err = self.tiltproof("campaign", "compare", "a", "b")
        self.assertEqual(code, 2)
        self.assertRegex(err, r"a and b have different draws, so that they cannot be compared. Run 0:")
        code, _, err = self.tiltproof("campaign", "merge", "a", "b", "--out", "m")
        self.assertEqual(code, 2)
        self.assertRegex(err, r"b is not of the same campaign as the others: .*seed")
        for words in (("compare", "a", "none"), ("merge", "none", "--out", "m")):
            code, _, err = self.tiltproof("campaign", *words)
            self.assertEqual((code, "none: there is no campaign in this folder" in err), (2, True), err)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
