#!/usr/bin/env python3
"""What each build of the firmware survives, as tables: docs/survival.md, and the short one in README.md.

Usage, at the top of the repository:
  scenarios/envelope/tables.py --fly build/release/tiltproof -j 2   fly both envelopes type by type, write after each; after an interruption it goes on
  ... --types 'actuator.*,plant.*' --out results/actuators          fly these types only; all other rows of the page stay as they are
  scenarios/envelope/tables.py                                      write the tables from what has been flown, and from the page

Exits 1, and says so, when the second firmware is worse than the first in a row: by more than the search's tolerance, or at a level beyond its limit
that the first one survives; when a row in which it is not twice as good, and does not survive everything, has no reason in limits.json; and when a type of the catalogue is not on the page.
Exits 4 when a flight could not be judged.
"""
import argparse
import fnmatch
import json
import math
import pathlib
import re
import subprocess
import sys
import textwrap

import further_seeds
import spot_check

HERE = pathlib.Path(__file__).resolve().parent
SOURCE = HERE.parent.parent
SCENARIOS = ("spiral", "spiral-other-vehicle")
TITLES = ("known vehicle, no noise", "another vehicle, noise on all sensors")
# Seeds with which nothing was tuned: those of scenarios and tests are smaller.
SEED = 5001
REPEATS = 20
# Of each: with noise every flight is another one, so that each step of the search takes longer.
TOLERANCES = (0.01, 0.02)
# A flight on the emulated board takes as long as fifty on the host.
BOARD_REPEATS = 2
BOARD_TOLERANCE = 0.2
# What the host's envelope cannot take, another one may: of the vehicle with drag, then on the board. Each part has a mark on the page.
PARTS = {"": "", "-drag": "‡", "-board": "†"}
MARK = "<!-- survival: scenarios/envelope/tables.py writes what is below -->"
END = "<!-- survival: end -->"
TWICE = 2.0
NO_MARGIN = "n/a"
NEVER = "never acted"
POCKETS = "\\*"
EXACT = "°"


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
    """The level, with a mark where a more severe one is survived again and one where nothing is drawn at random, and the share of the range."""
    if row is None:
        return NO_MARGIN
    if "error" in row:
        return NEVER if row["levels"] and len(row.get("idle_levels", [])) == len(row["levels"]) else "error"
    sure = EXACT if row["seeds"] == 1 else ""
    if row["survives"] is None:
        return "none"
    if row["fails"] is None:
        return f"all{sure}"
    return f'{row["survives"]:.4g}{POCKETS if row["pockets"] else ""}{sure} ({100 * row["survived_share"]:.0f} %)'


def less_at(first, second):
    """Where the second fails, between levels that fail as well, and the first survives: texts of levels."""
    sign = 1 if second["severest"] > second["mildest"] else -1
    stretches, last = [], None
    for level, survived in second["levels"]:
        if survived is False:
            if last is not False:
                stretches.append([level, level])
            stretches[-1][1] = level
        last = survived
    texts = []
    for begin, end in stretches:
        better = [level for level, survived in first["levels"] if survived and sign * begin <= sign * level <= sign * end]
        if better:
            texts.append(f"{better[0]:.4g}" if len(better) == 1 else f"{better[0]:.4g} to {better[-1]:.4g}")
    return ", ".join(texts)


class Half:
    """One half of a row of the page: what the two builds survive, the ratio (None: it has none), and where the second one survives less."""

    def __init__(self, cells, value, less=""):
        self.cells = cells
        self.ratio = value
        self.less = less

    @property
    def is_scanned(self):
        return self.ratio is not None and not any(NOT_SCANNED in cell for cell in self.cells)

    def texts(self):
        return [*self.cells, "-" if self.ratio is None else "∞" if self.ratio == math.inf else f"{self.ratio:.3g}", self.less]

    def wants_reason(self):
        return self.cells[1] == NEVER or self.ratio is not None and self.ratio < TWICE and not self.cells[1].startswith("all")


# At levels of the page that were flown before searches scanned below a limit.
NOT_SCANNED = "§"
NOT_FLOWN = Half(("-", "-"), None)


