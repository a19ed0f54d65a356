"""A program that flies the controller of firmware/examples/python, and at 0.3 s does what no firmware must.
Usage: program_client.py SOURCE_DIR WAY"""
import os
import pathlib
import signal
import socket
import struct
import sys
import time

SOURCE, WAY = pathlib.Path(sys.argv[1]), sys.argv[2]
sys.path[:0] = [str(SOURCE / "python"), str(SOURCE / "firmware/examples/python")]
if WAY == "ends_at_once":
    sys.exit("nothing to do here")
if WAY == "never_connects":
    time.sleep(60)

from program_hover import Firmware  # noqa: E402
from tiltproof.program import MAIN, NEVER, Program  # noqa: E402

AT_NS = 300_000_000


def other_connection():
    other = socket.socket(socket.AF_UNIX)
    other.connect(os.environ["TILTPROOF_SOCKET"])
    return other


if WAY in ("refuses", "another_version", "wrong_greeting"):
    body = {"refuses": b"no such build", "another_version": struct.pack("<I", 7), "wrong_greeting": struct.pack("<q", 0)}[WAY]
    kind = {"refuses": 0x87, "another_version": 0x81, "wrong_greeting": 0x82}[WAY]
    end = other_connection()
    end.sendall(struct.pack("<IBBBx", len(body), kind, 0, 0) + body)
    end.recv(1)
    time.sleep(60)

program = Program(tells_status=WAY == "status")


def misbehave(now_ns):
    """None: it waits as if nothing were."""
    raw = program._socket
    if WAY == "exception":
        raise ValueError("beyond the last sensor")
    if WAY == "exit":
        sys.exit(3)
    if WAY == "exit_0":
        sys.exit(0)
    if WAY == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if WAY == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if WAY == "stop":
        os.kill(os.getpid(), signal.SIGSTOP)
    if WAY == "hang":
        while True:
            pass
    if WAY == "sleep":
        time.sleep(60)
    if WAY == "close":
        raw.close()
        time.sleep(60)
    if WAY == "garbage":
        raw.sendall(b"GET / HTTP/1.1\r\n\r\n")
        time.sleep(60)
    if WAY == "huge":
        raw.sendall(struct.pack("<IBBBx", 2**31, 0x83, 0, 0))
        time.sleep(60)
    if WAY == "uart":
        program._send(0x83, 9, 0, struct.pack("<q", now_ns) + b"x")
    if WAY == "ready_again":
        program._send(0x81, 0, 0, struct.pack("<I", 1))
    if WAY == "two_answers":
        program._send(0x82, 0, 0, struct.pack("<q", now_ns))
    if WAY == "flood":
        part = struct.pack("<IBBBx", 8 + 65536, 0x86, 0, 0) + struct.pack("<q", now_ns) + b"x" * 65536
        while True:
            raw.sendall(part)
    if WAY == "trickle":
        while True:
            raw.sendall(struct.pack("<IBBBxII", 8, 0x84, 0, 0, 0, 0))
            time.sleep(0.02)
    if WAY == "backwards":
        program.transmit(MAIN, now_ns - 5_000_000, b"\x7e")
        return now_ns - 5_000_000
    if WAY == "nanoseconds":
        return now_ns + 1
    if WAY == "print":
        print("x" * 4_000_000)
    if WAY == "print_always":
        print("x" * 200_000)
    if WAY == "print_and_exit":
        print("no calibration")
        sys.exit(3)
    if WAY == "print_and_raise":
        print("\n".join(f"line {number} " + "x" * 40 for number in range(60_000)))
        raise ValueError("behind three megabytes")
    if WAY == "leave_child":
        for detach in (False, True):
            if os.fork() == 0:
                if detach:
                    os.setsid()
                    if os.fork() != 0:
                        os._exit(0)
                time.sleep(600)
                os._exit(0)
    if WAY == "status":
        program.status(2, 1)
    if WAY == "log":
        program.log(now_ns, "a line\nof two")
        print("printed")
    return None


firmware = Firmware(program)
done = False
for event in program:
    if event.kind == "bytes":
        firmware.receive(event.uart, event.now_ns, event.data)
        continue
    if event.kind == "reset":
        firmware = Firmware(program)
    until_ns = firmware.run(event.now_ns)
    if event.now_ns >= AT_NS and (not done or WAY in ("nanoseconds", "backwards", "print_always")):
        done = True
        instead = misbehave(event.now_ns)
        until_ns = until_ns if instead is None else instead
    program.wait(min(until_ns, NEVER))
if WAY == "fails_at_end":
    raise RuntimeError("no way to end")
if WAY == "stays":
    time.sleep(60)
