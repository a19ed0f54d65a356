#!/usr/bin/env python3
"""What a person sees at a terminal, and the gates of a continuous integration: progress, lines of 80 columns, --repeat,
--last-failed, compare --baseline.

Usage: terminal_test.py TILTPROOF
"""
import json
import re
import shlex
import sys
import unittest

from command_line import CommandLineTest

NOISE = "faults:\n  - {id: noise, type: sensor.noise, start_s: 0.1, parameters: {signal: z_m, std: 0.05}}\ncriteria"


class TerminalTest(CommandLineTest):
    def assert_fits(self, lines):
        """No line is too long, but for one that is a single word, which stays whole to be copied."""
        for line in lines:
            self.assertTrue(len(line) <= 80 or " " not in line.strip().removesuffix(" \\"), line)

    # progress

    def test_the_progress_line(self):
        for name in ("a", "b", "c"):
            self.scenario(name, duration_s="duration_s: 60 #")
        self.scenario("d", **{"duration_s": "duration_s: 60 #", "position_error_m <= 0.5": "position_error_m < 0"})
        code, text = self.at_a_terminal("run", ".", "--no-report", streams=("stderr",))
        self.assertEqual(code, 1)
        shown = [part for part in text.split("\r\033[K") if part]
        found = [re.fullmatch(r"(\d) of 4 flights, (\d) not green(?:, (\d+ s|\d+ min \d+ s) left)?(?:  \w+ \d+/60 s)?", part) for part in shown]
        self.assertTrue(found and all(found), shown)
        counts = [(int(match[1]), int(match[2])) for match in found]
        self.assertEqual(counts, sorted(counts))
        self.assertGreater(len({done for done, _ in counts}), 1, counts)
        self.assertTrue(all(bad == (done == 4) for done, bad in counts), counts)
        self.assertLess(max(map(len, shown)), 80)
        self.assertTrue(text.endswith("\r\033[K"), "nothing of it stays")

    def test_there_is_no_progress_line_in_a_log(self):
        self.scenario("a", duration_s="duration_s: 20 #")
        self.assertEqual(self.tiltproof("run", ".")[2], "")
        self.assertEqual(self.at_a_terminal("run", ".", "--no-progress", streams=("stderr",))[1], "")

    # lines

    def test_no_line_of_a_run_is_too_long(self):
        self.scenario("bad", criteria=NOISE, **{"position_error_m <= 0.5": "position_error_m < 0"})
        with open(self.folder / "bad.yaml", "a") as file:
            file.write('  - {name: a-name-that-says-very-much-about-what-it-protects, stl: "always(tilt_rad < 0 and position_error_m < 0.001 and speed_m_s < 0.0001)"}\n')
        self.scenario("board", criteria="faults:\n  - {id: still, type: device.stall, start_s: 0.1, end_s: 0.2}\ncriteria")
        code, lines = self.lines_at_a_terminal("run", ".", "--repeat", "2")
        self.assertEqual(code, 1)
        self.assert_fits(lines)
        self.assertIn("not applicable: needs an emulated board: fly it with --client qemu", lines)
        self.assertIn("      board", lines)
        # The same words as elsewhere, and a command that a shell runs as it stands.
        again = [i for i, line in enumerate(lines) if line.endswith("; again:")]
        self.assertEqual(len(again), 2)
        command = []
        for line in lines[again[0] + 1:]:
            command.append(line.removesuffix("\\"))
            if not line.endswith("\\"):
                break
        code, out, err = self.tiltproof(*shlex.split(" ".join(command))[1:])
        self.assertEqual((code, out.splitlines()[-1], err), (0, "1 of 1 equal", ""))
        _, lines = self.lines_at_a_terminal("compare", self.latest(), self.latest())
        self.assert_fits(lines)
        self.tiltproof("run", "bad.yaml", "--seed", "4")
        _, lines = self.lines_at_a_terminal("compare", self.latest() / "../latest/bad", self.latest())
        self.assert_fits(lines)

    def test_no_line_of_a_margin_is_too_long(self):
        fault = "faults:\n  - {id: probe, type: sensor.bias, start_s: 1, parameters: {signal: z_m, offset: 0.1}}\ncriteria"
        self.scenario("drift", criteria=fault, **{"duration_s": "duration_s: 3 #"})
        code, lines = self.lines_at_a_terminal("margin", "drift.yaml", "--fault", "probe", "--tolerance", "0.3")
        self.assertEqual(code, 0)
        self.assertGreater(len(lines), 30)
        self.assert_fits(lines)

    # --repeat

    def repeated(self, text):
        """Of the summary: passed, flown, the worst seed, its margin and criterion, and the command."""
        match = re.search(r"^noisy: (\d+) of (\d+) pass, ([\d.]+) % \(95 % confidence: ([\d.]+) to ([\d.]+) %\)\n +worst: seed (\d+), (\w+), margin (\S+) of (\S+)\n"
                          r" +again: (.*)\n", text, re.M)
        self.assertTrue(match, text)
        return match.groups()

    def test_repeat_says_how_many_pass_and_which_was_the_worst(self):
        self.scenario("noisy", criteria=NOISE, **{"position_error_m <= 0.5": "position_error_m <= 0.0025"})
        code, out, _ = self.tiltproof("run", "noisy.yaml", "--repeat", "8")
        flights = self.results()["scenarios"]
        passed = sum(flight["verdict"] == "pass" for flight in flights)
        self.assertTrue(0 < passed < 8, "a bound that some seeds keep: choose another one")
        self.assertEqual(code, 1)
        found = self.repeated(out)
        self.assertEqual(found[:3], (str(passed), "8", f"{100 * passed / 8:.3g}"))
        self.assertTrue(float(found[3]) < 100 * passed / 8 < float(found[4]))
        least = min(flights, key=lambda flight: flight["criteria"][-1]["margin"])
        self.assertEqual(found[5:9], (str(least["seed"]), "fail", f'{least["criteria"][-1]["margin"]:.3g}', "near"))
        self.assertEqual(found[9], least["replay"])
        self.assertIn(f"noisy-seed{least['seed']}", self.tiltproof(*shlex.split(found[9])[1:])[1])
        self.assertRegex(out.splitlines()[-1], rf"^{passed} of 8 green; report: results/.*/report\.html$")
        # A script reads one object per flight, as ever.
        out = self.tiltproof("run", "noisy.yaml", "--repeat", "2", "--format", "jsonl")[1]
        self.assertEqual([json.loads(line)["seed"] for line in out.splitlines()], [3, 4])

    def test_repeat_of_a_flight_without_chance(self):
        self.scenario("calm")
        out = self.tiltproof("run", "calm.yaml", "--repeat", "2")[1]
        self.assertIn("calm: 2 of 2 pass, nothing is drawn at random: every seed is the same flight\n", out)
        self.assertNotIn("of 1 pass", self.tiltproof("run", "calm.yaml")[1])

    # --last-failed

    def last_failed(self, *arguments, code):
        found, out, err = self.tiltproof("run", ".", "--last-failed", *arguments)
        self.assertEqual(found, code, out + err)
        return out, err

    def names(self):
        return [flight["name"] for flight in self.results()["scenarios"]]

    def test_last_failed_flies_what_was_not_green(self):
        never = {"position_error_m <= 0.5": "position_error_m < 0"}
        self.scenario("good")
        self.scenario("bad", **never)
        self.scenario("expected", **never, **{"seed: 3": "seed: 3\nexpect: fail"})
        self.scenario("worse", **never)
        _, err = self.last_failed(code=2)
        self.assertRegex(err, "there is no last run in results/latest; run once without --last-failed")
        self.assertFalse((self.folder / "results").exists())
        self.tiltproof("run", ".")
        self.assertEqual(self.last_failed("--dry-run", code=0)[0].splitlines(), ["bad", "worse"])
        self.last_failed(code=1)
        self.assertEqual(self.names(), ["bad", "worse"])
        self.scenario("bad")
        out, _ = self.last_failed(code=1)
        self.assertIn("1 of 2 green", out)
        _, err = self.last_failed("-k", "good", code=4)
        self.assertIn("worse was not green either", err)
        self.scenario("worse")
        self.last_failed(code=0)
        self.assertEqual(self.names(), ["worse"])
        out, err = self.last_failed(code=0)
        self.assertEqual(out, "")
        self.assertIn("every flight of the last run was green", err)
        (self.latest() / "results.json").write_text("{")
        _, err = self.last_failed(code=2)
        self.assertIn("the last run cannot be read", err)

    def test_last_failed_flies_the_seeds_that_failed(self):
        self.scenario("noisy", criteria=NOISE, **{"position_error_m <= 0.5": "position_error_m <= 0.0025"})
        self.scenario("other", **{"position_error_m <= 0.5": "position_error_m < 0"})
        self.tiltproof("run", ".", "--repeat", "8")
        failed = {flight["name"]: flight["trace_hash"] for flight in self.results()["scenarios"] if not flight["green"]}
        self.assertTrue(9 <= len(failed) <= 15, failed)
        self.last_failed(code=1)
        self.assertEqual({flight["name"]: flight["trace_hash"] for flight in self.results()["scenarios"]}, failed)
        self.last_failed("--seed", "40", "-k", "other", code=1)
        self.assertEqual((self.names(), self.results()["scenarios"][0]["seed"]), (["other"], 40))
        self.tiltproof("run", ".", "--out", "elsewhere", "-k", "other")
        self.last_failed("--out", "elsewhere", "--dry-run", code=0)

    # compare --baseline

    def fly(self, *arguments):
        self.tiltproof("run", ".", *arguments)
        return self.latest()

    def baseline(self, *arguments, code):
        found, out, err = self.tiltproof("compare", *arguments, "--baseline")
        self.assertEqual(found, code, out + err)
        return out, err

    def test_a_baseline_is_a_gate(self):
        """A vehicle that begins further away has a larger error: as much less margin as the error is larger."""
        start = {"seed: 3": "seed: 3\ninitial: {position_m: [0.1, 0, 2]}"}
        self.scenario("a", **start)
        self.scenario("b", **start)
        first = self.fly()
        self.assertIn("0 of 2 flights worse, 0 better, 2 the same", self.baseline(first, self.fly(), "--tolerance", 0, code=0)[0])
        for away, worse in ((0.1005, False), (0.12, True)):
            self.scenario("a", **{"seed: 3": f"seed: 3\ninitial: {{position_m: [{away}, 0, 2]}}"})
            now = self.fly("--keep", "verdicts")
            out, _ = self.baseline(first, now, code=1 if worse else 0)
            self.assertEqual(len(re.findall("^WORSE    a$", out, re.M)), worse)
            self.assertNotRegex(out, "WORSE +b")
        self.assertRegex(out, r"\n +near: margin 0\.4 before, 0\.38 now\n")
        # The other way round it is better.
        self.assertIn("0 of 2 flights worse, 1 better, 1 the same", self.baseline(now, first, code=0)[0])
        self.scenario("a", **{"position_error_m <= 0.5": "position_error_m < 0"})
        self.scenario("b")
        out, _ = self.baseline(first, self.fly(), code=1)
        self.assertRegex(out, r"WORSE +a: pass before, fail now\n +near: pass before, fail now; margin 0\.4 before, ")
        code, out, _ = self.tiltproof("compare", first, self.latest(), "--baseline", "--format", "jsonl")
        flights = [json.loads(line) for line in out.splitlines()]
        self.assertEqual([(f["scenario"], f["worse"], f["verdict"]["b"]) for f in flights], [("a", True, "fail"), ("b", False, "pass")])
        self.assertEqual(code, 1)

    def test_flights_that_only_one_run_has(self):
        for name in ("a", "b"):
            self.scenario(name)
        both, one = self.fly(), self.fly("-k", "a")
        out, _ = self.baseline(both, one, code=1)
        self.assertIn("MISSING  b: only in A\n", out)
        out, _ = self.baseline(one, both, code=0)
        self.assertIn("new      b: only in B\n", out)
        self.baseline(both / "a", one, code=0)
        self.baseline(both / "a", both / "b", code=0)
        self.assertIn("no scenario of the same name", self.baseline(both / "b", one, code=2)[1])
        self.assertIn("neither a run's results folder", self.baseline(both, "nowhere", code=2)[1])

    def test_another_flight_is_named(self):
        self.scenario("a")
        first = self.fly()
        _, err = self.baseline(first, self.fly("--seed", "4"), code=0)
        self.assertRegex(err, "warning: a is another flight in B: seed: 3 and 4")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
