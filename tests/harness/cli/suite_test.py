#!/usr/bin/env python3
"""Suites as a user keeps them: what is found, what applies, what is left of a run. Usage: suite_test.py TILTPROOF SOURCE_DIR CLIENTS_DIR"""
import json
import os
import pathlib
import re
import shlex
import socket
import subprocess
import sys
import time
import unittest
import xml.etree.ElementTree

from command_line import PROGRAM, CommandLineTest

SOURCE, CLIENTS = (pathlib.Path(a).resolve() for a in sys.argv[2:4])


class SuiteTest(CommandLineTest):
    def junit(self):
        return xml.etree.ElementTree.parse(self.latest() / "junit.xml").getroot()[0]

    # names that were mistyped

    def test_a_mistyped_command_gets_a_suggestion(self):
        for typed, meant in ((["rnu", "x.yaml"], "'rnu'; did you mean 'run'?"), (["chekc"], "'chekc'; did you mean 'check'?"),
                             (["frame", "encod", "00"], "'encod'; did you mean 'encode'?")):
            code, out, err = self.tiltproof(*typed)
            self.assertEqual((code, out), (2, ""))
            self.assertIn(meant, err)
        code, _, err = self.tiltproof("quadrature")
        self.assertEqual(code, 2)
        self.assertIn("unknown command 'quadrature'; all commands: tiltproof --help", err)

    def test_faults_prints_one_fault(self):
        code, out, err = self.tiltproof("faults", "frame.delay")
        self.assertEqual((code, err), (0, ""))
        self.assertTrue(out.startswith("## frame.delay\n"), out)
        self.assertEqual(out.count("\n## "), 0)
        self.assertIn(out, self.tiltproof("faults")[1])
        code, out, err = self.tiltproof("faults", "frame.dealy")
        self.assertEqual((code, out), (2, ""))
        self.assertIn("'frame.dealy'; did you mean 'frame.delay'?", err)

    # what stands in a suite's folder

    def test_what_is_named_like_a_scenario_and_is_no_file_is_a_mistake(self):
        self.scenario("good", folder="suite")
        self.scenario("bad", folder="suite", seed="sead")
        (self.folder / "suite/gone.yaml").symlink_to("nowhere.yaml")
        os.mkfifo(self.folder / "suite/pipe.yml")
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(self.folder / "suite/ear.yaml"))
        (self.folder / "suite/turn.yaml").symlink_to("turn.yaml")
        (self.folder / "suite/.#good.yaml").symlink_to("somebody@somewhere.1234")  # Emacs at work
        for command in (["check"], ["list"], ["run"], ["run", "--dry-run"]):
            code, out, err = self.tiltproof(*command, "suite")
            self.assertEqual((code, out), (2, ""), err)
            self.assertEqual(sorted(err.splitlines()), [
                "suite/bad.yaml:3:1: unknown key 'sead'; did you mean 'seed'?",
                "suite/ear.yaml: a socket, not a file",
                "suite/gone.yaml: a link to nowhere.yaml, which does not exist",
                "suite/pipe.yml: a FIFO, not a file",
                "suite/turn.yaml: a link that leads back to itself"])
        self.assertEqual(self.tiltproof("check", "suite/gone.yaml")[2], "suite/gone.yaml: a link to nowhere.yaml, which does not exist\n")

    def test_a_circle_of_links_is_left_alone_with_one_warning(self):
        self.scenario("good", folder="suite")
        (self.folder / "suite/here").symlink_to(".")
        (self.folder / "suite/there").symlink_to("back")
        (self.folder / "suite/back").symlink_to("there")
        code, out, err = self.tiltproof("run", "suite")
        self.assertEqual(code, 0, err)
        self.assertIn("1 of 1 green", out)
        self.assertEqual(sorted(err.splitlines()), [
            "warning: suite/back: not followed: a link that leads back to itself",
            "warning: suite/here: not followed: a link to a folder that it is in",
            "warning: suite/there: not followed: a link that leads back to itself"])

    # what no flight can decide

    def test_a_formula_that_no_flight_can_decide_is_a_mistake(self):
        late = "eventually[0.3,0.4](eventually[0.4,0.5](position_error_m <= 0.5))"
        self.scenario("late", **{"always(position_error_m <= 0.5)": late})
        for command in ("check", "run"):
            code, out, err = self.tiltproof(command, "late.yaml")
            self.assertEqual((code, out), (2, ""))
            self.assertEqual(err, "late.yaml:6:24: stl: can be decided at 0.7 s at the earliest, and the flight ends at 0.6 s (duration_s)\n")
        self.scenario("late", **{"always(position_error_m <= 0.5)": late, "duration_s: 0.6": "duration_s: 0.7"})
        self.assertEqual(self.tiltproof("check", "late.yaml")[0], 0)

    # what is printed of a flight

    def test_every_criterion_that_does_not_hold_is_printed(self):
        self.scenario("bad", criteria="faults:\n  - {id: late, type: frame.drop, target: both, start_s: 0.5, end_s: 0.501, parameters: {probability: 0}}\ncriteria",
                      **{"position_error_m <= 0.5": "position_error_m < 0"})
        with open(self.folder / "bad.yaml", "a") as file:
            file.write('  - {name: upright, stl: "always(tilt_rad < 0)"}\n  - {name: fine, stl: "always(tilt_rad < 9)"}\n'
                       '  - {name: later, stl: "eventually[0,9](tilt_rad < 0)"}\n  - {name: calm, metric: tracking.rmse_m, max: 1.0e-9}\n')
        code, out, _ = self.tiltproof("run", "bad.yaml")
        self.assertEqual(code, 1)
        for line in ("near: always(position_error_m < 0): ", "upright: always(tilt_rad < 0): ", "undecided at the end of the flight: later$", "calm: tracking.rmse_m = ",
                     "fault 'late' never activated", "expected pass; seed 3; again: "):
            self.assertEqual(len(re.findall("^ +" + line.replace("(", r"\(").replace(")", r"\)"), out, re.MULTILINE)), 1, (line, out))
        self.assertNotIn("fine", out)

    def test_a_crash_gives_its_reason_first_and_no_margin_that_it_had_left(self):
        self.scenario("crash", criteria="faults:\n  - {id: f, type: harness.canary, start_s: 0.1}\ncriteria",
                      **{"duration_s: 0.6": "duration_s: 3", "position_error_m <= 0.5": "position_error_m <= 50"})
        with open(self.folder / "crash.yaml", "a") as file:
            file.write('  - {name: upright, stl: "always(abs(roll_rad) <= 3)"}\n')
        code, out, _ = self.tiltproof("run", "crash.yaml")
        self.assertEqual(code, 1)
        flight, reason, undecided, _ = out[out.index("FAIL"):].splitlines()[:4]
        self.assertNotIn("margin", flight)
        self.assertRegex(reason, "^ +survival: ground strike")
        self.assertRegex(undecided, "^ +undecided at the end of the flight: near, upright$")
        criteria = {c["name"]: c for c in self.results()["scenarios"][0]["criteria"]}
        self.assertGreater(criteria["near"]["margin"], 0)  # the file says what was measured

    def test_a_pass_that_was_not_expected_says_so(self):
        self.scenario("good", **{"seed: 3": "seed: 3\nexpect: fail"})
        code, out, _ = self.tiltproof("run", "good.yaml")
        self.assertEqual(code, 1)
        self.assertIn("every criterion holds, but the flight was expected to fail", out)
        self.assertIn("expected to fail", self.results()["scenarios"][0]["reason"])
        self.assertIn("expected to fail", self.junit().find("testcase/failure").get("message"))

    def test_a_flights_line_says_how_near_it_was(self):
        noise = "faults:\n  - {id: noise, type: wire.bit_error, target: both, parameters: {ber: 0.001}}\ncriteria"
        self.scenario("hover", criteria=noise)
        with open(self.folder / "hover.yaml", "a") as file:
            file.write("  - {name: calm, metric: tracking.max_error_m, min: 0, max: 2}\n")
        code, out, _ = self.tiltproof("run", "hover.yaml")
        self.assertEqual(code, 0, out)
        entry = self.results()["scenarios"][0]
        margins = [c["margin"] for c in entry["criteria"]]
        self.assertEqual(margins[:-1], [c["robustness"] for c in entry["criteria"]][:-1])
        self.assertAlmostEqual(margins[-1], (2 - entry["metrics"]["tracking.max_error_m"]) / 2, places=12)
        activations = entry["faults"][0]["activations"]
        self.assertGreater(activations, 1)
        least = min(m for m in margins if m is not None)
        self.assertRegex(out, rf"PASS +hover +0\.6 s  rmse \d\.\d+ m  margin {least:.3g}  {activations} activations\n")

    def test_a_flights_line_fits_a_terminal(self):
        noise = "faults:\n  - {id: noise, type: wire.bit_error, target: both, parameters: {ber: 0.001}}\ncriteria"
        long = "a-scenario-with-quite-some-words-in-its-name-and-more-to-come-after-them-until-here"
        self.scenario(long, criteria=noise)
        self.scenario(long + "-fail", criteria=noise, **{"position_error_m <= 0.5": "position_error_m < 0", "seed: 3": "seed: 3\nexpect: fail"})
        self.scenario("short")
        lines = [line for line in self.lines_at_a_terminal("run", ".")[1] if line.startswith(("PASS", "FAIL"))]
        self.assertEqual(len(lines), 3, lines)
        self.assertLessEqual(max(map(len, lines)), 80, lines)
        self.assertRegex(lines[1], r"^PASS +a-scenario-w.*\.\..*-until-here  0\.6 s  rmse .* m  margin .*  \d+ act\.$")
        self.assertRegex(lines[0], r"^FAIL \(expected\) a-scen.*\.\..*-fail  0\.6 s  ")
        self.assertRegex(lines[2], r"^PASS +short  +0\.6 s ")

    # what applies to a client

    def mixed_suite(self):
        self.scenario("flies", folder="suite")
        board = "faults:\n  - {id: still, type: device.stall, start_s: 0.1, end_s: 0.2}\n"
        self.scenario("board", folder="suite", criteria=board + "criteria")
        self.scenario("nodes", folder="suite", criteria=board.replace("device.stall", "node.pause, parameters: {node: client}") + "criteria")

    def test_what_does_not_apply_is_listed_and_the_rest_flies(self):
        self.mixed_suite()
        board = (self.folder / "suite/board.yaml").read_text()
        (self.folder / "suite/bored.yaml").write_text(board.replace("name: board", "name: bored"))
        code, out, err = self.tiltproof("run", "suite")
        self.assertEqual((code, err), (0, ""), out)
        self.assertIn("not applicable: needs an emulated board: fly it with --client qemu\n                 board, bored\n", out)
        self.assertRegex(out, r"not applicable: acts on a node, .*needs --mode realtime\n +nodes\n")
        self.assertRegex(out.splitlines()[-1], r"^1 of 1 green, 3 not applicable; report: results/.*/report\.html$")
        self.assertEqual([e["name"] for e in self.results()["scenarios"]], ["flies"])
        left_out = self.results()["not_applicable"]
        self.assertEqual([e["name"] for e in left_out], ["board", "bored", "nodes"])
        self.assertEqual(left_out[0]["reason"], "suite/board.yaml:6:23: fault 'still' (device.stall) needs an emulated board: fly it with --client qemu")
        junit = self.junit()
        self.assertEqual((junit.get("tests"), junit.get("skipped"), junit.get("errors")), ("4", "3", "0"))
        self.assertEqual([t.get("name") for t in junit.iter("testcase") if t.find("skipped") is not None], ["board", "bored", "nodes"])
        # A script reads one object per flight, as ever; scoring again forgets nothing.
        code, out, err = self.tiltproof("run", "suite", "--format", "jsonl")
        self.assertEqual((code, [json.loads(line)["name"] for line in out.splitlines()]), (0, ["flies"]))
        self.assertEqual(err.count("not applicable: "), 3)
        code, out, _ = self.tiltproof("score", self.latest())
        self.assertEqual((code, out.splitlines()[-1]), (0, "1 of 1 green, 3 not applicable"))
        self.assertEqual(self.junit().get("skipped"), "3")

    def test_what_was_asked_for_and_does_not_apply_is_a_mistake(self):
        self.mixed_suite()
        code, out, err = self.tiltproof("run", "suite", "suite/board.yaml")
        self.assertEqual((code, out), (2, ""))
        self.assertEqual(err, "suite/board.yaml:6:23: fault 'still' (device.stall) needs an emulated board: fly it with --client qemu\n")
        code, out, err = self.tiltproof("run", "suite", "--strict")
        self.assertEqual((code, out, len(err.splitlines())), (2, "", 2))
        self.assertFalse((self.folder / "results").exists())

    def test_a_start_that_no_firmware_survives_is_a_mistake(self):
        for start, words in (("position_m: [0, 0, 0.05]", "touches the ground"), ("position_m: [0, 0, -3]", "touches the ground"),
                             ("attitude_rad: [1.6, 0, 0]", "is tilted by 91.7 deg"), ("position_m: [900, 900, 2]", "m from the origin, limit 1000 m")):
            path = self.scenario("start", **{"seed: 3": f"seed: 3\ninitial: {{{start}}}"})
            for command in ("check", "run"):
                code, out, err = self.tiltproof(command, path)
                self.assertEqual((code, out), (2, ""), err)
                self.assertIn("start.yaml: initial: the flight would end where it starts: ", err)
                self.assertIn(words, err)

    def test_a_heading_that_the_shipped_firmware_does_not_keep_is_refused_for_it(self):
        path = self.scenario("turned", **{"at_m: [0, 0, 2]": "at_m: [0, 0, 2], yaw_rad: 0.6"})
        started = self.scenario("started", **{"seed: 3": "seed: 3\ninitial: {attitude_rad: [0, 0, -0.7]}"})
        for command in ("check", "run"):
            code, _, err = self.tiltproof(command, path, started)
            self.assertEqual(code, 2, err)
            self.assertRegex(err, r"turned.yaml: reference: a heading of 0.6 rad; the law of the shipped firmware \(paper\) is linear around 0")
            self.assertIn("started.yaml: initial: attitude_rad: a heading of -0.7 rad", err)
        self.scenario("straight")
        code, out, _ = self.tiltproof("run", self.folder)
        self.assertEqual(code, 0, out)
        self.assertRegex(out, r"not applicable: turns far from a heading of 0; the law of the shipped firmware \(paper\).*\n +started, turned\n")
        library = CLIENTS.parent.parent / "lib/minimal_firmware.so"
        self.assertEqual(self.tiltproof("check", path, "--client", f"library:{library}")[0], 0)

    def test_when_nothing_applies_nothing_is_green(self):
        self.mixed_suite()
        code, out, err = self.tiltproof("run", "suite", "-k", "not flies")
        self.assertEqual((code, out), (4, ""))
        self.assertEqual(err.count("not applicable: "), 2)
        self.assertIn("nothing is left to fly", err)
        self.assertFalse((self.folder / "results").exists())
        code, out, err = self.tiltproof("run", "suite", "--dry-run")
        self.assertEqual((code, out, err.count("not applicable: ")), (0, "flies\n", 2))

    def test_check_and_list_judge_a_firmware_as_run_does(self):
        self.scenario("mine", **{"seed: 3": "firmware: mine"})
        library = f"library:{CLIENTS / 'libmisbehaving_client.so'}"
        for command in ("check", "list"):
            code, _, err = self.tiltproof(command, "mine.yaml")
            self.assertEqual(code, 2)
            self.assertRegex(err, "unknown build 'mine'; .*; --client flies a firmware of your own")
            self.assertEqual(self.tiltproof(command, "mine.yaml", "--client", library)[0], 0)
            self.assertEqual(self.tiltproof(command, "mine.yaml", "--client", "serial:/dev/ttyUSB0")[0], 0)
            code, _, err = self.tiltproof(command, "mine.yaml", "--client", "qemu")
            self.assertEqual(code, 2)
            self.assertIn("unknown build 'mine'", err)
            code, _, err = self.tiltproof(command, "mine.yaml", "--client", "nonsense")
            self.assertEqual(code, 2)
            self.assertIn("--client nonsense", err)

    # a run that does not come to its end

    def start(self, *arguments):
        process = subprocess.Popen([PROGRAM, *map(str, arguments)], cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def wait_for(self, condition):
        deadline = time.monotonic() + 60
        while not condition():
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)

    def verdicts(self):
        return [(e["name"], e["verdict"]) for e in self.results()["scenarios"]]

    def test_a_killed_run_is_an_error_for_every_flight_that_did_not_end(self):
        self.scenario("a")
        self.scenario("b", duration_s="duration_s: 9000 #")
        self.scenario("c")
        process = self.start("run", ".")
        # The results follow the flights while others are under way.
        self.wait_for(lambda: (self.folder / "results/latest/results.json").exists() and self.verdicts()[0] == ("a", "pass"))
        self.wait_for((self.latest() / "b/scenario.resolved.yaml").exists)
        process.kill()
        process.wait()
        self.assertEqual(self.verdicts(), [("a", "pass"), ("b", "error"), ("c", "error")])
        self.assertEqual({e["reason"] for e in self.results()["scenarios"][1:]}, {"not flown to the end: the run ended before, or is still under way"})
        junit = self.junit()
        self.assertEqual((junit.get("tests"), junit.get("errors"), junit.get("failures")), ("3", "2", "0"))
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 4, out)
        self.assertIn("an unfinished run: 1 of 3 flights came to a verdict", out)
        self.assertIn("1 of 1 equal", out)
        # `score` makes all of it again from what the flights left.
        whole = {name: (self.latest() / name).read_text() for name in ("results.json", "junit.xml")}
        for name in whole:
            (self.latest() / name).unlink()
        code, out, err = self.tiltproof("score", self.latest())
        self.assertEqual((code, err), (3, ""), out)
        self.assertIn("1 of 3 green", out)
        for name, text in whole.items():
            self.assertEqual((self.latest() / name).read_text(), text)

    def test_a_run_killed_at_once_has_every_flight_as_an_error(self):
        self.scenario("a", duration_s="duration_s: 9000 #")
        self.scenario("b")
        process = self.start("run", ".", "--repeat", "2")
        self.wait_for((self.folder / "results/latest/junit.xml").exists)
        process.kill()
        process.wait()
        self.assertEqual(self.verdicts(), [(name, "error") for name in ("a-seed3", "a-seed4", "b-seed3", "b-seed4")])
        self.assertEqual(self.junit().get("errors"), "4")
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 4, out)
        self.assertIn("an unfinished run: 0 of 4 flights", out)
        self.assertEqual(self.tiltproof("score", self.latest())[0], 3)

    def test_scoring_again_writes_the_same_results(self):
        self.scenario("a")
        self.scenario("b", **{"position_error_m <= 0.5": "position_error_m < 0"})
        self.tiltproof("run", ".")
        before = (self.latest() / "results.json").read_text()
        events = (self.latest() / "events.jsonl").read_text()
        self.assertEqual(self.tiltproof("score", self.latest())[0], 1)
        self.assertEqual((self.latest() / "results.json").read_text(), before)
        self.assertEqual((self.latest() / "events.jsonl").read_text(), events)
        # New criteria, new results; but of the whole run only.
        resolved = self.latest() / "b/scenario.resolved.yaml"
        resolved.write_text(resolved.read_text().replace("position_error_m < 0", "position_error_m < 1"))
        self.assertEqual(self.tiltproof("score", self.latest() / "b")[0], 0)
        self.assertEqual((self.latest() / "results.json").read_text(), before)
        self.assertEqual(self.tiltproof("score", self.latest())[0], 0)
        self.assertEqual(self.verdicts(), [("a", "pass"), ("b", "pass")])

    def test_flights_after_the_first_failure_are_errors_of_a_run_that_stops_there(self):
        self.scenario("a", **{"position_error_m <= 0.5": "position_error_m < 0"})
        self.scenario("b")
        code, out, _ = self.tiltproof("run", ".", "--fail-fast")
        self.assertEqual(code, 1, out)
        self.assertIn("0 of 2 green, 1 not flown", out)
        self.assertEqual(self.verdicts(), [("a", "fail"), ("b", "error")])
        self.assertEqual(self.results()["scenarios"][1]["reason"], "not flown: --fail-fast ended the run")
        # Others that are under way fly to their end.
        for i in range(6):
            self.scenario(f"c{i}", **{"duration_s: 0.6": "duration_s: 30"})
        code, out, _ = self.tiltproof("run", ".", "--fail-fast", "-j", "3")
        self.assertEqual(code, 1, out)
        not_flown = [entry["name"] for entry in self.results()["scenarios"] if entry["reason"].startswith("not flown")]
        green = sum(entry["green"] for entry in self.results()["scenarios"])
        self.assertIn(f"{green} of 8 green, {len(not_flown)} not flown", out)
        self.assertIn("c5", not_flown)

    # --keep

    def run_keeping(self, keep):
        self.scenario("good")
        self.scenario("bad", **{"position_error_m <= 0.5": "position_error_m < 0"})
        code, out, err = self.tiltproof("run", ".", "--keep", keep)
        self.assertEqual(code, 1, out + err)
        self.assertEqual(self.verdicts(), [("bad", "fail"), ("good", "pass")])
        return sorted(entry.name for entry in self.latest().iterdir() if entry.is_dir())

    def test_keep_says_which_flights_leave_a_folder(self):
        self.assertEqual(self.run_keeping("all"), ["bad", "good"])
        everything = self.results()
        events = (self.latest() / "events.jsonl").read_text()
        self.assertIn('"scenario":"good"', events)
        kept = sorted(file.name for file in (self.latest() / "bad").iterdir())
        for keep, folders in (("failing", ["bad"]), ("verdicts", [])):
            self.assertEqual(self.run_keeping(keep), folders)
            results = self.results()
            for then, now in zip(everything["scenarios"], results["scenarios"]):
                self.assertEqual({**then, "wall_s": 0, "real_time_factor": 0, "replay": ""}, {**now, "wall_s": 0, "real_time_factor": 0, "replay": ""})
            self.assertEqual((self.latest() / "events.jsonl").read_text(), events)
            if folders:
                self.assertEqual(sorted(file.name for file in (self.latest() / "bad").iterdir()), kept)

    def test_the_command_of_a_flight_without_a_folder_flies_it_again(self):
        self.run_keeping("verdicts")
        [bad] = [entry for entry in self.results()["scenarios"] if entry["name"] == "bad"]
        code, out, err = self.tiltproof(*shlex.split(bad["replay"])[1:])
        self.assertEqual(code, 1, out + err)
        self.assertEqual(self.results()["scenarios"][0]["trace_hash"], bad["trace_hash"])

    def test_flights_that_were_not_kept_stay_as_they_were_judged(self):
        self.run_keeping("failing")
        before = self.results()["scenarios"], (self.latest() / "events.jsonl").read_text()
        code, out, _ = self.tiltproof("score", self.latest())
        self.assertEqual(code, 1, out)
        self.assertIn("1 of 2 green", out)
        self.assertEqual((self.results()["scenarios"], (self.latest() / "events.jsonl").read_text()), before)
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 0, out)
        self.assertIn("1 of 2 flights were kept (--keep failing), and are flown again", out)
        self.run_keeping("verdicts")
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 4, out)
        self.assertIn("0 of 2 flights were kept", out)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=1)
