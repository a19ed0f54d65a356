#!/usr/bin/env python3
"""Flies levels that the first firmware of an envelope survives with seeds that the envelope did not have, and reports where the second one fails.

A level counts if the first one survives it with all these seeds as well. For each row in which anything is random it flies the most severe level that
the first one survives, and others of its levels, drawn at random. Its results are in further.json beside the envelope, which tables.py reads.
After an interruption it goes on.

Usage, at the top of the repository:
  scenarios/envelope/further_seeds.py build/release/tiltproof scenarios/envelope/spiral.yaml results/survival/spiral/envelope.json -j 2

Exits 1 when there is such a level, and 3 when one could not be flown.
"""
import argparse
import json
import pathlib
import random
import sys

import spot_check

LEVELS = 8


def pairs(envelope):
    """The rows of both firmwares at the same place, where something is random and the first one survives something, by name."""
    first, second = envelope["clients"]
    rows = {(spot_check.name_of(row), row["client"]): row for row in envelope["rows"] if "error" not in row and row["seeds"] > 1}
    both = {name: (rows[name, first], rows[name, second]) for name, client in rows if client == first and (name, second) in rows}
    return {name: pair for name, pair in both.items() if any(survived for _, survived in pair[0]["levels"])}


def levels_of(row, rng):
    """The most severe level that is survived, and some of the others, in order."""
    survived = sorted((level for level, passed in row["levels"] if passed), reverse=row["severest"] > row["mildest"])
    return sorted([survived[0], *rng.sample(survived[1:], min(LEVELS - 1, len(survived) - 1))])


def worse_levels(options, base, examples, pair, rng):
    """The levels that the first one survives and the second one does not, each with the number of its flights that fail. None: one could not be flown."""
    first, second = pair
    flights = spot_check.fly(options, base, examples, second, levels_of(first, rng))
    failed = spot_check.failures(flights or [])
    # Only these levels can be worse, so only these need the first firmware's flights.
    others = spot_check.fly(options, base, examples, first, list(failed)) if failed else []
    if flights is None or others is None:
        return None
    return {level: count for level, count in failed.items() if level not in spot_check.failures(others)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("scenario", type=pathlib.Path, help="that of the envelope")
    parser.add_argument("envelope", type=pathlib.Path, help="its envelope.json")
    parser.add_argument("-j", dest="jobs", type=int, default=1)
    options = parser.parse_args()
    base, examples = spot_check.base_of(options.scenario), spot_check.Examples(options.program)
    envelope = json.loads(options.envelope.read_text())
    rows = pairs(envelope)
    file = options.envelope.with_name("further.json")
    known = json.loads(file.read_text())["rows"] if file.exists() else {}
    flown, code = {name: known[name] for name in rows if name in known}, 0
    for name, pair in rows.items():
        if name in flown:
            continue
        less = worse_levels(options, base, examples, pair, random.Random(name))
        if less is None:
            code = 3
            print(f"{name}: could not be flown", flush=True)
            continue
        flown[name] = {"less_at": list(less)}
        file.write_text(json.dumps({"first_seed": spot_check.FIRST_SEED, "seeds": spot_check.SEEDS, "levels": LEVELS, "rows": flown}, indent=1) + "\n")
        if less:
            text = ", ".join(f"{count} at {level:.4g}" for level, count in less.items())
            print(f"{name}: {pair[0]['client']} survives, and {pair[1]['client']} fails {text}", flush=True)
    worse = sum(bool(row["less_at"]) for row in flown.values())
    print(f"{worse} of {len(rows)} rows have a level that {envelope['clients'][0]} survives and {envelope['clients'][1]} does not")
    return code or (1 if worse else 0)


if __name__ == "__main__":
    sys.exit(main())