class Row:
    def __init__(self, unit, mark, halves=None, reason=""):
        self.unit = unit
        self.mark = mark
        self.halves = halves or [NOT_FLOWN for _ in SCENARIOS]
        self.reason = reason  # why there is no margin; why one is not larger is in limits.json

    @property
    def has_margin(self):
        return any(half.ratio is not None for half in self.halves)


def failing_at(row, levels):
    """The row, which fails at these levels as well."""
    sign = 1 if row["severest"] > row["mildest"] else -1
    known = dict(row["levels"]) | dict.fromkeys(levels, False)
    return {**row, "levels": sorted(known.items(), key=lambda item: sign * item[0])}


def half_of(pair, worse):
    """Half a row. The second firmware is worse at these levels with further seeds."""
    known = all(row and "error" not in row for row in pair)
    return Half(tuple(map(cell, pair)), ratio(*pair) if known else None, less_at(pair[0], failing_at(pair[1], worse)) if known else "")


def further_of(file):
    """What further_seeds.py found for an envelope, by the name of a row. Nothing where it has not flown."""
    further = file.with_name("further.json")
    return json.loads(further.read_text())["rows"] if further.exists() else {}


def read_envelope(file, index, mark, clients, rows, reasons):
    """Adds an envelope's rows, and the reasons of the types that it could not take."""
    data = json.loads(file.read_text())
    if not data["complete"]:
        print(f"tables: {file} is not complete", file=sys.stderr)
    if len(data["clients"]) != 2:
        sys.exit(f"tables: {file} has {len(data['clients'])} firmwares, and a ratio needs two")
    if clients and clients != data["clients"]:
        sys.exit(f"tables: {file} is of {data['clients']}, and others are of {clients}")
    clients[:] = data["clients"]
    flown = {}
    for row in data["rows"]:
        flown.setdefault((row["type"], place(row)), {})[row["client"]] = row
    further = further_of(file)
    for key, by_client in flown.items():
        # Half of a pair, of an envelope that was interrupted, is no row.
        if len(by_client) < 2 and not data["complete"]:
            continue
        row = rows.setdefault(key, Row(next(iter(by_client.values()))["unit"], mark))
        row.halves = list(row.halves)
        worse = further.get(spot_check.name_of(next(iter(by_client.values()))), {}).get("less_at", [])
        row.halves[index] = half_of([by_client.get(client) for client in clients], worse)
    for other in data.get("not_applicable", []):
        reasons[other["type"]] = other["reason"]


def read_flown(out):
    """All rows that have been flown, and those of types without a margin. A reason is that of the last part that tried."""
    rows, reasons, clients = {}, {}, []
    for part, mark in PARTS.items():
        for index, scenario in enumerate(SCENARIOS):
            file = out / f"{scenario}{part}" / "envelope.json"
            if file.exists():
                read_envelope(file, index, mark, clients, rows, reasons)
    with_rows = {fault for fault, _ in rows}
    for fault, reason in reasons.items():
        if fault not in with_rows:
            rows[fault, ""] = Row("", "", [Half((NO_MARGIN, NO_MARGIN), None) for _ in SCENARIOS], reason)
    return rows, clients


def read_page(file):
    """The rows that the page has, in its order."""
    rows = {}
    for line in file.read_text().splitlines() if file.exists() else ():
        found = re.match(r"\| `([a-z_.]+)`(\S*) \| ", line)
        if not found:
            continue
        _, where, unit, *cells, reason = (text.strip() for text in re.split(r"(?<!\\)\|", line.strip())[1:-1])
        halves = [Half(tuple(cells[i:i + 2]), None if cells[i + 2] == "-" else float(cells[i + 2].replace("∞", "inf")), cells[i + 3]) for i in (0, 4)]
        row = Row("" if unit == "-" else unit, found[2], halves)
        row.reason = "" if row.has_margin else reason
        rows[found[1], where] = row
    return rows


