#!/usr/bin/env python3
"""What each build of the firmware survives, as tables: docs/survival.md, and the short one in README.md.

Usage, at the top of the repository:
  scenarios/envelope/tables.py --fly build/release/tiltproof -j 2   fly both envelopes (hours apart is fine: it goes on), then write
  scenarios/envelope/tables.py                                      write the tables from what has been flown

Also prints how many types are survived at least twice as severely, by layer, and every row in which the second firmware is worse than
the first by more than the search's tolerance: then it exits 1.
"""
import argparse
import json
import math
import pathlib
import subprocess
import sys
import textwrap

HERE = pathlib.Path(__file__).resolve().parent
SOURCE = HERE.parent.parent
SCENARIOS = ("spiral", "spiral-other-vehicle")
# Of each: with noise every flight is another one, so that each step of the search takes longer.
TITLES = ("the vehicle that it knows, no noise", "another vehicle, noise on all sensors")
REPEATS = (5, 5)
TOLERANCES = (0.01, 0.02)
MARK = "<!-- survival: scenarios/envelope/tables.py writes what is below -->"
END = "<!-- survival: end -->"
TWICE = 2.0


def place(row):
    return next((row[key] for key in ("target", "signal", "actuator") if key in row), "") + {"positive": "+", "negative": "-"}.get(row.get("side"), "")


def distance(row):
    """From the harmless value to the level that is survived; 0 for none, to the end of the range for all.

    Where the harmless value stands for infinity (a limit that falls from 1e6 to 0), a level's severity is its inverse.
    """
    level = row["severest"] if row["fails"] is None else row["survives"]
    if level is None:
        return 0.0
    if row["scale"] == "logarithmic" and row["severest"] < row["mildest"]:
        return 1 / level if level else math.inf
    return abs(level - (row["mildest"] if row["harmless"] is None else row["harmless"]))


def ratio(first, second):
    """How many times as far the second one goes. Equal is 1, also where neither survives anything."""
    a, b = distance(first), distance(second)
    if a == b:
        return 1.0
    return b / a if a else math.inf


def cell(row):
    if row is None:
        return "n/a"
    if "error" in row:
        return "error"
    if row["survives"] is None:
        return "none"
    return "all" if row["fails"] is None else f'{row["survives"]:.4g}'


def ratio_text(value):
    return "-" if value is None else "∞" if value == math.inf else f"{value:.3g}"


class Envelope:
    def __init__(self, file):
        self.data = json.loads(file.read_text())
        if not self.data["complete"]:
            print(f"tables: {file} is not complete", file=sys.stderr)
        self.clients = self.data["clients"]
        if len(self.clients) != 2:
            sys.exit(f"tables: {file} has {len(self.clients)} firmwares, and a ratio needs two")
        self.rows = {}
        for row in self.data["rows"]:
            self.rows.setdefault((row["type"], place(row)), {})[row["client"]] = row

    def pair(self, key):
        return [self.rows.get(key, {}).get(client) for client in self.clients]

    def ratio(self, key):
        pair = self.pair(key)
        return ratio(*pair) if all(row and "error" not in row for row in pair) else None


def reasons():
    """Why nothing could be better, by "type" or "type place"."""
    found = json.loads((HERE / "limits.json").read_text())
    return lambda key: found.get(" ".join(key).strip(), found.get(key[0], ""))


def whole_table(envelopes, order, why):
    names = [client for envelope in envelopes for client in envelope.clients]
    lines = ["| type | where | unit | " + " | ".join(f"{a} | {b} | ratio" for a, b in (e.clients for e in envelopes)) + " | why not more |",
             "|---|---|---|" + "---:|" * (len(names) + len(envelopes)) + "---|"]
    for key in order:
        unit = next(row["unit"] for e in envelopes for row in e.pair(key) if row)
        cells = [text for e in envelopes for text in (*map(cell, e.pair(key)), ratio_text(e.ratio(key)))]
        lines.append("| " + " | ".join([f"`{key[0]}`", key[1] or "-", unit or "-", *cells, why(key)]) + " |")
    return "\n".join(lines)


def layers_of(envelopes, order):
    """By layer: its types, those survived twice as severely at some place, and those where nothing is lost at any."""
    layers = {}
    for key in order:
        layers.setdefault(key[0].split(".")[0], {}).setdefault(key[0], []).append([e.ratio(key) for e in envelopes])
    return layers


def best(places, envelope):
    return max((ratios[envelope] for ratios in places if ratios[envelope] is not None), default=0)


