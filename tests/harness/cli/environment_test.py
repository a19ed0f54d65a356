#!/usr/bin/env python3
"""What the machine denies is named: a file that cannot be written, descriptors, TMPDIR, a device.

Usage: environment_test.py TILTPROOF SOURCE_DIR
"""
import json
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = (pathlib.Path(a).resolve() for a in sys.argv[1:3])

HOVER = """\
name: hover
duration_s: 2
reference: {type: hover, at_m: [0, 0, 2]}
"""


class EnvironmentTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-environment-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        (self.folder / "hover.yaml").write_text(HOVER)

    def tiltproof(self, *arguments, **more):
        done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, cwd=self.folder, timeout=120, check=False, **more)
        return done.returncode, done.stdout.decode(), done.stderr.decode()

    def test_results_name_the_file_that_could_not_be_written(self):
        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # less than the trace

        code, out, _ = self.tiltproof("run", "hover.yaml", preexec_fn=limit)
        self.assertEqual(code, 3)
        entry = json.loads((self.folder / "results/latest/results.json").read_text())["scenarios"][0]
        self.assertEqual((entry["name"], entry["verdict"]), ("hover", "error"))
        self.assertRegex(entry["reason"], r"cannot write \S*hover/trace.csv: File too large")
        self.assertIn(entry["reason"], out)

    def test_too_few_descriptors_are_not_a_missing_emulator(self):
        _, out, err = self.tiltproof("doctor", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (4, 4)))
        self.assertNotIn("there is no qemu-system-arm", out + err)
        self.assertIn("Too many open files", out + err)

    def test_a_missing_folder_for_temporary_files_is_named(self):
        self.tiltproof("run", "hover.yaml")
        code, out, err = self.tiltproof("replay", "results/latest", env={"TMPDIR": "/nonexistent"})
        self.assertEqual((code, out), (3, ""))
        self.assertIn("TMPDIR is '/nonexistent', which is not a folder", err)

    def test_a_joystick_node_without_its_device_does_not_start(self):
        code, _, err = self.tiltproof("node", "joystick", "--input", "/nonexistent/js0")
        self.assertEqual(code, 2)
        self.assertIn("--input: joystick /nonexistent/js0: No such file or directory", err)

    def test_a_line_node_names_its_line_and_both_ends(self):
        for flags, text in (((), "--id is missing: the id of the line in the scenario's `lines`"),
                            (("--id", "x", "--cable", "/dev/a"), "--cable /dev/a: must be DEVICE,DEVICE"),
                            (("--id", "x", "--cable", "/dev/a,/dev/b,/dev/c"), "must be DEVICE,DEVICE"),
                            (("--id", "x", "--client", "host"), "--client: a line node has none")):
            code, _, err = self.tiltproof("node", "line", *flags)
            self.assertEqual(code, 2)
            self.assertIn(text, err)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
