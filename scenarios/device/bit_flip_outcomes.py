#!/usr/bin/env python3
"""What became of a firmware whose memory was flipped: counts the outcomes of a campaign's flights against a flight without a flip.

    tiltproof run scenarios/device/bit-flip-golden.yaml --client qemu --out golden
    tiltproof run scenarios/device/bit-flip-campaign.yaml --client qemu --repeat 200 -j 2 --out campaign
    scenarios/device/bit_flip_outcomes.py golden/latest campaign/latest

crash         the processor locked up, or the emulator gave it up
hang          it neither slept nor sent anything, or sent no more actuators until the flight's end, and nothing noticed
detected      the firmware noticed: it restarted, by its own fault handler or its watchdog, or entered its fail-safe state
wrong output  it commanded something else, and nothing noticed
masked        every command is that of the flight without a flip

Each flight is in the first of these classes that fits.
"""
import collections
import csv
import json
import pathlib
import sys

CLASSES = ["crash", "hang", "detected", "wrong output", "masked"]
# Commands come every 12 ms; so long without one, at the end, is no restart under way.
SILENT_S = 0.5


def commands(flight):
    """(t_s, the commanded inputs) of every row."""
    with open(flight / "trace.csv", newline="") as file:
        reader = csv.reader(file)
        header = next(reader)
        columns = [i for i, name in enumerate(header) if name.startswith("commanded_")]
        return [(float(row[0]), tuple(row[i] for i in columns)) for row in reader]


def outcome(flight, result, events, golden):
    reason = json.dumps({key: value for key, value in result.items() if key not in ("replay", "metrics")})
    if "the firmware crashed" in reason:
        return "crash"
    if "the firmware hangs" in reason:
        return "hang"
    rows = commands(flight)
    if any(event["kind"] == "device_reset" for event in events) or result["metrics"].get("firmware.failsafe_entered_count", 0) > 0:
        return "detected"
    if any(event["kind"] == "rejected" and event["text"].startswith("to_plant") for event in events):
        return "wrong output"  # so wrong that the server did not take it
    last_change = max((t for (t, now), (_, before) in zip(rows[1:], rows) if now != before), default=0)
    if rows[-1][0] - last_change > SILENT_S:
        return "hang"
    return "masked" if rows == golden else "wrong output"


def main():
    golden_run, campaign = (pathlib.Path(argument) for argument in sys.argv[1:3])
    [golden_name] = [s["name"] for s in json.loads((golden_run / "results.json").read_text())["scenarios"]]
    golden = commands(golden_run / golden_name)
    events = collections.defaultdict(list)
    for line in (campaign / "events.jsonl").read_text().splitlines():
        event = json.loads(line)
        events[event["scenario"]].append(event)
    counts = collections.Counter()
    verdicts = collections.defaultdict(collections.Counter)
    for result in json.loads((campaign / "results.json").read_text())["scenarios"]:
        name = result["name"]
        found = outcome(campaign / name, result, events[name], golden)
        counts[found] += 1
        verdicts[found][result["verdict"]] += 1
        if found != "masked":
            [flip] = [event for event in events[name] if event["kind"] == "bit_flipped"][:1] or [None]
            print(f"{name}: {found}, {result['verdict']}" + (f"; {flip['text']} at {flip['time_s']:.3f} s" if flip else ""))
    print("\n| outcome | flights | of these passed |\n|---|---|---|")
    for name in CLASSES:
        print(f"| {name} | {counts[name]} | {verdicts[name]['pass']} |")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main()
