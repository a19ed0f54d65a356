#!/usr/bin/env python3
"""The lines of `tiltproof session` as any language sends them (docs/session.md). Usage: session_test.py TILTPROOF"""
import json
import pathlib
import resource
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = pathlib.Path(sys.argv.pop(1)).resolve()

HOVER = """\
name: hover
duration_s: 3
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: late-enough, stl: "eventually[2,3](z_m >= 1.9)"}
"""


class SessionTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "hover.yaml").write_text(HOVER)

    def begin(self, *more, **how):
        return subprocess.Popen([PROGRAM, "session", "hover.yaml", *more], cwd=self.folder, stdin=subprocess.PIPE,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, **how)

    def talk(self, *lines, more=(), **how):
        """All requests at once; the answers, and the exit code."""
        text = "".join((line if isinstance(line, str) else json.dumps(line)) + "\n" for line in lines)
        session = self.begin(*more, **how)
        out, self.errors = session.communicate(text.encode(), timeout=60)
        return [json.loads(line) for line in out.splitlines()], session.returncode

    def resolved(self):
        return next(self.folder.glob("results/latest/*/scenario.resolved.yaml")).read_text()

    def test_answers_in_turn_and_says_what_it_is(self):
        answers, code = self.talk({"advance_s": 0.1}, {"read": ["z_m", "sensed_z_m"]}, {"finish": True}, {"advance_s": 1})
        hello, advanced, read, ended, again = answers
        self.assertEqual([hello[key] for key in ("session", "scenario", "duration_s", "period_s", "time_s")],
                         [1, "hover", 3.0, 0.012, 0.0])
        self.assertIn("position_error_m", hello["signals"])
        self.assertEqual(advanced, {"time_s": 0.108})
        self.assertAlmostEqual(read["values"]["z_m"], 2, places=2)
        self.assertEqual((ended["ended"], ended["result"]["verdict"]), ("completed", "pass"))
        self.assertEqual(again, ended)
        self.assertEqual(code, 0)
        self.assertEqual(ended["folder"], hello["folder"])

    def test_the_end_of_the_input_stops_the_flight_where_it_stands(self):
        answers, code = self.talk({"advance_s": 0.6})
        self.assertEqual(len(answers), 2)
        self.assertIn("stop_s: 0.6", self.resolved())
        self.assertEqual(code, 4)  # the criterion is undecided
        replay = subprocess.run([PROGRAM, "replay", "results/latest"], cwd=self.folder, capture_output=True, text=True, check=False)
        self.assertIn("1 of 1 equal", replay.stdout)

    def test_a_flight_that_is_stopped_at_power_on_lasts_one_period(self):
        answers, _ = self.talk({"stop": True})
        self.assertEqual(answers[-1]["ended"], "completed")
        self.assertIn("stop_s: 0.012", self.resolved())

    def test_requests_that_are_not_valid(self):
        wrong = {
            "not a line of JSON": "{advance",
            "expected a JSON object": "[1]",
            "expected one of advance_s, until": "{}",
            "did you mean 'advance_s'": {"advance": 1},
            "one request at a time": {"advance_s": 1, "stop": True},
            "only with `until`": {"advance_s": 1, "timeout_s": 1},
            "expected a number of seconds": {"advance_s": "1"},
            "unknown signal": {"read": ["zz"]},
            "expected a list of signals": {"read": "z_m"},
            "expected {\"stop\": true}": {"stop": 1},
            "there is no fault 'x'": {"remove": "x"},
            "at most 65536 bytes": "x" * 200_000,
            "duration_s": {"inject": {"type": "frame.drop", "target": "to_client", "duration_s": -1, "parameters": {"probability": 1}}},
        }
        answers, code = self.talk(*wrong.values(), {"finish": True})
        self.assertEqual(len(answers), len(wrong) + 2)
        for number, (message, answer) in enumerate(zip(wrong, answers[1:]), 1):
            self.assertIn(message, answer["error"]["message"])
            self.assertTrue(answer["error"]["place"].startswith(f"request {number}"), answer)
        self.assertEqual((answers[-1]["ended"], code), ("completed", 0))

    def test_wrong_usage_is_said_before_the_first_line(self):
        for more, message in ((["--set", "seed=1,2"], b"one value"), (["--firmware", "papr"], b"paper"),
                              (["--client", "process:./x {port}"], b"virtual time")):
            answers, code = self.talk(more=more)
            self.assertEqual((answers, code), ([], 2), more)
            self.assertIn(message, self.errors)

    def test_results_that_cannot_be_written_are_the_answer(self):
        def small_files():  # as on a full disk: nothing larger than this
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

        answers, code = self.talk({"advance_s": 0.5}, {"read": ["z_m"]}, {"finish": True}, more=["--no-report"], preexec_fn=small_files)
        self.assertAlmostEqual(answers[2]["values"]["z_m"], 2, places=2)
        self.assertEqual((code, answers[-1]["ended"], answers[-1]["result"]["verdict"]), (3, "error", "error"))
        self.assertRegex(answers[-1]["result"]["reason"], r"the flight's results are missing: cannot write .*trace\.csv: File too large")
        self.assertFalse(list(self.folder.glob("results/latest/hover/trace.csv*")))
        results = json.loads((self.folder / "results/latest/results.json").read_text())
        self.assertEqual(results["scenarios"][0]["verdict"], "error")

    def test_the_command_that_flies_again_is_for_a_shell(self):
        (hello, ended), _ = self.talk({"stop": True}, more=["--out", "my flights (2)", "--no-report"])
        self.assertTrue(hello["replay"].endswith(f" replay '{hello['folder']}'"), hello)
        again = subprocess.run(hello["replay"], shell=True, cwd=self.folder, capture_output=True, text=True, check=False)
        self.assertIn("1 of 1 equal", again.stdout, again.stderr)

    def test_an_interrupt_ends_it_in_order(self):
        session = self.begin()
        session.stdout.readline()
        session.stdin.write(b'{"advance_s": 0.5}\n')
        session.stdin.flush()
        session.stdout.readline()
        session.send_signal(signal.SIGINT)
        session.stdin.close()
        self.assertEqual(session.wait(timeout=20), 130)
        session.stdout.close()
        session.stderr.close()

    def test_a_script_that_does_not_listen_ends_it(self):
        session = self.begin("--set", "duration_s=14000")
        session.stdout.readline()
        session.stdout.close()
        began = time.monotonic()
        session.stdin.write(b'{"until": "z_m > 100"}\n')
        session.stdin.flush()
        self.assertEqual(session.wait(timeout=60), 4)
        self.assertLess(time.monotonic() - began, 40)
        session.stdin.close()
        session.stderr.close()


if __name__ == "__main__":
    unittest.main(verbosity=2)
