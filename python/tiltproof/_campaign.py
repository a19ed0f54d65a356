"""Results of campaigns and searches as rows."""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import sqlite3
from typing import Any

from tiltproof._program import Error, run

Row = dict[str, Any]


def campaign(folder: str | os.PathLike[str]) -> list[Row]:
    """The runs of a campaign that has been flown, or is under way, in the order of their numbers.

    A row has the columns of the table `run` (docs/campaigns.md: number, seed, firmware, verdict, margin, trace_hash, ...),
    and `faults` and `criteria`, the lists of that run's rows in these tables.
    """
    file = pathlib.Path(folder) / "campaign.sqlite"
    if not file.is_file():
        raise Error(f"{file}: there is no such file: `tiltproof campaign ... --out {os.fspath(folder)}` makes it")
    with sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True) as store:
        store.row_factory = sqlite3.Row
        rows = [dict(row) for row in store.execute("SELECT * FROM run ORDER BY number")]
        for name, table in (("faults", "fault"), ("criteria", "criterion")):
            of_run: dict[int, list[Row]] = {row["number"]: row.setdefault(name, []) for row in rows}
            for row in store.execute(f"SELECT * FROM {table}"):
                of_run.get(row["run"], []).append(dict(row))
    store.close()
    return rows


@dataclasses.dataclass(frozen=True)
class Margin:
    """The largest severity of a fault that a scenario survives; None: not even the lowest, or even the highest."""

    survives: float | None
    fails: float | None
    parameter: str
    unit: str
    first_criterion: str | None  # violated at `fails`
    data: Row  # the whole line of `tiltproof margin --format jsonl`


def margin(
    scenario: str | os.PathLike[str],
    fault: str,
    *,
    client: str = "host",
    firmware: str | None = None,
    parameter: str | None = None,
    low: float | None = None,
    high: float | None = None,
    tolerance: float | None = None,
    repeats: int | None = None,
    seed: int | None = None,
    jobs: int = 1,
) -> Margin:
    """Finds the margin of one fault of a scenario, by its id (docs/margins.md). Flies many flights."""
    flags = {
        "client": client, "firmware": firmware, "parameter": parameter, "low": low, "high": high,
        "tolerance": tolerance, "repeats": repeats, "seed": seed,
    }
    given = [f"--{name}={value}" for name, value in flags.items() if value is not None]
    text = run(
        ["margin", os.fspath(scenario), "--fault", fault, "--format", "jsonl", f"-j{jobs}", *given], accepted=(0, 1)
    )
    data: Row = json.loads(text.splitlines()[-1])
    return Margin(data["survives"], data["fails"], data["parameter"], data["unit"], data["first_criterion"], data)
