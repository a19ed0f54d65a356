#!/usr/bin/env python3
"""docs/ci/annotate.py on the JUnit file of a run: one annotation for each flight that is not green.
Usage: annotate_test.py TILTPROOF SOURCE_DIR"""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import urllib.parse

PROGRAM, SOURCE = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(2))
FLIGHT = """name: {name}
duration_s: 2
reference: {{type: spiral}}
criteria:
  - {{name: near, stl: "{formula}"}}
"""


class AnnotateTest(unittest.TestCase):
    def test_one_for_each_flight_that_is_not_green(self):
        with tempfile.TemporaryDirectory(prefix="tiltproof-annotate-") as name:
            folder = pathlib.Path(name)
            for flight, formula in (("good", "always(position_error_m <= 100.0)"), ("bad", "always(position_error_m <= -1.0)")):
                (folder / f"{flight}.yaml").write_text(FLIGHT.format(name=flight, formula=formula))
            flown = subprocess.run([PROGRAM, "run", ".", "--no-report"], cwd=folder, stdout=subprocess.PIPE, text=True, check=False)
            self.assertEqual(flown.returncode, 1, flown.stdout)
            lines = subprocess.run([sys.executable, SOURCE / "docs/ci/annotate.py", folder / "results/latest/junit.xml"],
                                   stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()
        self.assertEqual(len(lines), 1, lines)
        title, text = re.fullmatch("::error title=([^:,]*)::(.*)", lines[0]).groups()
        self.assertEqual(title, "bad")
        text = urllib.parse.unquote(text)
        self.assertIn("near: always(position_error_m <= -1.0)", text)
        self.assertRegex(text, r"\nreplay: \S+ replay results/\S+/bad")


if __name__ == "__main__":
    unittest.main()
