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


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=1)