def short_table(envelopes, layers):
    lines = ["| layer | types | " + " | ".join(f"twice as much: {title}" for title in TITLES[:len(envelopes)]) + " |",
             "|---|---:|" + "---:|" * len(envelopes)]
    for layer, types in layers.items():
        counts = [sum(best(places, i) >= TWICE for places in types.values()) for i in range(len(envelopes))]
        lines.append(f"| {layer} | {len(types)} | " + " | ".join(map(str, counts)) + " |")
    return "\n".join(lines)


def page(envelopes, order, layers, why):
    first = envelopes[0]
    old, new = first.clients
    seeds = " and ".join(dict.fromkeys(str(envelope.data["repeats"]) for envelope in envelopes))
    exact = " and ".join(f'{100 * envelope.data["tolerance"]:g} %' for envelope in envelopes)
    how = textwrap.fill(
        f"How severe each fault may be before `{old}` and `{new}` leave the path by 1 m or tilt by more than 0.6 rad, on the paper's spiral of 40 s "
        f"with the fault from 10 s to 15 s. Found by `tiltproof envelope` ([margins](margins.md)): {seeds} seeds at each level, exact to {exact} of "
        "the distance from harmless, for the left and the right half. `scenarios/envelope/tables.py` wrote this page; "
        "`scenarios/envelope/tables.py --fly build/release/tiltproof -j 2` flies it anew.", 108, break_on_hyphens=False)
    halves = textwrap.fill(
        f"The left half is {TITLES[0]}; the right half {TITLES[1]}: 2 % heavier, 10 % more inertia, 20 % more drag torque "
        "(`scenarios/envelope/spiral-other-vehicle.yaml`).", 108, break_on_hyphens=False)
    return f"""# What the firmware survives

{how}

{halves}

`none`: the mildest level failed. `all`: the most severe level was survived. `ratio`: how many times as far
from the harmless value `{new}` goes; for a limit that falls from infinity, the inverse levels count.

{short_table(envelopes, layers)}

"Twice as much" counts the types that `{new}` survives at least twice as severely at some place.

{whole_table(envelopes, order, why)}
"""


def write_block(file, text):
    """Between the marks; their lines stay."""
    before, begin, rest = file.read_text().partition(MARK)
    _, end, after = rest.partition(END)
    if not begin or not end:
        sys.exit(f"tables: {file} lacks the lines {MARK} and {END}")
    file.write_text(f"{before}{MARK}\n{text}\n{END}{after}")


def fly(options):
    for scenario, repeats, tolerance in zip(SCENARIOS, REPEATS, TOLERANCES):
        out = options.out / scenario
        where = "--resume" if (out / "envelope.json").exists() else "--out"
        command = [options.fly, "envelope", HERE / f"{scenario}.yaml", "--firmware", options.firmware, where, out, "-j", str(options.jobs),
                   "--repeats", str(options.repeats or repeats), "--tolerance", str(options.tolerance or tolerance)]
        if options.types:
            command += ["--types", options.types]
        done = subprocess.run(list(map(str, command)), check=False).returncode
        if done != 0:
            sys.exit(done)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fly", type=pathlib.Path, help="the program; without it, what has been flown counts")
    parser.add_argument("--firmware", default="paper,tolerant", help="two builds, the reference first")
    parser.add_argument("--types", help="only these types, as in `tiltproof envelope`")
    parser.add_argument("--repeats", type=int, help="seeds at each level, for both")
    parser.add_argument("--tolerance", type=float, help="of the search, for both")
    parser.add_argument("-j", dest="jobs", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("results/survival"), help="where the envelopes are")
    parser.add_argument("--page", type=pathlib.Path, default=SOURCE / "docs/survival.md")
    parser.add_argument("--readme", type=pathlib.Path, default=SOURCE / "README.md")
    options = parser.parse_args()
    if options.fly:
        fly(options)
    envelopes = [Envelope(options.out / scenario / "envelope.json") for scenario in SCENARIOS]
    order = list(dict.fromkeys(key for envelope in envelopes for key in envelope.rows))
    layers = layers_of(envelopes, order)
    options.page.write_text(page(envelopes, order, layers, reasons()))
    write_block(options.readme, "\n" + short_table(envelopes, layers) + "\n")

    types = [places for layer in layers.values() for places in layer.values()]
    worse = 0
    for i, envelope in enumerate(envelopes):
        twice = [sum(best(places, i) >= TWICE for places in layer.values()) for layer in layers.values()]
        print(f"{TITLES[i]}: {sum(twice)} of {len(types)} types survived at least twice as severely; by layer: "
              + ", ".join(f"{name} {count} of {len(layers[name])}" for name, count in zip(layers, twice)))
        for key in order:
            value = envelope.ratio(key)
            if value is not None and value < 1 - envelope.data["tolerance"]:
                worse += 1
                print(f"  worse: {' '.join(key).strip()}: {' and '.join(map(cell, envelope.pair(key)))}, {value:.3g} times as far")
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
