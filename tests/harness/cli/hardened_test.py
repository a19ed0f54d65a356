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
sys.path.insert(0, str(SOURCE / "tests/emulator"))
from same_flight import earlier, motion  # noqa: E402

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
# Some microseconds of computing change nothing in these flights. They are shorter on the board, and the same to the bit as those of the
# library, whose verdicts are known.
AS_THE_LIBRARY = {
    "paper": ("frame-drop", "frame-duplicate-survive", "frame-replay-stale", "frame-truncate", "byte-drop"),
    "tolerant": ("frame-drop", "frame-duplicate-survive", "frame-replay-stale", "frame-truncate-survive", "byte-drop-survive"),
}


def with_hardened(text):
    """The scenario with that protocol, and without criteria that require an effect of the fault."""
    text = re.sub(r"^  - \{name: [^}]*metric: .*\n", "", text, flags=re.MULTILINE)
    if re.search(r"^link: \{", text, re.MULTILINE):
        return re.sub(r"^link: \{", "link: {protocol: hardened, ", text, flags=re.MULTILINE)
    return text + "link: {protocol: hardened}\n"


class Hardened(unittest.TestCase):
    maxDiff = None

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "envelope").symlink_to(SOURCE.resolve() / "scenarios/envelope")

    def scenarios(self, names="", but=(), change=lambda text: text):
        """A folder of the suite's scenarios whose names begin so, and not like that."""
        files = self.folder / f"scenarios{len(list(self.folder.iterdir()))}"
        files.mkdir()
        for file in sorted((SOURCE / "scenarios/wire").glob("*.yaml")):
            if file.name.startswith(names) and not file.name.startswith(but):
                (files / file.name).write_text(change(with_hardened(file.read_text())))
        return files

    def fly(self, files, client, build, *flags):
        out = self.folder / client
        command = [TILTPROOF, "run", files, "--client", client, "--firmware", build, "-j", "2", "--out", out, "--no-report", "--no-progress", *flags]
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
        self.assertIn(done.returncode, (0, 1), done.stdout + done.stderr)
        return json.loads((out / "latest/results.json").read_text())["scenarios"], done.stdout

    def check_as_the_library(self, build):
        files = self.scenarios(AS_THE_LIBRARY[build], change=lambda text: earlier(text, 8, duration_s=9))
        flown = {client: {flight["name"]: flight for flight in self.fly(files, client, build)[0]} for client in ("host", CLIENT)}
        self.assertGreater(len(flown[CLIENT]), 6)
        for name, flight in flown[CLIENT].items():
            with self.subTest(name):
                self.assertIn(flight["verdict"], ("pass", "fail"))
                self.assertTrue(all(fault["activations"] > 0 for fault in flight["faults"]), flight)
                self.assertEqual(flight["end_reason"], flown["host"][name]["end_reason"])
                library, image = (motion(self.folder / client / "latest" / name / "trace.csv") for client in ("host", CLIENT))
                for mine, theirs in zip(image, library, strict=True):
                    self.assertEqual(mine, theirs)

    def check(self, build):
        if CLIENT == "host":
            files = self.scenarios()
        else:
            self.check_as_the_library(build)
            files = self.scenarios(ON_THE_BOARD, but=AS_THE_LIBRARY[build])
        flights, output = self.fly(files, CLIENT, build, "--keep", "verdicts")
        self.assertGreater(len(flights), 60 if CLIENT == "host" else 3)
        self.assertEqual({flight["name"] for flight in flights if flight["verdict"] not in ("pass", "fail")}, set())
        self.assertEqual({flight["name"] for flight in flights if not flight["green"]}, CHANGED[build] & {flight["name"] for flight in flights}, output)

    def test_paper(self):
        self.check("paper")

    def test_tolerant(self):
        self.check("tolerant")


if __name__ == "__main__":
    unittest.main(verbosity=2)
