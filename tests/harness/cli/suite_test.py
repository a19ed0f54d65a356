#!/usr/bin/env python3
"""Suites as a user keeps them: what is found, what applies, what is left of a run. Usage: suite_test.py TILTPROOF SOURCE_DIR CLIENTS_DIR"""
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE, CLIENTS = (pathlib.Path(a).resolve() for a in sys.argv[1:4])

SHORT_HOVER = """\
name: NAME
duration_s: 0.6
seed: 3
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


class SuiteTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-suite-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def tiltproof(self, *arguments, timeout=120):
        done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, cwd=self.folder, timeout=timeout, check=False, text=True)
        return done.returncode, done.stdout, done.stderr

    def scenario(self, name, folder=".", **changes):
        text = SHORT_HOVER.replace("NAME", name)
        for old, new in changes.items():
            text = text.replace(old, new)
        path = self.folder / folder / f"{name}.yaml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    # names that were mistyped

    def test_a_mistyped_command_gets_a_suggestion(self):
        for typed, meant in ((["rnu", "x.yaml"], "'rnu'; did you mean 'run'?"), (["chekc"], "'chekc'; did you mean 'check'?"),
                             (["frame", "encod", "00"], "'encod'; did you mean 'encode'?")):
            code, out, err = self.tiltproof(*typed)
            self.assertEqual((code, out), (2, ""))
            self.assertIn(meant, err)
        code, _, err = self.tiltproof("quadrature")
        self.assertEqual(code, 2)
        self.assertRegex(err, "unknown command 'quadrature'; valid: run, check, .*link-dump")

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
        self.scenario("good", "suite")
        self.scenario("bad", "suite", seed="sead")
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
        self.scenario("good", "suite")
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


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=1)
