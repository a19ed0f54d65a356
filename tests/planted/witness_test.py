#!/usr/bin/env python3
"""Each planted defect is there, and the correct client has none of them: bytes written by hand (witness/NAME.hex) are
said to each library over its C interface, without tiltproof.

A witness has words as the fault `frame.script` has them: the k-th word is sent instead of the k-th reply. Valid replies
follow for 50 periods. What became of the client is one word: clean, crashed, hung, silent (no request in the last 25
periods), insane (a command that no server takes), deaf (a valid reply without a command) or hasty (a command without a
valid reply).

Usage: witness_test.py FOLDER-OF-LIBRARIES
       witness_test.py drive LIBRARY WITNESS
"""
import ctypes
import math
import pathlib
import resource
import signal
import struct
import subprocess
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
PERIOD_NS = 12_000_000
OUTCOMES = {
    "length_unchecked": "crashed", "escape_at_end": "crashed", "flag_in_escape": "crashed", "checksum_range": "insane",
    "off_by_one": "crashed", "signed_length": "crashed", "missing_reset": "silent", "integer_overflow": "crashed",
    "state_kept": "insane", "endless_loop": "hung", "reply_skipped": "deaf", "old_answered": "hasty",
}


def frame(*numbers):
    payload = struct.pack(f"<{len(numbers)}f", *numbers)
    first = second = 0
    for byte in payload:
        first = (first + byte) % 255
        second = (second + first) % 255
    escaped = bytearray()
    for byte in payload + bytes([first, second]):
        escaped += bytes([0x7D, byte ^ 0x20]) if byte in (0x7D, 0x7E) else bytes([byte])
    return b"\x7e" + bytes(escaped) + b"\x7e"


SENSORS = frame(0, 0, 2, *[0] * 13)
REFERENCE = frame(0, 0, 2, *[0] * 4)


def words_of(witness):
    lines = pathlib.Path(witness).read_text().splitlines()
    return [None if word == "-" else bytes.fromhex(word)
            for line in lines if not line.startswith("#") for word in line.split()]


class Host(ctypes.Structure):
    _fields_ = [("abi_version", ctypes.c_uint32), ("firmware", ctypes.c_char_p), ("dialect", ctypes.c_char_p),
                ("context", ctypes.c_void_p),
                ("transmit", ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_int, ctypes.c_int64,
                                              ctypes.POINTER(ctypes.c_uint8), ctypes.c_size_t)),
                ("log", ctypes.c_void_p), ("parameters", ctypes.c_char_p), ("compute", ctypes.c_void_p)]


def drive(library, words):
    """What became of the client: clean, silent, insane, deaf or hasty. It may also take this process with it."""
    client_library = ctypes.CDLL(str(library))
    create, start, receive, grant = (getattr(client_library, f"tiltproof_client_{name}")
                                     for name in ("create", "start", "receive", "grant"))
    create.restype = ctypes.c_void_p
    start.restype = grant.restype = ctypes.c_int64
    start.argtypes = grant.argtypes = [ctypes.c_void_p, ctypes.c_int64]
    receive.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int64, ctypes.c_char_p, ctypes.c_size_t]
    requests, commands = [], []

    def transmit(_, uart, now, data, count):
        plain = bytes(data[:count]).strip(b"\x7e").replace(b"\x7d\x5e", b"\x7e").replace(b"\x7d\x5d", b"\x7d")
        numbers = struct.unpack(f"<{(len(plain) - 2) // 4}f", plain[:-2])
        if numbers == (2.0,):
            requests.append(now)
        elif numbers[0] == 3.0:
            commands.append(numbers[1:])
        return now + 10_850 * count

    host = Host(client_library.tiltproof_client_abi_version(), b"", b"paper", None, Host._fields_[4][1](transmit), None, None, None)
    client = create(ctypes.byref(host))
    wake = start(client, 0)
    end = (len(words) + 50) * PERIOD_NS
    answered = 0
    deaf = hasty = False
    while wake < end:
        for uart, said in ((1, REFERENCE), (0, None)):
            if uart == 0 and len(requests) > answered:
                said = words[answered] if answered < len(words) else None
                said = SENSORS if said is None else said
                answered = len(requests)
            if said is not None:
                before = len(commands)
                receive(client, uart, wake - PERIOD_NS + 1_000_000 + uart, said, len(said))
                grant(client, wake - PERIOD_NS + 1_000_000 + uart)
                deaf |= said is SENSORS and len(commands) == before
                hasty |= said is not SENSORS and len(commands) > before
        wake = grant(client, wake)
    for command in commands:
        if not all(math.isfinite(number) and abs(number) <= 100 for number in command):
            return "insane"
    if not commands or requests[-1] < end - 25 * PERIOD_NS:
        return "silent"
    return "deaf" if deaf else "hasty" if hasty else "clean"


def outcome(library, witness):
    done = subprocess.run([sys.executable, "-B", __file__, "drive", library, witness], capture_output=True, text=True)
    if done.returncode == -signal.SIGXCPU:
        return "hung"
    return "crashed" if done.returncode < 0 else done.stdout.strip() or done.stderr


class Witnesses(unittest.TestCase):
    def test_there_is_one_for_each_defect(self):
        self.assertEqual({file.stem for file in (HERE / "witness").glob("*.hex")}, set(OUTCOMES))
        self.assertEqual(len(OUTCOMES), 12)

    def test_each_shows_its_defect(self):
        for name, expected in OUTCOMES.items():
            with self.subTest(name):
                self.assertEqual(outcome(FOLDER / f"planted_{name}.so", HERE / f"witness/{name}.hex"), expected)

    def test_the_correct_client_survives_all(self):
        for name in OUTCOMES:
            with self.subTest(name):
                self.assertEqual(outcome(FOLDER / "planted_correct.so", HERE / f"witness/{name}.hex"), "clean")

    def test_valid_replies_show_nothing(self):
        for name in [*OUTCOMES, "correct"]:
            with self.subTest(name):
                self.assertEqual(outcome(FOLDER / f"planted_{name}.so", "/dev/null"), "clean")


if __name__ == "__main__":
    if sys.argv[1] == "drive":
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (3, 6))  # of the processor's time, of which an honest client needs 0.1 s
        print(drive(pathlib.Path(sys.argv[2]).resolve(), words_of(sys.argv[3])))
    else:
        FOLDER = pathlib.Path(sys.argv.pop(1))
        unittest.main()
