#!/usr/bin/env python3
"""Figures of flights over three hosts with 1 % loss and 5 ms delay between them, as in hosts_test.py.

Usage: measure.py TILTPROOF SCENARIO [--starts N] [--loss P] [--delay MS]

Flies N flights of one second, for the time from the harness's start to that of the flight; then the scenario once.
"""
import argparse
import math
import pathlib
import tempfile

import network
from fleet import Fleet

SHORT = """\
name: short
duration_s: 1
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: upright, stl: "always(abs(roll_rad) <= 0.6)"}
"""
MARGIN_S = 60


def quantile(values, share):
    """By nearest rank, as in results.json."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)]


def summary(name, values, unit):
    print(f"{name}: p50 {quantile(values, 0.5):.3f} p99 {quantile(values, 0.99):.3f} max {max(values):.3f} {unit} (n = {len(values)})")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=lambda path: pathlib.Path(path).resolve())
    parser.add_argument("scenario", type=pathlib.Path)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--loss", type=float, default=0.01)
    parser.add_argument("--delay", type=float, default=5)
    options = parser.parse_args()
    scenario = options.scenario.read_text()
    network.isolate()
    with tempfile.TemporaryDirectory(prefix="tiltproof-hosts-") as folder:
        fleet = Fleet(options.program, pathlib.Path(folder), seed=1)
        try:
            fleet.network.set(loss=options.loss, delay_ms=options.delay)
            fleet.start()
            found, started, verdicts = [], [], {}
            for _ in range(options.starts):
                with fleet.flight(SHORT) as flight:
                    found.append(flight.wait_for("here harness-"))
                    started.append(flight.wait_for("running"))
                    verdict = flight.finish(MARGIN_S).verdict
                    verdicts[verdict] = verdicts.get(verdict, 0) + 1
            if started:
                summary("harness started to seen by the third host", found, "s")
                summary("harness started to t = 0", started, "s")
                print("verdicts:", verdicts)
            with fleet.flight(scenario) as flight:
                flight.wait_for("running")
                results = flight.finish(3600)
            print(f"{results.scenario['name']}: {results.verdict} {results.reason}, {len(results.row_times_s())} rows")
            for name, value in results.metrics.items():
                if name.startswith(("timing.", "tracking.", "link.")):
                    print(f"  {name} {value:g}")
            for link, counters in fleet.network.set().items():
                print(f"  hub {link}: {counters}")
        finally:
            fleet.close()


if __name__ == "__main__":
    main()
