#!/usr/bin/env python3
"""Measures which severity of a fault in one board a vehicle with one, two and three boards survives.

Usage: scenarios/redundancy/what_it_buys.py TILTPROOF [--write PAGE] [-j N]

Flies `tiltproof margin` for every fault and number of boards, and prints the table of docs/redundancy.md. --write puts it into
the page, between its markers. The fault acts on board `a`, which flies first. It begins at 3 s and lasts to the end, except
where its length is the severity.
"""
import argparse
import json
import pathlib
import subprocess
import tempfile

BEGIN, END = "<!-- what it buys: scenarios/redundancy/what_it_buys.py writes what is below -->", "<!-- what it buys: end -->"

BOARDS = {
    "one": ("tolerant", "a", "", "{type: single, client: a}"),
    "two": ("failover", "ab", "lines: [{id: cross, between: [a, b]}]", "{type: active_claims, timeout_ms: 36}"),
    "three": ("triplex", "abc", "lines: [{id: ab, between: [a, b]}, {id: ac, between: [a, c]}, {id: bc, between: [b, c]}]",
              "{type: mid_value, timeout_ms: 36}"),
}
# What, the fault, its severity and unit.
FAULTS = [
    ("resets, and boots for", "type: device.reset, parameters: {boot_ms: 100}", "ms"),
    ("is not heard by the vehicle for", "type: link.silence, target: to_plant, end_s: 4", "s"),
    ("hears nothing for", "type: link.silence, target: to_client, end_s: 4", "s"),
    ("loses a share of its frames", "type: frame.drop, target: both, parameters: {probability: 0.5}", ""),
    ("gets replies late by", "type: frame.delay, target: to_client, parameters: {mean_ms: 10}", "ms"),
    ("is told a wrong height by", "type: sensor.bias, parameters: {signal: z_m, offset: 0.5}", "m"),
    ("is told a wrong pitch angle by", "type: sensor.bias, parameters: {signal: pitch_rad, offset: 0.1}", "rad"),
    ("is told a wrong roll rate by", "type: sensor.bias, parameters: {signal: wx_rad_s, offset: 0.1}", "rad/s"),
]
SCENARIO = """name: boards-{boards}
firmware: {build}
seed: 12
duration_s: 12
reference: {{type: spiral, time_s: 60}}
clients: [{clients}]
{lines}
arbiter: {arbiter}
faults:
  - {{id: fault, client: a, start_s: 3, {fault}}}
criteria:
  - {{name: stays-on-path, stl: "always[2,12](position_error_m <= 1.0)"}}
"""


def margin(tiltproof, folder, boards, fault, unit, jobs):
    build, ids, lines, arbiter = BOARDS[boards]
    file = pathlib.Path(folder) / f"boards-{boards}.yaml"
    file.write_text(SCENARIO.format(boards=boards, build=build, clients=", ".join(f"{{id: {one}}}" for one in ids), lines=lines,
                                    arbiter=arbiter, fault=fault))
    done = subprocess.run([tiltproof, "margin", file, "--fault", "fault", "--repeats", "1", "--tolerance", "0.05", "-j", str(jobs),
                           "--format", "jsonl"], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{boards}: {fault}: {done.stderr or done.stdout}")
    found = json.loads(done.stdout.splitlines()[-1])
    # A level above the limit may be survived again; what counts is the first that is not.
    if found.get("fails") is None:
        return "all"
    if found.get("survives") is None:
        return "none"
    return f"{found['survives']:.3g} {unit}".strip()


def table(tiltproof, jobs):
    rows = ["| board `a` | " + " | ".join(BOARDS) + " |", "|---|" + "---:|" * len(BOARDS)]
    with tempfile.TemporaryDirectory() as folder:
        for what, fault, unit in FAULTS:
            rows.append(f"| {what} | " + " | ".join(margin(tiltproof, folder, boards, fault, unit, jobs) for boards in BOARDS) + " |")
            print(rows[-1], flush=True)
    return "\n".join(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tiltproof")
    parser.add_argument("--write", type=pathlib.Path, metavar="PAGE")
    parser.add_argument("-j", type=int, default=1)
    arguments = parser.parse_args()
    text = table(arguments.tiltproof, arguments.j)
    if arguments.write:
        page = arguments.write.read_text()
        before, rest = page.split(BEGIN)
        arguments.write.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}")


if __name__ == "__main__":
    main()