def in_order(rows, catalogue):
    """By type as in the catalogue, and within a type as they come."""
    known = {fault: index for index, fault in enumerate(catalogue)}
    return dict(sorted(rows.items(), key=lambda item: known.get(item[0][0], len(known))))


def merged(old, new):
    """New rows in place of old ones; of a type that is flown anew no old row stays, but a half that was not flown does."""
    again = {fault for fault, _ in new}
    rows = {key: new.get(key, row) for key, row in old.items() if key[0] not in again or key in new} | new
    for key, row in rows.items():
        if key in old and row.has_margin:
            row.halves = [b if a is NOT_FLOWN else a for a, b in zip(row.halves, old[key].halves)]
    return rows


class Limits:
    """Why nothing could be better: reasons, each for the rows that its patterns match ("frame.* both")."""

    def __init__(self, file):
        self.reasons = json.loads(file.read_text())
        self.used = set()

    def why(self, key):
        text = " ".join(key).strip()
        for entry in self.reasons:
            for pattern in entry["rows"]:
                if fnmatch.fnmatchcase(text, pattern):
                    self.used.add(pattern)
                    return entry["why"]
        return ""

    def unused(self):
        return [pattern for entry in self.reasons for pattern in entry["rows"] if pattern not in self.used]


def whole_table(rows, clients, limits, missing):
    lines = ["| type | where | unit | " + " | ".join(f"{clients[0]} | {clients[1]} | ratio | less at" for _ in SCENARIOS) + " | why not more |",
             "|---|---|---|" + "---:|---:|---:|---|" * len(SCENARIOS) + "---|"]
    for key, row in rows.items():
        reason = row.reason
        if any(half.wants_reason() for half in row.halves):
            reason = limits.why(key)
            if not reason:
                missing.append(key)
        cells = [text for half in row.halves for text in half.texts()]
        lines.append("| " + " | ".join([f"`{key[0]}`{row.mark}", key[1], row.unit or "-", *cells, reason]) + " |")
    return "\n".join(lines)


def layers_of(rows):
    """By layer: its types, and of each the halves of the rows of its places."""
    layers = {}
    for (fault, _), row in rows.items():
        layers.setdefault(fault.split(".")[0], {}).setdefault(fault, []).append(row.halves)
    return layers


def has_margin(places):
    return any(half.ratio is not None for halves in places for half in halves)


def twice_as_much(types, i):
    """Of a layer's types: how many are survived twice as severely at some place, and how many were scanned at one, in half i."""
    scanned = [[halves[i].ratio for halves in places if halves[i].is_scanned] for places in types.values()]
    return sum(max(ratios, default=0) >= TWICE for ratios in scanned), sum(map(bool, scanned))


def short_table(layers):
    lines = ["| layer | types | with a margin | " + " | ".join(f"twice as much: {title}" for title in TITLES) + " |", "|---|---:|---:|" + "---:|" * len(TITLES)]
    for layer, types in layers.items():
        counts = [twice_as_much(types, i) for i in range(len(TITLES))]
        texts = [f"{twice} of {scanned}" if scanned else "-" for twice, scanned in counts]
        lines.append(f"| {layer} | {len(types)} | {sum(map(has_margin, types.values()))} | " + " | ".join(texts) + " |")
    return "\n".join(lines)


def worse_rows(rows, half, options):
    """In which the second firmware survives less: the names of the rows, and how much less."""
    found = {}
    for key, row in rows.items():
        own = row.halves[half]
        tolerance = options.tolerance or (BOARD_TOLERANCE if row.mark == PARTS["-board"] else TOLERANCES[half])
        if own.ratio is not None and own.ratio < 1 - tolerance:
            found[" ".join(key).strip()] = f"{' and '.join(own.cells)}, {own.ratio:.3g} times as far"
        elif own.less:
            found[" ".join(key).strip()] = f"at {own.less}"
    return found


