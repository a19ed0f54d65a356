"""The result of a flight, its trace, and the exceptions of a flight."""

from __future__ import annotations

import dataclasses
import functools
import importlib.util
import pathlib
from typing import Any, Iterator, Mapping, Sequence

from tiltproof._program import Error, run


class RequestError(Error, ValueError):
    """A call that makes no sense: an unknown signal, a fault that is not valid. The flight stands where it stood."""


class NotReached(AssertionError):
    """The condition of until() did not hold in time."""


class FlightOver(Error):
    """The flight ended before the call was done. `result` has the verdict."""

    def __init__(self, message: str, result: Result) -> None:
        super().__init__(message)
        self.result = result


@dataclasses.dataclass(frozen=True)
class Criterion:
    """One criterion of the scenario, judged."""

    name: str
    verdict: str  # pass, fail, inconclusive
    margin: float | None  # comparable between criteria; above 0: it holds
    time_s: float | None  # of the row that decided
    explanation: str


class Trace(Mapping[str, Sequence[float]]):
    """Columns of a flight's trace, one value for each row; arrays where numpy is installed, otherwise lists.

    trace["z_m"][-1] is the last height. A value that the flight does not have is NaN.
    """

    def __init__(self, file: pathlib.Path) -> None:
        header, *lines = file.read_text(encoding="utf-8").splitlines()
        rows = [[float(text or "nan") for text in line.split(",")] for line in lines]
        self._columns: dict[str, Any] = {
            name: list(values)
            for name, values in zip(header.split(","), zip(*rows) if rows else [()] * (header.count(",") + 1))
        }
        if importlib.util.find_spec("numpy") is not None:
            numpy: Any = importlib.import_module("numpy")
            self._columns = {name: numpy.array(values) for name, values in self._columns.items()}

    def __getitem__(self, column: str) -> Any:
        return self._columns[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)


class Result:
    """A flight that is over. `data` is its verdict.json."""

    def __init__(self, ended: Mapping[str, Any]) -> None:
        self.data: Mapping[str, Any] = ended["result"]
        self.end_reason: str = ended["ended"]  # completed, ground_strike, firmware_crashed, ...
        self.folder = pathlib.Path(ended["folder"])
        self.margin: float | None = ended["margin"]  # of the headline criterion; above 0: all hold
        self.verdict: str = self.data["verdict"]  # pass, fail, inconclusive, error
        self.green: bool = self.data["green"]  # the verdict is the expected one
        self.reason: str = self.data.get("reason", "")
        self.seed: int = self.data["seed"]
        self.trace_hash: str = self.data["trace_hash"]
        self.replay: str = self.data["replay"]  # the command that flies it again
        self.metrics: dict[str, float] = dict(self.data["metrics"])
        self.criteria: list[Criterion] = [
            Criterion(each["name"], each["verdict"], each.get("margin"), each.get("time_s"), each["explanation"])
            for each in self.data["criteria"]
        ]
        self.activations: dict[str, int] = {each["id"]: each["activations"] for each in self.data["faults"]}

    @functools.cached_property
    def trace(self) -> Trace:
        """The flight's trace, read when it is first asked for."""
        return Trace(self.folder / "trace.csv")

    def replays(self) -> bool:
        """Flies it again without the script: true if the trace is equal to the bit."""
        return "1 of 1 equal" in run(["replay", str(self.folder)], accepted=(0, 1))

    def __repr__(self) -> str:
        reason = f": {self.reason}" if self.reason else ""
        return f"<Result {self.verdict}{reason}; again: {self.replay}>"
