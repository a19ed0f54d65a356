#!/usr/bin/env python3
"""What viewers of the live page cost a flight in real time: paper-hover with 0, 1 and 20 curls that read, and with one that stands
still. Prints a table for docs/live.md. Usage: live_viewers.py TILTPROOF SOURCE_DIR [REPEATS]"""
import json
import os
import pathlib
import re
import signal
import statistics
import subprocess
import sys
import tempfile

PROGRAM, SOURCE = (pathlib.Path(part).resolve() for part in sys.argv[1:3])
REPEATS = int(sys.argv[3]) if len(sys.argv) > 3 else 3
COLUMNS = ("timing.harness_overrun_count", "timing.harness_late_max_ms", "timing.request_period_p50_ms", "timing.request_period_p99_ms",
           "timing.request_period_p999_ms", "timing.request_period_max_ms")
# Name, viewers that read, viewers that stand still, with a live page.
CASES = (("no live page", 0, 0, False), ("0", 0, 0, True), ("1", 1, 0, True), ("20", 20, 0, True), ("20, and 1 stopped", 20, 1, True))


def fly(folder, reading, stopped, live):
    """The metrics of a flight, and its verdict."""
    run = subprocess.Popen([PROGRAM, "run", SOURCE / "scenarios/paper", "-k", "paper-hover", "--mode", "realtime", "--no-progress", "--no-report", "--out", folder,
                            *(["--live", "0"] if live else [])], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    viewers = []
    if live:
        for line in run.stderr:
            if found := re.search(r"http://127\.0\.0\.1:\d+/", line):
                break
        curl = ["curl", "-sN", found.group(0) + "events"]
        viewers = [subprocess.Popen(curl, stdout=subprocess.DEVNULL) for _ in range(reading)]
        for _ in range(stopped):
            viewers.append(subprocess.Popen(curl, stdout=subprocess.PIPE))
            # Connected, it reads nothing any more.
            viewers[-1].stdout.read(1)
            os.kill(viewers[-1].pid, signal.SIGSTOP)
    run.stderr.read()
    run.wait()
    for viewer in viewers:
        viewer.kill()
        viewer.wait()
    (flight,) = json.loads((folder / "latest/results.json").read_text())["scenarios"]
    return flight["metrics"], flight["verdict"]


def main():
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors; median of {REPEATS}, in () the worst\n")
    print("| viewers | verdicts | overruns | late at most (ms) | period p50 | p99 | p99.9 | max (ms) |\n|---|---|---:|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory(prefix="tiltproof-viewers-") as name:
        flights = {case[0]: [] for case in CASES}
        # One case after the other, again and again: what else the machine does meets all of them.
        for _ in range(REPEATS):
            for case, *how in CASES:
                flights[case].append(fly(pathlib.Path(name), *how))
        for case, flown in flights.items():
            cells = []
            for column in COLUMNS:
                values = [metrics.get(column, float("nan")) for metrics, _ in flown]
                cells.append(f"{statistics.median(values):.4g} ({max(values):.4g})")
            print(f"| {case} | {', '.join(verdict for _, verdict in flown)} | " + " | ".join(cells) + " |")
    print(f"\nload after: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
