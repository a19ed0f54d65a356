#!/usr/bin/env python3
"""The shipped lockstep scenarios fly as they always have, to the last digit: tests/golden/flights.json.

Usage: golden_flights_test.py TILTPROOF SOURCE_DIR [--board RESULTS] [--write]
Flies the host firmware. --board: reads instead the results of `run scenarios/wire scenarios/device --client qemu --firmware paper`, the image on the emulated board.
--write replaces that part of the file, after a change that adds a flight or changes some on purpose.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

from golden_flights import flown


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("tiltproof", type=pathlib.Path)
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("--board", type=pathlib.Path)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    golden = arguments.source.resolve() / "tests/golden/flights.json"
    part = "board" if arguments.board else "host"

    if arguments.board:
        flights = flown(arguments.board)
    else:
        with tempfile.TemporaryDirectory(prefix="tiltproof-golden-") as folder:
            done = subprocess.run([arguments.tiltproof.resolve(), "run", arguments.source.resolve() / "scenarios", "--no-progress", "--no-report", "-j",
                                   str(os.cpu_count())], capture_output=True, text=True, cwd=folder, timeout=600, check=False)
            if done.returncode != 0:
                sys.exit(done.stdout + done.stderr)
            flights = flown(pathlib.Path(folder) / "results/latest")

    expected = json.loads(golden.read_text()) if golden.exists() else {}
    if arguments.write:
        expected[part] = dict(sorted(flights.items()))
        golden.write_text(json.dumps(dict(sorted(expected.items(), reverse=True)), indent=2) + "\n")
        return
    differing = sorted(name for name in flights.keys() | expected[part].keys() if flights.get(name) != expected[part].get(name))
    for name in differing:
        print(f"{name}: expected {expected[part].get(name, 'no such flight')}, flown {flights.get(name, 'not at all')}")
    sys.exit(f"{len(differing)} of {len(flights)} flights differ from {golden}" if differing else 0)


if __name__ == "__main__":
    main()
