#!/usr/bin/env python3
"""The suite of line faults with the protocol `hardened` in place of `paper`: each build survives what it survives with `paper`, and what is listed here.

Usage: hardened_test.py TILTPROOF SOURCE [CLIENT]
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:3])
CLIENT = sys.argv[3] if len(sys.argv) > 3 else "host"
del sys.argv[1:]

# Results other than with `paper`, by build. A `-fail` flies: a repeated or old message is refused, and the longer check finds more.
# A `-survive` is lost: `checksum_preserving` also forges numbers, and behind one far ahead the receiver refuses honest messages.
CHANGED = {
    "paper": {"wire-frame-checksum-preserving-survive", "wire-frame-duplicate-fail", "wire-frame-script-fail", "wire-frame-unsolicited-fail"},
    "tolerant": {"wire-burst-fail", "wire-byte-drop-fail", "wire-byte-duplicate-fail", "wire-byte-insert-fail", "wire-frame-checksum-preserving-fail",
                 "wire-frame-checksum-preserving-survive", "wire-frame-drop-fail", "wire-frame-duplicate-fail", "wire-frame-replay-stale-fail",
                 "wire-frame-truncate-fail", "wire-frame-unsolicited-fail", "wire-gilbert-elliott-fail", "wire-stuck-byte-fail"},
}
# The board flies fewer: what the protocol is for.
ON_THE_BOARD = ("frame-drop", "frame-duplicate-survive", "frame-reorder", "frame-replay-stale", "frame-truncate", "byte-drop", "bit-error")


def with_hardened(text):
    """The scenario with that protocol, and without criteria that require an effect of the fault."""
    text = re.sub(r"^  - \{name: [^}]*metric: .*\n", "", text, flags=re.MULTILINE)
    if re.search(r"^link: \{", text, re.MULTILINE):
        return re.sub(r"^link: \{", "link: {protocol: hardened, ", text, flags=re.MULTILINE)
    return text + "link: {protocol: hardened}\n"


class Hardened(unittest.TestCase):
    maxDiff = None

    def check(self, build):
        with tempfile.TemporaryDirectory() as folder:
            files = pathlib.Path(folder, "scenarios")
            files.mkdir()
            for file in sorted((SOURCE / "scenarios/wire").glob("*.yaml")):
                if CLIENT != "host" and not file.name.startswith(ON_THE_BOARD):
                    continue
                (files / file.name).write_text(with_hardened(file.read_text()))
            (pathlib.Path(folder) / "envelope").symlink_to(SOURCE.resolve() / "scenarios/envelope")
            command = [TILTPROOF, "run", files, "--client", CLIENT, "--firmware", build, "-j", "2", "--out", folder, "--keep", "verdicts", "--no-report", "--no-progress"]
            done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
            self.assertIn(done.returncode, (0, 1), done.stdout + done.stderr)
            flights = json.loads(pathlib.Path(folder, "latest/results.json").read_text())["scenarios"]
        self.assertGreater(len(flights), 60 if CLIENT == "host" else 8)
        self.assertEqual({flight["name"] for flight in flights if flight["verdict"] not in ("pass", "fail")}, set())
        self.assertEqual({flight["name"] for flight in flights if not flight["green"]}, CHANGED[build] & {flight["name"] for flight in flights}, done.stdout)

    def test_paper(self):
        self.check("paper")

    def test_tolerant(self):
        self.check("tolerant")


if __name__ == "__main__":
    unittest.main(verbosity=2)
