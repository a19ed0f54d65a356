#!/usr/bin/env python3
"""Computes the figures of a campaign.json again, from its campaign.sqlite, by other means. Usage: campaign_oracle.py FOLDER

Prints every difference; exit 1 if there is one. Wilson's interval is found by bisection of its definition: a share is in
it when the observed one is within 1.96 standard deviations of it.
"""
import json
import math
import pathlib
import sqlite3
import sys

Z = 1.959963984540054
problems = []


def same(name, found, expected):
    near = isinstance(found, float) and isinstance(expected, float) and math.isclose(found, expected, abs_tol=1e-9)
    if found != expected and not near:
        problems.append(f"{name}: {found!r} instead of {expected!r}")


def bisect(inside, outside, holds):
    for _ in range(200):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside


def check_rate(name, rate, passed, failed):
    same(f"{name} passed", rate["passed"], passed)
    same(f"{name} failed", rate["failed"], failed)
    n = passed + failed
    same(f"{name} flights", rate["flights"], n)
    if n == 0:
        return same(f"{name} rate", (rate["rate"], rate["low"], rate["high"]), (None, None, None))
    share = passed / n
    same(f"{name} rate", float(rate["rate"]), share)
    holds = lambda p: abs(share - p) <= Z * math.sqrt(p * (1 - p) / n) + 1e-15
    same(f"{name} low", float(rate["low"]), 0.0 if passed == 0 else bisect(share, 0.0, holds))
    same(f"{name} high", float(rate["high"]), 1.0 if failed == 0 else bisect(share, 1.0, holds))


folder = pathlib.Path(sys.argv[1])
summary = json.loads((folder / "campaign.json").read_text())
db = sqlite3.connect(folder / "campaign.sqlite")
frame = json.loads(db.execute("select value from meta where key = 'frame'").fetchone()[0])


def count(condition, *values):
    return [db.execute(f"select count(*) from run where verdict = ? and {condition}", (verdict, *values)).fetchone()[0] for verdict in ("pass", "fail")]


check_rate("all", summary, *count("1"))
same("flown", summary["flown"], db.execute("select count(*) from run").fetchone()[0])
for verdict, key in (("error", "errors"), ("inconclusive", "inconclusive")):
    same(key, summary[key], db.execute("select count(*) from run where verdict = ?", (verdict,)).fetchone()[0])
for column in ("firmware", "scenario"):
    for rate in summary[f"by_{column}"]:
        check_rate(rate["name"], rate, *count(f"{column} = ?", rate["name"]))

# The band of a fault: how many inner ends it is beyond.
levels = {}
for each in frame["ranges"]:
    levels.setdefault((each["type"], each["place"]), []).append(each["levels"])


def band(type, place, severity):
    sides = levels[type, place or ""]
    if not sides[0]:
        return 0
    # A severity with two sides has a range on each: the one of the severity's sign, as seen from the mildest level.
    ends = next((one for one in sides if (severity - one[0]) * (one[-1] - one[0]) >= 0), sides[0])
    return sum(severity > end if ends[-1] > ends[0] else severity < end for end in ends[1:-1])


db.create_function("band", 3, band)
db.create_function("phase", 2, lambda scenario, start_s: max(0, min(3, math.floor(4 * start_s / frame["durations_s"][scenario]))))
types = {rate["type"]: rate for rate in summary["by_type"]}
same("types", set(types), {r["type"] for r in frame["ranges"]} | {t for (t,) in db.execute("select distinct type from fault")})
for name, rate in types.items():
    check_rate(name, rate, *count("number in (select run from fault where type = ?)", name))
    same(f"{name} drawn", rate["drawn"], db.execute("select count(*) from fault where type = ?", (name,)).fetchone()[0])
    same(f"{name} activated", rate["activated"], db.execute("select count(*) from fault where type = ? and activations > 0", (name,)).fetchone()[0])
    for own in rate["bands"]:
        check_rate(f"{name} band {own['band']}", own, *count("number in (select run from fault where type = ? and band(type, place, severity) = ?)", name, own["band"]))
for rate in summary["by_severity"]:
    check_rate(f"band {rate['band']}", rate, *count("number in (select run from fault where band(type, place, severity) = ?)", rate["band"]))

cells = lambda condition: db.execute(f"select count(*) from (select distinct type, place, phase(run.scenario, start_s), band(type, place, severity) from fault join run on run.number = fault.run where {condition})").fetchone()[0]
same("cells", summary["coverage"]["cells"], sum(4 * (4 if sides[0] else 1) for sides in levels.values()))
same("drawn cells", summary["coverage"]["drawn"], cells("1"))
same("covered cells", summary["coverage"]["covered"], cells("activations > 0"))
for row in summary["coverage"]["rows"]:
    for phase, line in enumerate(row["cells"]):
        for own, found in enumerate(line):
            same(f"{row['type']} {row['place']} {phase} {own}", found, db.execute("select count(*) from fault join run on run.number = fault.run where type = ? and coalesce(place, '') = ? and activations > 0 and phase(run.scenario, start_s) = ? and band(type, place, severity) = ?", (row["type"], row["place"], phase, own)).fetchone()[0])

# Failures by final signature.
finals = dict(db.execute("select run, signature from failure"))
groups, curve = {}, []
for flown, (number, first) in enumerate(db.execute("select number, signature from run order by number"), 1):
    if first:
        runs = groups.setdefault(finals.get(number, first), [])
        if not runs:
            curve.append([flown, len(groups)])
        runs.append(number)
if curve and curve[-1][0] < flown or not curve:
    curve.append([flown, len(groups)])
same("curve", summary["curve"], curve)
same("signatures", summary["signatures"], len(groups))
same("order", [g["signature"] for g in summary["failures"]], sorted(groups, key=lambda s: (-len(groups[s]), s)))
for group in summary["failures"]:
    runs = groups[group["signature"]]
    same(group["signature"], (group["flights"], group["first_run"], group["runs"]), (len(runs), runs[0], runs[:20]))
    same(f"minimal of {group['signature']}", group.get("minimal"), next((m for r, m in db.execute("select run, minimal from failure where signature = ? and minimal is not null order by run", (group["signature"],))), None))
print("\n".join(problems))
sys.exit(bool(problems))
