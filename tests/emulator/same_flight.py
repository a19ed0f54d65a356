"""An image flies as the library of the same firmware does, to the bit.

    moved = earlier(text, 8, duration_s=9)     # a scenario file's text: its faults come 8 s earlier
    rows = motion(folder / "flight/trace.csv")
"""
import csv
import re


def earlier(scenario, by_s, duration_s):
    """The scenario with its faults' windows `by_s` earlier and this duration. Criteria have windows of their own: there is one, which always holds."""
    def moved(match):
        return f"{match[1]}{round(float(match[2]) - by_s, 6):g}"

    text, count = re.subn(r"((?:start|end)_s: )([\d.]+)", moved, scenario)
    if count == 0:
        raise AssertionError("no fault has a window")
    text = re.sub(r"^duration_s: .*$", f"duration_s: {duration_s}", text, flags=re.MULTILINE)
    return re.sub(r"^criteria:\n.*?(?=^\w|\Z)", 'criteria:\n  - {name: flies, stl: "eventually(position_error_m >= 0)"}\n', text, flags=re.MULTILINE | re.DOTALL)


def motion(trace):
    """The rows of a trace: what the vehicle does and is commanded. Counters depend on when in a period a frame is on its way."""
    with open(trace, newline="") as file:
        return [{name: text for name, text in row.items() if not name.endswith("_count") and name != "supervisor_state"} for row in csv.DictReader(file)]
