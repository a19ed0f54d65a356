"""A flight under way, steered over the lines of `tiltproof session`."""

from __future__ import annotations

import json
import math
import os
import subprocess
import tempfile
from types import TracebackType
from typing import Any, Iterable, Mapping

from tiltproof._program import Error, find_program
from tiltproof._result import FlightOver, NotReached, RequestError, Result


def fly(
    scenario: str | os.PathLike[str],
    *,
    client: str | Mapping[str, str] = "host",
    seed: int | None = None,
    firmware: str | None = None,
    set: Mapping[str, object] | None = None,
    watch: Iterable[str] = (),
    out: str | os.PathLike[str] = "results",
    report: bool = True,
) -> Flight:
    """Begins a flight, which stands at power-on until a call lets time pass.

    client, seed, firmware: as the flags of `tiltproof run`; of several clients {"a": "host", "b": "library:b.so"}. set: other values for keys of the scenario, by their paths
    ({"faults.late.parameters.mean_ms": 12}). watch: variables of an emulated image, which become signals watch_NAME.
    out: parent of the run's folder. report: whether it gets a report.html. Raises Error, with the program's message, for a scenario or flag that is not valid.
    """
    arguments = ["session", os.fspath(scenario), "--out", os.fspath(out)]
    for one in [client] if isinstance(client, str) else [f"{id}={own}" for id, own in client.items()]:
        arguments += ["--client", one]
    if not report:
        arguments.append("--no-report")
    if seed is not None:
        arguments += ["--seed", str(seed)]
    if firmware is not None:
        arguments += ["--firmware", firmware]
    for path, value in (set or {}).items():
        arguments += ["--set", f"{path}={value if isinstance(value, str) else json.dumps(value)}"]
    for variable in watch:
        arguments += ["--watch", variable]
    return Flight(arguments)


