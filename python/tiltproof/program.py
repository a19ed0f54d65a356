"""A controller in Python that flies in lockstep: `tiltproof run ... --client 'program:python3 controller.py'`.

    from tiltproof.program import MAIN, NEVER, Program

    program = Program()
    for event in program:
        if event.kind == "bytes":
            program.transmit(MAIN, event.now_ns, event.data)     # an echo
        else:                                                    # "grant", or "reset": all state is lost
            program.wait(NEVER)

Times are nanoseconds of the program's own clock since power-on; the first grant is power-on, at 0. A controller reads no
other clock, never sleeps, and draws no random numbers, so that two flights have the same bits. The loop ends with the
flight. docs/program.md describes the protocol.
"""

from __future__ import annotations

import dataclasses
import json
import os
import socket
import struct
import sys
from typing import Any, Iterator

__all__ = ["ACTIVE", "FAILED", "MAIN", "NEVER", "REFERENCE", "STANDBY", "Event", "Program", "Uart"]

MAIN, REFERENCE = 0, 1
NEVER = 2**63 - 1
STANDBY, ACTIVE, FAILED = 0, 1, 2

_HEAD = struct.Struct("<IBBBx")
_TIME = struct.Struct("<q")
_HELLO, _GRANT, _BYTES, _RESET, _SENT, _END, _COMPUTED = range(1, 8)
_READY, _WAITING, _TRANSMIT, _STATUS, _ROLE, _LOG, _REFUSED, _COMPUTE = range(0x81, 0x89)
_KINDS = {_GRANT: "grant", _BYTES: "bytes", _RESET: "reset"}
_VERSION = 1


@dataclasses.dataclass(frozen=True)
class Uart:
    """A serial port of the program; a baud of 0 is an ideal line, where bytes take no time."""

    baud: int
    character_bits: int


@dataclasses.dataclass(frozen=True)
class Event:
    """What the harness wants: kind is "bytes", "grant" or "reset". After a grant or a reset, call Program.wait()."""

    kind: str
    now_ns: int
    uart: int = MAIN
    data: bytes = b""


class Program:
    """The program's end of the line to the harness. Iterate over it for events; the iteration ends with the flight."""

    def __init__(self, tells_status: bool = False, tells_role: bool = False) -> None:
        path = os.environ.get("TILTPROOF_SOCKET")
        if not path:
            sys.exit("no TILTPROOF_SOCKET: fly this program with `tiltproof run ... --client 'program:CMD'`")
        # A line that is printed before a crash is kept.
        for stream in (sys.stdout, sys.stderr):
            if hasattr(stream, "reconfigure"):
                stream.reconfigure(line_buffering=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(path)
        self._in, self._taken, self._out = bytearray(), 0, bytearray()
        self._later: list[tuple[int, int, bytes]] = []
        self._status: tuple[int, int] | None = None
        hello = self._next()
        if hello is None or hello[0] != _HELLO:
            sys.exit("this tiltproof does not speak the protocol of programs")
        self._read_hello(hello[2])
        self._send(_READY, 0, int(tells_status) | int(tells_role) << 1, struct.pack("<I", _VERSION))
        self._flush()

    def _read_hello(self, body: bytes) -> None:
        _, count = struct.unpack_from("<II", body)
        self.uarts = [Uart(*struct.unpack_from("<II", body, 8 + 8 * i)) for i in range(count)]
        texts, at = [], 8 + 8 * count
        for _ in range(3):
            (size,) = struct.unpack_from("<I", body, at)
            texts.append(body[at + 4 : at + 4 + size].decode())
            at += 4 + size
        self.firmware, self.dialect = texts[:2]
        self.parameters: dict[str, Any] = json.loads(texts[2] or "{}")
        """What a controller must know of the vehicle: `parameters` in firmware/tiltproof_client.h."""

    def __iter__(self) -> Iterator[Event]:
        while (message := self._next()) is not None and message[0] != _END:
            kind, number, body = message
            if kind in _KINDS:
                yield Event(_KINDS[kind], _TIME.unpack_from(body)[0], number, body[8:])

    def transmit(self, uart: int, now_ns: int, data: bytes) -> None:
        """Gives bytes to the UART's transmitter at now_ns: the present time, or up to 1 s later."""
        if data:
            self._send(_TRANSMIT, uart, 0, _TIME.pack(now_ns), data)

    def sent_at(self, uart: int, now_ns: int, data: bytes) -> int:
        """As transmit(); returns when the last stop bit leaves. It costs one more exchange with the harness."""
        if not data:
            return now_ns
        self._send(_TRANSMIT, uart, 1, _TIME.pack(now_ns), data)
        return self._answer(_SENT, now_ns)

    def compute(self, now_ns: int, length_ns: int, deadline_ns: int = NEVER) -> int:
        """States that the program computes from now_ns on, for length_ns on a sound processor. Returns when it ends: what
        depends on the result is to be sent then or later. It costs one more exchange with the harness."""
        self._send(_COMPUTE, 0, 0, struct.pack("<qqq", now_ns, length_ns, deadline_ns))
        return self._answer(_COMPUTED, now_ns)

    def _answer(self, kind: int, otherwise_ns: int) -> int:
        self._flush()
        while (message := self._read()) is not None:
            if message[0] == kind:
                return int(_TIME.unpack(message[2])[0])
            self._later.append(message)
        return otherwise_ns

    def status(self, supervisor_state: int, failsafe_count: int) -> None:
        """The supervisor's state and count of fail-safe states: for a program that tells its status."""
        if self._status != (supervisor_state, failsafe_count):
            self._status = (supervisor_state, failsafe_count)
            self._send(_STATUS, 0, 0, struct.pack("<II", supervisor_state, failsafe_count))

    def role(self, role: int) -> None:
        """STANDBY, ACTIVE or FAILED: for a program that tells its role."""
        self._send(_ROLE, role, 0)

    def log(self, now_ns: int, text: str) -> None:
        """One line for the flight's firmware.log. What the program prints is there, too."""
        self._send(_LOG, 0, 0, _TIME.pack(now_ns), text.encode()[:1000])

    def wait(self, until_ns: int) -> None:
        """Ends a grant or a reset: there is nothing more to do until this time, or until bytes come."""
        self._send(_WAITING, 0, 0, _TIME.pack(until_ns))
        self._flush()

    def _send(self, kind: int, number: int, flags: int, *body: bytes) -> None:
        self._out += _HEAD.pack(sum(map(len, body)), kind, number, flags)
        for part in body:
            self._out += part

    def _flush(self) -> None:
        try:
            self._socket.sendall(self._out)
        except (BrokenPipeError, ConnectionResetError):
            pass  # the next read finds the end
        self._out.clear()

    def _next(self) -> tuple[int, int, bytes] | None:
        return self._later.pop(0) if self._later else self._read()

    def _read(self) -> tuple[int, int, bytes] | None:
        """Kind, number and body of the next message; None: the harness is gone."""
        while True:
            left = len(self._in) - self._taken
            if left >= _HEAD.size:
                size, kind, number, _ = _HEAD.unpack_from(self._in, self._taken)
                if left >= _HEAD.size + size:
                    begin = self._taken + _HEAD.size
                    self._taken = begin + size
                    return kind, number, bytes(self._in[begin : self._taken])
            del self._in[: self._taken]
            self._taken = 0
            try:
                received = self._socket.recv(65536)
            except ConnectionResetError:
                received = b""
            if not received:
                return None
            self._in += received