def worse_text(rows, clients, options):
    old, new = clients
    titles = [f"{title[0].upper()}{title[1:]}" for title in TITLES]
    lines, none = [f"| layer | {' | '.join(titles)} |", "|---|" + "---|" * len(TITLES)], []
    worse = [worse_rows(rows, i, options) for i in range(len(TITLES))]
    for layer in dict.fromkeys(fault.split(".")[0] for fault, _ in rows):
        cells = [", ".join(f"`{name}`" for name in half if name.startswith(f"{layer}.")) for half in worse]
        if any(cells):
            lines.append(f"| {layer} | {' | '.join(cells)} |")
    for i, title in enumerate(titles):
        if not worse[i]:
            unscanned = any(NOT_SCANNED in cell for row in rows.values() for cell in row.halves[i].cells)
            none.append(f"{title}: none is known (levels with {NOT_SCANNED} have no scan)." if unscanned else f"{title}: none.")
    text = paragraph(" ".join([f"`{new}` survives these faults less than `{old}`, at one level at least.", *none]))
    return text + "\n\n" + "\n".join(lines) if any(worse) else text


def paragraph(text):
    return textwrap.fill(text, 108, break_on_hyphens=False)


def page(rows, clients, layers, limits, options, missing):
    old, new = clients
    repeats = options.repeats or REPEATS
    exact = " and ".join(f"{100 * (options.tolerance or share):g} %" for share in TOLERANCES)
    how = paragraph(
        f"This page has the margins of the builds `{old}` and `{new}` for every fault. Beyond its level they leave the path by 1 m or tilt by more than 0.6 rad. "
        "They fly the paper's spiral of 20 s with the fault from 10 s to 15 s. "
        f"`tiltproof envelope` ([margins](margins.md)) found the levels, exact to {exact} of the distance from harmless for the left and the right half. "
        "Every level that the search flew below them is survived. "
        "`scenarios/envelope/tables.py --fly build/release/tiltproof -j 2` flies everything again and writes this page. "
        "[Wire](wire.md) compares the same firmware with the protocols `paper` and `hardened`.")
    halves = paragraph(
        f"The left half is for the {TITLES[0]}; the right half for {TITLES[1]}: 2 % heavier, 10 % more inertia, 20 % more drag torque "
        "(`scenarios/envelope/spiral-other-vehicle.yaml`).")
    sure = paragraph(
        f"At each level {repeats} seeds flew, from {SEED} on; none of them was used for tuning. All of them passed, so it is 95 % sure that at least "
        f"{100 * 0.05 ** (1 / repeats):.0f} % of all seeds do. The mark {EXACT} is for rows in which nothing is drawn at random, where one flight is that of all seeds.")
    shares = paragraph(
        f"The survived share of the range, on its scale, is in brackets. The mark {POCKETS} is for limits behind which a more severe level is survived "
        f"again. `less at`: levels that `{old}` survives and `{new}` does not. Where anything is random, `{new}` also flew {spot_check.SEEDS} further "
        f"seeds at up to {further_seeds.LEVELS} levels that `{old}` survives, the most severe one among them, except on the board (`scenarios/envelope/further_seeds.py`).")
    marks = paragraph(
        f"{PARTS['-drag']}: on the same vehicles with the drag of `plant/models/tiltrotor_drag.sdf`, because no wind moves the others. {PARTS['-board']}: on the emulated "
        f"board (`--client qemu`), where a flight takes as long as fifty here. There {options.repeats or BOARD_REPEATS} seeds flew, which is 95 % sure of only "
        f"{100 * 0.05 ** (1 / (options.repeats or BOARD_REPEATS)):.0f} % of them, and the levels are exact to {100 * (options.tolerance or BOARD_TOLERANCE):g} %.")
    if any(NOT_SCANNED in cell for row in rows.values() for half in row.halves for cell in half.cells):
        marks += "\n\n" + paragraph(
            f"{NOT_SCANNED}: found by bisection, without a scan of the levels below, with 5 seeds (2 on the board) over 40 s of the spiral. Such a limit may be too "
            "large, because a level below it may fail.")
    words = paragraph(
        f"`none`: the mildest level failed. `all`: the most severe level was survived. `{NO_MARGIN}`: there is no margin, and the last column has the "
        f"program's reason. `-`: not flown. `ratio`: how many times as far from the harmless value `{new}` goes; for a limit that falls from infinity, the inverse "
        f"levels count. Where it is below {TWICE:g} in a half, and `{new}` does not survive everything there, the last column has the reason.")
    counted = paragraph(f'"Twice as much" counts the types that `{new}` survives at least twice as severely at some place, of those whose levels were scanned in that half.')
    return f"""# Fault margins of the bundled firmware

{how}

{halves}

{sure}

{shares}

{marks}

{words}

{short_table(layers)}

{counted}

{worse_text(rows, clients, options)}

{whole_table(rows, clients, limits, missing)}
"""