class Flight:
    """A flight that stands still between two calls. Use it in a `with` block, whose end flies on to the scenario's end.

    Times are simulation time, since the firmware's `start`; before the first call it is 0, at power-on. Time passes in
    control periods (`period_s`): until() and advance() end at the first row of the trace that fits.
    """

    def __init__(self, arguments: list[str]) -> None:
        self._log = tempfile.TemporaryFile()
        self._session = subprocess.Popen(
            [find_program(), *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, bufsize=0
        )
        self._unread = b""
        self._requests_count = 0
        self._result: Result | None = None
        self.time_s = 0.0
        hello = self._receive(None)
        if self._result is not None:
            raise FlightOver(self._result.reason, self._result)
        self.scenario: str = hello["scenario"]
        self.folder: str = hello["folder"]
        self.replay: str = hello["replay"]
        self.duration_s: float = hello["duration_s"]
        self.period_s: float = hello["period_s"]
        self.signals: tuple[str, ...] = tuple(hello["signals"])

    # Time.

    def advance(self, duration_s: float) -> float:
        """Lets so many seconds pass. Returns the time. Raises FlightOver when the flight ends before."""
        self._ask({"advance_s": duration_s})
        return self.time_s

    def until(self, condition: str, timeout_s: float | None = None) -> float:
        """Flies until the condition holds, as `when` of a fault has it: until("z_m > 2 and speed_m_s < 0.1").

        Returns the time. Raises NotReached after timeout_s seconds, and FlightOver when the flight ends before.
        """
        request: dict[str, object] = {"until": condition}
        if timeout_s is not None:
            request["timeout_s"] = timeout_s
        began_s = self.time_s
        if not self._ask(request)["met"]:
            raise NotReached(f"'{condition}' did not hold from {began_s:g} s to {self.time_s:g} s of the flight")
        return self.time_s

    # Faults.

    def inject(
        self,
        type: str,
        *,
        target: str | None = None,
        id: str | None = None,
        duration_s: float | None = None,
        message: str | None = None,
        client: str | None = None,
        every_nth_count: int | None = None,
        keys: Mapping[str, object] | None = None,
        **parameters: object,
    ) -> str:
        """Begins a fault now, for duration_s seconds or to the flight's end. Returns its id.

        parameters: those of the type (`tiltproof faults TYPE`). keys: other keys of a fault (`probability` of its trigger,
        `period_s`, `duty`). client: the one of several on which it acts; without it, on each. A fault on the line or on a
        clock begins when the line is free of what was sent before.
        """
        fault: dict[str, object] = {"type": type, **(keys or {})}
        given = {
            "id": id, "target": target, "message": message, "every_nth_count": every_nth_count, "duration_s": duration_s,
            "client": client,
        }
        fault.update((key, value) for key, value in given.items() if value is not None)
        fault["parameters"] = parameters
        return str(self._ask({"inject": fault})["id"])

    def remove(self, id: str) -> None:
        """Ends a fault now: one that was injected, or one of the scenario."""
        self._ask({"remove": id})

    # Signals.

    def __getitem__(self, signal: str) -> float:
        """The present value of a signal; NaN when there is none yet."""
        return self.read(signal)[signal]

    def read(self, *signals: str) -> dict[str, float]:
        """The present values of several signals."""
        values = self._ask({"read": signals})["values"]
        return {name: math.nan if value is None else value for name, value in values.items()}

    # The end.

    def stop(self) -> Result:
        """Ends the flight at once."""
        return self._end({"stop": True})

    def finish(self) -> Result:
        """Flies on to the scenario's end."""
        return self._end({"finish": True})

    @property
    def over(self) -> bool:
        """True if the flight has ended."""
        return self._result is not None

    @property
    def result(self) -> Result:
        """The result, once the flight is over."""
        if self._result is None:
            raise Error("the flight is not over: it has a result after the `with` block, stop() or finish()")
        return self._result

    def __enter__(self) -> Flight:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            # An earlier end has been raised.
            if not self.over and self.finish().verdict == "error":
                raise Error(f"the flight was not judged: {self.result.reason}")
            return
        at_s = self.time_s
        try:
            self.stop()
        except (Error, OSError):
            self._session.kill()
            self._close()
        error.add_note(f"flight: at {at_s:g} s of {self.scenario}; folder: {self.folder}; again: {self.replay}")

    # Lines.

    def _end(self, request: Mapping[str, object]) -> Result:
        if self._result is None:
            self._receive(self._send(request))
        return self.result

    def _ask(self, request: Mapping[str, object]) -> dict[str, Any]:
        if self._result is None:
            answer = self._receive(self._send(request))
        if self._result is not None:
            raise FlightOver(
                f"the flight is over ({self._result.end_reason}): {self._result.verdict}: {self._result.reason}",
                self._result,
            )
        return answer

    def _send(self, request: Mapping[str, object]) -> int:
        """Returns the request's number, which its answer has, too."""
        assert self._session.stdin is not None
        if self._session.stdin.closed:
            raise Error(f"`tiltproof session` has ended, with code {self._session.returncode}")
        self._requests_count += 1
        try:
            text = json.dumps({**request, "request": self._requests_count}, allow_nan=False)
        except ValueError:
            raise RequestError(f"a number is not finite ({request})") from None
        try:
            self._session.stdin.write(text.encode() + b"\n")
        except BrokenPipeError:
            pass  # the answer says why
        return self._requests_count

    def _receive(self, number: int | None) -> dict[str, Any]:
        """The answer to the request with this number, or the last one of the flight. The answer to an earlier request is
        dropped: a signal's exception may have ended that call before."""
        while True:
            line = self._read_line()
            if not line:
                said = self._close()
                raise Error(said or f"`tiltproof session` ended without an answer, with code {self._session.returncode}")
            try:
                answer: dict[str, Any] = json.loads(line)
            except ValueError:
                continue  # the exception came while a part of it was read
            if "ended" in answer or answer.get("request", number) == number:
                break
        if "error" in answer:
            raise RequestError(f"{answer['error']['message']} ({answer['error']['place']})")
        if "ended" in answer:
            self._result = Result(answer)
            self.time_s = self._result.metrics.get("survival.time_s", self.time_s)
            self._close()
        else:
            self.time_s = answer["time_s"]
        return answer

    def _read_line(self) -> bytes:
        """Empty: there is no more."""
        assert self._session.stdout is not None
        while b"\n" not in self._unread:
            more = self._session.stdout.read(1 << 16)
            if not more:
                return b""
            self._unread += more
        line, _, self._unread = self._unread.partition(b"\n")
        return line + b"\n"

    def _close(self) -> str:
        """Ends the session. Returns what it has said for people."""
        if self._log.closed:
            return ""
        assert self._session.stdin is not None and self._session.stdout is not None
        try:
            self._session.stdin.close()
        except BrokenPipeError:
            pass
        self._session.stdout.close()
        try:
            self._session.wait(timeout=1)
        except subprocess.TimeoutExpired:
            # All is written. A child that this program has forked holds the session's standard input open.
            self._session.terminate()
            self._session.wait()
        self._log.seek(0)
        said = self._log.read().decode(errors="replace").strip()
        self._log.close()
        return said
