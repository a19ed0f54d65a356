"""The program in a folder of its own, as the tests of its commands use it. The script that imports this has the program as its first argument."""
import json
import os
import pathlib
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = pathlib.Path(sys.argv[1]).resolve()

SHORT_HOVER = """\
name: NAME
duration_s: 0.6
seed: 3
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


class CommandLineTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-cli-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def tiltproof(self, *arguments, stdin=b"", timeout=120, environment=None):
        done = subprocess.run([PROGRAM, *map(str, arguments)], input=stdin, capture_output=True, cwd=self.folder, timeout=timeout, check=False,
                              env={**os.environ, **(environment or {})})
        return done.returncode, done.stdout.decode(), done.stderr.decode()

    def at_a_terminal(self, *arguments, streams=("stdout", "stderr")):
        """The exit code, and what a terminal gets from these streams; the others go nowhere."""
        ours, theirs = pty.openpty()
        to = {name: theirs if name in streams else subprocess.DEVNULL for name in ("stdout", "stderr")}
        with subprocess.Popen([PROGRAM, *map(str, arguments)], cwd=self.folder, **to) as process:
            os.close(theirs)
            text = b""
            try:
                while part := os.read(ours, 65536):
                    text += part
            except OSError:  # the other end was closed
                pass
            os.close(ours)
            code = process.wait(120)
        return code, text.decode()

    def lines_at_a_terminal(self, *arguments):
        code, text = self.at_a_terminal(*arguments, streams=("stdout",))
        return code, re.sub(r"\033\[\d*m", "", text).replace("\r", "").splitlines()

    def scenario(self, name, text=SHORT_HOVER, folder=".", **changes):
        text = text.replace("NAME", name)
        for old, new in changes.items():
            text = text.replace(old, new)
        path = self.folder / folder / f"{name}.yaml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    def latest(self):
        return (self.folder / "results" / "latest").resolve()

    @staticmethod
    def forget_hashes(flight):
        """As a flight of an older program: none of its files has one."""
        verdict = flight / "verdict.json"
        verdict.write_text(json.dumps({key: value for key, value in json.loads(verdict.read_text()).items() if key not in ("files", "hash")}))

    def results(self):
        return json.loads((self.latest() / "results.json").read_text())
