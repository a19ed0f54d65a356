#!/usr/bin/env python3
"""Flies random levels below the limits of an envelope, with seeds that the envelope did not have, and reports those that fail.

It is independent of the search: it writes scenarios of its own, from the example that `tiltproof faults` gives for each type.

Usage, at the top of the repository:
  scenarios/envelope/spot_check.py build/release/tiltproof scenarios/envelope/spiral.yaml results/survival/spiral/envelope.json --rows 20 --seed 42 -j 2

Exits 1 when a level below a limit fails, and 3 when one could not be flown.
"""
import argparse
import collections
import json
import pathlib
import random
import re
import subprocess
import sys
import tempfile

PROBE = re.compile(r"(?m)^  - \{id: \w+, type: harness\.null, start_s: ([\d.]+), end_s: ([\d.]+)\}$")
LEAST_S = 0.004
LEVELS = 10
SEEDS, FIRST_SEED = 20, 9001
# A level goes down to this part of the limit, on a logarithmic scale.
LEAST_SHARE = 1e-3


def levels_below(row, rng):
    """Random levels on the row's scale, from harmless to its limit."""
    limit = row["severest"] if row["fails"] is None else row["survives"]
    harmless = row["mildest"] if row["harmless"] is None else row["harmless"]
    shares = [rng.random() for _ in range(LEVELS)]
    if row["scale"] == "linear":
        return [harmless + (limit - harmless) * share for share in shares]
    if row["severest"] < row["mildest"] and harmless > 0:  # it falls from a number that stands for infinity
        least = max(limit, 1e-6 * row["mildest"])
        return [least * (row["mildest"] / least) ** share for share in shares]
    return [harmless + (limit - harmless) * LEAST_SHARE ** (1 - share) for share in shares]


class Examples:
    """The example of each type as the catalogue gives it: one item of a list of faults."""

    def __init__(self, program):
        self.program, self.known = program, {}

    def text(self, name):
        if name not in self.known:
            text = subprocess.run([self.program, "faults", name], capture_output=True, text=True, check=True).stdout
            self.known[name] = re.search(r"```yaml\n(- .*?)\n```", text, re.DOTALL)[1]
        return self.known[name]


def with_value(text, key, value):
    """The item with this value; the key is added where it is missing."""
    changed, count = re.subn(rf"\b{key}: [^,{{}}\s]+", f"{key}: {value}", text, count=1)
    return changed if count else re.sub(r"(type: [\w.]+)", rf"\1, {key}: {value}", text, count=1)


def scenario_at(base, name, row, level, example):
    """The text of the scenario with this fault in place of the one that does nothing."""
    begin, end = PROBE.search(base).groups()
    fault = with_value(with_value(example, "id", "probe"), "start_s", begin)
    if row["parameter"] == "window_s":
        fault = with_value(fault, "end_s", f"{float(begin) + max(level, LEAST_S):.6f}")
    else:
        fault = with_value(with_value(fault, "end_s", end), row["parameter"], f"{level:.6g}")
    for key in ("target", "signal", "actuator"):
        if key in row:
            fault = with_value(fault, key, row[key])
    fault = "".join(f"  {line}\n" for line in fault.splitlines()).rstrip("\n")
    return re.sub(r"(?m)^name: .*$", f"name: {name}", PROBE.sub(lambda _: fault, base), count=1)


def fly(options, base, examples, row, levels):
    """The flights of this row at these levels, with seeds that the search did not have: (level, seed, verdict) of each. None: one could not be flown."""
    with tempfile.TemporaryDirectory(prefix="tiltproof-spot-") as folder:
        for i, level in enumerate(levels):
            (pathlib.Path(folder) / f"level-{i}.yaml").write_text(scenario_at(base, f"level-{i}", row, level, examples.text(row["type"])))
        command = [options.program, "run", folder, "--firmware", row["client"], "-j", options.jobs, "--format", "jsonl", "--no-progress", "--keep", "verdicts",
                   "--out", f"{folder}/results"]
        if row["seeds"] > 1:
            command += ["--seed", FIRST_SEED, "--repeat", SEEDS]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    flights = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    if not flights or any(flight["verdict"] == "error" for flight in flights):
        print((done.stderr or done.stdout)[-2000:], file=sys.stderr)
        return None
    return [(levels[int(re.match(r"level-(\d+)", flight["name"])[1])], flight["seed"], flight["verdict"]) for flight in flights]


def failures(flights):
    """The levels that fail, in order, each with the number of its flights that did."""
    return dict(sorted(collections.Counter(level for level, _, verdict in flights if verdict == "fail").items()))


def base_of(scenario):
    """The text of an envelope's scenario, for a file in any folder."""
    base = re.sub(r"(?m)^model: (\S+\.sdf)$", lambda found: f"model: {(scenario.parent / found[1]).resolve()}", scenario.read_text())
    if not PROBE.search(base):
        sys.exit(f"{scenario} has no fault of type harness.null in one line")
    return base


def name_of(row):
    return " ".join(filter(None, [row["type"], row.get("target") or row.get("signal") or row.get("actuator"), row.get("side")]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("scenario", type=pathlib.Path, help="that of the envelope")
    parser.add_argument("envelope", type=pathlib.Path, help="its envelope.json")
    parser.add_argument("--rows", type=int, default=20, help="so many, drawn at random")
    parser.add_argument("--seed", type=int, default=1, help="of rows and levels")
    parser.add_argument("-j", dest="jobs", type=int, default=1)
    options = parser.parse_args()
    envelope = json.loads(options.envelope.read_text())
    base = base_of(options.scenario)
    rng = random.Random(options.seed)
    rows = [row for row in envelope["rows"] if "error" not in row and row["survives"] is not None]
    examples, code, broken, flown = Examples(options.program), 0, 0, 0
    for row in rng.sample(rows, min(options.rows, len(rows))):
        name = f"{name_of(row)} of {row['client']}"
        flights = fly(options, base, examples, row, levels_below(row, rng))
        if flights is None:
            code = 3
            print(f"{name}: could not be flown", flush=True)
            continue
        flown += len(flights)
        failed = failures(flights)
        broken += bool(failed)
        text = ", ".join(f"{count} at {level:.4g}" for level, count in failed.items()) or "none"
        print(f"{name}: of {len(flights)} flights below the limit, failed: {text}", flush=True)
    print(f"{broken} of {min(options.rows, len(rows))} rows fail below their limit, in {flown} flights")
    return code or (1 if broken else 0)


if __name__ == "__main__":
    sys.exit(main())