def write_block(file, text):
    """Between the marks; their lines stay."""
    before, begin, rest = file.read_text().partition(MARK)
    _, end, after = rest.partition(END)
    if not begin or not end:
        sys.exit(f"tables: {file} lacks the lines {MARK} and {END}")
    file.write_text(f"{before}{MARK}\n{text}\n{END}{after}")


def vehicle_with_drag(scenario, folder):
    """The scenario with the drag of plant/models/tiltrotor_drag.sdf on its vehicle, as files in the folder."""
    text = (HERE / f"{scenario}.yaml").read_text()
    models = SOURCE / "plant/models"
    [drag] = re.findall(r" *<tiltproof:drag .*\n", (models / "tiltrotor_drag.sdf").read_text())
    found = re.search(r"^model: (\S+)\n", text, re.M)
    model = (HERE / found[1] if found else models / "tiltrotor.sdf").read_text()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vehicle.sdf").write_text(model.replace("    </tiltproof:vehicle>", f"{drag}    </tiltproof:vehicle>"))
    text = text.replace(found[0], "") if found else text
    file = folder / f"{scenario}-drag.yaml"
    file.write_text(re.sub(r"^(name: .*)\n", r"\1-drag\nmodel: vehicle.sdf\n", text, flags=re.M))
    return file


def matches(types, name):
    """True if the option --types selects this type; None selects all."""
    return not types or any(fnmatch.fnmatchcase(name, pattern) for pattern in types.split(","))


def fly_part(options, scenario, part, repeats, tolerance, types):
    """Flies one envelope, or goes on with it. Returns the types that it could not take at any place."""
    out = options.out / f"{scenario}{part}"
    result = out / "envelope.json"
    file = vehicle_with_drag(scenario, out) if part == "-drag" else HERE / f"{scenario}.yaml"
    command = [options.fly, "envelope", file, "--firmware", options.firmware, "--resume" if result.exists() else "--out", out, "-j", str(options.jobs), "--seed", str(SEED),
               "--repeats", str(options.repeats or repeats), "--tolerance", str(options.tolerance or tolerance)]
    command += ["--client", "qemu"] if part == "-board" else []
    command += ["--types", types] if types else []
    done = subprocess.run(list(map(str, command)), check=False).returncode
    if done not in (0, 4):
        sys.exit(done)
    data = json.loads(result.read_text()) if result.exists() else {"rows": [], "not_applicable": []}
    flown = {row["type"] for row in data["rows"] if matches(types, row["type"])}
    if done == 4 and not flown:
        return types  # it takes none of them
    options.undecided |= done == 4
    return ",".join(dict.fromkeys(other["type"] for other in data["not_applicable"] if matches(types, other["type"]) and other["type"] not in flown))


def fly_types(options, types):
    for scenario, tolerance in zip(SCENARIOS, TOLERANCES):
        left = fly_part(options, scenario, "", REPEATS, tolerance, types)
        left = left and fly_part(options, scenario, "-drag", REPEATS, tolerance, left)
        if left:
            fly_part(options, scenario, "-board", BOARD_REPEATS, BOARD_TOLERANCE, left)


def fly_further(options, scenario, out):
    """Further seeds for an envelope, where there is one."""
    if not (out / "envelope.json").exists():
        return
    command = [sys.executable, "-B", HERE / "further_seeds.py", options.fly, scenario, out / "envelope.json", "-j", options.jobs]
    done = subprocess.run(list(map(str, command)), check=False).returncode
    if done not in (0, 1, 3):
        sys.exit(done)
    options.undecided |= done == 3


