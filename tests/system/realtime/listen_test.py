#!/usr/bin/env python3
"""The example of a listener, installed, built with nothing of tiltproof but the file of types, hears a flight.
Usage: listen_test.py TILTPROOF CMAKE BUILD_FOLDER_OF_HARNESS_DDS"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

from flight import Flight, become_subreaper, read, wait_until, write_hover

PROGRAM, CMAKE, INSTALLABLE = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(3))
NODES = {"base_station", "client", "link", "plant"}


class ListenTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-listen-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        installed, build = cls.folder / "installed", cls.folder / "build"
        for arguments in (["--install", INSTALLABLE, "--prefix", installed],
                          ["-S", installed / "share/tiltproof/dds/examples", "-B", build], ["--build", build]):
            done = subprocess.run([CMAKE, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
            assert done.returncode == 0, done.stdout
        cls.listen = build / "listen"

    def test_hears_a_flight(self):
        flight = Flight(PROGRAM, self.folder, write_hover(self.folder, duration_s=3))
        self.addCleanup(flight.end)
        heard = self.folder / "heard"
        with open(heard, "wb") as out:
            listener = subprocess.Popen([self.listen, *flight.place()], stdout=out)
        self.addCleanup(lambda: (listener.kill(), listener.wait()))

        def score():
            self.assertIsNone(listener.poll())
            return re.search(r"^score .*\n", read(heard).decode(), re.MULTILINE)
        wait_until(score, 60, lambda: f"no score was heard: {read(heard).decode()}, {flight.text()}")
        flight.wait(60)
        text = read(heard).decode()

        self.assertTrue(text.startswith("listening\n"), text)
        for line in text.splitlines()[1:]:
            self.assertRegex(line, r"^(state  +-?\d+\.\d{3} s  \w+ (idle|prepared|armed|running|finished|failed) .*"
                                   r"|event  +-?\d+\.\d{3} s  \w+ \w+: .*"
                                   r"|plant  +\d+\.\d{3} s  x -?\d\.\d{3} y -?\d\.\d{3} z [12]\.\d{3} m"
                                   r"|score  hover \w+ .*)$")
        self.assertEqual(set(re.findall(r"^state .* s  (\w+) ", text, re.MULTILINE)), NODES, text)
        self.assertRegex(text, r"(?m)^event .* plant start_accepted: ")
        self.assertRegex(text, r"(?m)^plant ")
        result = flight.result()
        self.assertEqual(re.findall(r"^score .*", text, re.MULTILINE), [f"score  hover {result['verdict']} {result['reason']}"])
        flight.check_results(self)
        flight.check_nothing_left(self)

    def test_says_what_it_cannot_do(self):
        for arguments, code, says in (([], 2, "usage: listen DOMAIN TAG [INTERFACE]\n"),
                                      (["eth0", "tiltproof"], 2, "listen: a domain is a number from 0 to 230, not eth0\n"),
                                      (["1", "tiltproof", "nosuch0"], 1, "listen: cannot join domain 1: ")):
            done = subprocess.run([self.listen, *arguments], capture_output=True, text=True, timeout=20, check=False)
            self.assertEqual((done.returncode, done.stdout), (code, ""), done)
            self.assertIn(says, done.stderr)


if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
