#!/usr/bin/env python3
"""Which build of the firmware flies, and what is expected of it. Usage: firmware_test.py TILTPROOF SOURCE_DIR"""
import json
import shlex
import subprocess
import unittest

from command_line import PROGRAM, CommandLineTest

# The two builds differ there: tolerant knows how late its commands act.
LATE = """\
name: NAME
duration_s: 9
reference: {type: hover, at_m: [0, 0, 2]}
initial: {position_m: [0.1, 0, 2]}
expect: {paper: fail, tolerant: pass}
faults:
  - {id: late, type: frame.delay, target: to_plant, start_s: 1, parameters: {mean_ms: 20}}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


class FirmwareTest(CommandLineTest):
    def flown(self):
        """(verdict, expected) of the first flight of the latest run, and the build that flew."""
        entry = self.results()["scenarios"][0]
        resolved = (self.latest() / entry["name"] / "scenario.resolved.yaml").read_text()
        build = next(line for line in resolved.splitlines() if line.startswith("firmware: "))
        return entry["verdict"], entry["expected"], build.split('"')[1]

    def test_every_scenario_flies_with_the_build_and_its_expectation(self):
        self.scenario("late", LATE)
        for arguments, flown in (([], ("fail", "fail", "paper")), (["--firmware", "paper"], ("fail", "fail", "paper")),
                                 (["--firmware", "tolerant"], ("pass", "pass", "tolerant"))):
            code, out, err = self.tiltproof("run", "late.yaml", *arguments)
            self.assertEqual(code, 0, out + err)
            self.assertEqual(self.flown(), flown)
            code, out, _ = self.tiltproof("replay", "results/latest")
            self.assertEqual((code, out.splitlines()[-1]), (0, "1 of 1 equal"))
            self.assertEqual(self.tiltproof("score", "results/latest")[0], 0)

    def test_a_build_that_is_not_named_is_to_pass(self):
        self.scenario("late", LATE, **{"paper: fail, tolerant: pass": "tolerant: pass"})
        code, out, _ = self.tiltproof("run", "late.yaml")
        self.assertEqual((code, self.flown()), (1, ("fail", "pass", "paper")))
        self.assertIn("expected pass", out)

    def test_the_command_that_flies_again_has_the_build(self):
        self.scenario("late", LATE, **{"tolerant: pass": "tolerant: fail"})
        code, _, _ = self.tiltproof("run", "late.yaml", "--firmware", "tolerant", "--keep", "verdicts")
        self.assertEqual(code, 1)
        again = self.results()["scenarios"][0]["replay"]
        self.assertIn(" --firmware tolerant ", again)
        done = subprocess.run([PROGRAM, *shlex.split(again)[1:]], cwd=self.folder, capture_output=True, timeout=60, check=False)
        self.assertEqual((done.returncode, self.flown()), (1, ("pass", "fail", "tolerant")))

    def test_what_is_listed_is_what_would_fly(self):
        self.scenario("late", LATE)
        for build, expected in (("paper", "fail"), ("tolerant", "pass")):
            line = json.loads(self.tiltproof("run", "late.yaml", "--firmware", build, "--dry-run", "--format", "jsonl")[1])
            self.assertEqual((line["firmware"], line["expected"]), (build, expected))
            self.assertRegex(self.tiltproof("list", "late.yaml", "--firmware", build)[1], rf" {build} +expect {expected} ")

    def test_margins_are_those_of_the_build(self):
        self.scenario("late", LATE)
        survives = []
        for build in ("paper", "tolerant"):
            code, out, err = self.tiltproof("margin", "late.yaml", "--fault", "late", "--high", "30", "--tolerance", "0.3", "--repeats", "1",
                                            "--format", "jsonl", "--firmware", build)
            self.assertEqual(code, 0, err)
            survives.append(json.loads(out.splitlines()[-1])["survives"])
        self.assertGreaterEqual(survives[1], 20)
        self.assertLess(survives[0], 20)

    def test_an_unknown_build_is_a_mistake(self):
        self.scenario("late", LATE)
        for command in (["run"], ["run", "--dry-run"], ["check"], ["list"], ["margin", "--fault", "late"]):
            code, out, err = self.tiltproof(*command, "late.yaml", "--firmware", "tolerent")
            self.assertEqual((code, out, err), (2, "", "--firmware tolerent: no such build; did you mean 'tolerant'?\n"))
        self.assertEqual(self.tiltproof("run", "late.yaml", "--firmware", "")[0], 2)

    def test_every_client_flies_the_build(self):
        self.scenario("two", LATE, **{"faults:": "clients: [{id: a, firmware: tolerant}, {id: b}]\nfaults:", "duration_s: 9": "duration_s: 3",
                                      "paper: fail": "paper: inconclusive"})
        code, out, _ = self.tiltproof("run", "two.yaml", "--firmware", "tolerant")
        self.assertEqual((code, self.flown()[1:]), (0, ("pass", "tolerant")), out)
        resolved = (self.latest() / "two/scenario.resolved.yaml").read_text()
        self.assertEqual(resolved.count("firmware: "), 1)


if __name__ == "__main__":
    unittest.main(argv=["firmware_test.py"])
