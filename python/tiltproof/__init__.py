"""Flights that a script steers: take off, wait for a condition, inject a fault, look, assert.

    import tiltproof

    with tiltproof.fly("hover.yaml", client="library:fw.so", seed=3) as flight:
        flight.until("z_m > 2", timeout_s=20)
        flight.inject("frame.delay", target="to_client", mean_ms=12, duration_s=5)
        flight.advance(10)
        assert flight["position_error_m"] < 0.5
    assert flight.result.verdict == "pass"

Time is virtual: the flight stands still between two calls, and a call costs some ten microseconds. What a script does is
written into the flight's folder as a scenario, so `tiltproof replay` flies the same bits without Python. docs/python.md
has more; docs/session.md describes the lines that this module exchanges with `tiltproof session`.
"""

from __future__ import annotations

from tiltproof._campaign import Margin, campaign, margin
from tiltproof._flight import Flight, fly
from tiltproof._program import Error, find_program
from tiltproof._result import Criterion, FlightOver, NotReached, RequestError, Result, Trace

__all__ = [
    "Criterion", "Error", "Flight", "FlightOver", "Margin", "NotReached", "RequestError", "Result", "Trace",
    "campaign", "find_program", "fly", "margin",
]