def fly(options):
    """Flies both halves of a type before the next type, and writes the tables after each, so that an interruption costs one type only."""
    program = subprocess.run([options.fly, "faults"], capture_output=True, text=True, check=True)
    for name in re.findall(r"^## ([a-z]+\.[a-z_]+)$", program.stdout, re.M):
        if matches(options.types, name):
            fly_types(options, name)
            write_tables(options)
    # Nothing is left to fly: this adds the reasons of the types that no envelope can take.
    options.undecided = False
    fly_types(options, options.types)
    for scenario in SCENARIOS:
        fly_further(options, HERE / f"{scenario}.yaml", options.out / scenario)
        fly_further(options, options.out / f"{scenario}-drag/{scenario}-drag.yaml", options.out / f"{scenario}-drag")


def write_tables(options):
    """Writes the page and the short table from what has been flown, and from the page. Returns the rows, the layers, the limits, and the rows without a reason."""
    catalogue = catalogue_of(options)
    new, clients = read_flown(options.out)
    rows = in_order(merged(read_page(options.page), new), catalogue)
    if not rows:
        return rows, {}, None, []
    layers, limits, missing = layers_of(rows), Limits(options.limits), []
    clients = clients or options.firmware.split(",")
    options.page.write_text(page(rows, clients, layers, limits, options, missing))
    write_block(options.readme, f"\n{short_table(layers)}\n\n{worse_text(rows, clients, options)}\n")
    return rows, layers, limits, missing


def catalogue_of(options):
    return re.findall(r"^## ([a-z]+\.[a-z_]+)$", options.catalogue.read_text(), re.M)


def report(rows, layers, options):
    """Prints what counts. Returns the number of rows in which the second firmware is worse."""
    worse = 0
    for i, title in enumerate(TITLES):
        counts = {name: twice_as_much(types, i) for name, types in layers.items()}
        twice, scanned = (sum(numbers) for numbers in zip(*counts.values()))
        print(f"{title}: {twice} of {scanned} types survived at least twice as severely; by layer: "
              + ", ".join(f"{name} {own} of {of}" for name, (own, of) in counts.items()))
        for name, how in worse_rows(rows, i, options).items():
            worse += 1
            print(f"  worse: {name}: {how}")
    return worse


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fly", type=pathlib.Path, help="the program; without it, what has been flown counts")
    parser.add_argument("--firmware", default="paper,tolerant", help="two builds, the reference first")
    parser.add_argument("--types", help="only these types, as in `tiltproof envelope`; other rows of the page stay")
    parser.add_argument("--repeats", type=int, help="seeds at each level, for all")
    parser.add_argument("--tolerance", type=float, help="of the search, for all")
    parser.add_argument("-j", dest="jobs", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("results/survival"), help="where the envelopes are")
    parser.add_argument("--page", type=pathlib.Path, default=SOURCE / "docs/survival.md")
    parser.add_argument("--readme", type=pathlib.Path, default=SOURCE / "README.md")
    parser.add_argument("--limits", type=pathlib.Path, default=HERE / "limits.json", help="why nothing could be better")
    parser.add_argument("--catalogue", type=pathlib.Path, default=SOURCE / "docs/faults.md", help="the types that the page must have")
    options = parser.parse_args()
    options.undecided = False
    if options.fly:
        fly(options)
    rows, layers, limits, missing = write_tables(options)
    if not rows:
        sys.exit(f"tables: nothing has been flown in {options.out}, and {options.page} has no rows")

    worse = report(rows, layers, options)
    for key in missing:
        print(f"  no reason in {options.limits.name}: {' '.join(key).strip()}")
    absent = [fault for fault in catalogue_of(options) if all(fault != known for known, _ in rows)]
    for fault in absent:
        print(f"  not on the page: {fault}")
    for pattern in limits.unused():
        print(f"  no row needs the reason of: {pattern}")
    return 1 if worse or missing or absent else 4 if options.undecided else 0


if __name__ == "__main__":
    sys.exit(main())
