"""An image for the STM32F4 in the emulator by the machine's clock, with this process at the other end of its three lines.

    with Emulator("executive-paper.elf", plugin="tiltproof_lockstep.so") as board:
        for message in board.messages(until=lambda board: "first valid reply" in board.console):
            ...
"""
import pathlib
import select
import socket
import struct
import subprocess
import tempfile
import time
import zlib

FLAG, ESCAPE = 0x7E, 0x7D
WALL_CLOCK_MAX_S = 60  # of one run; the emulator may be many times slower than a board on a busy machine


def fletcher16(payload):
    sum1 = sum2 = 0
    for byte in payload:
        sum1 = (sum1 + byte) % 255
        sum2 = (sum2 + sum1) % 255
    return bytes([sum1, sum2])


def crc32(payload):
    return struct.pack("<I", zlib.crc32(payload))


def frame(payload, check=fletcher16):
    escaped = b"".join(bytes([ESCAPE, b ^ 0x20]) if b in (FLAG, ESCAPE) else bytes([b]) for b in payload + check(payload))
    return bytes([FLAG]) + escaped + bytes([FLAG])


def floats(*values):
    return struct.pack(f"<{len(values)}f", *values)


class Emulator:
    """`dialect` tells what a request is; `answers(n)` is the reply to request n (from 0), or None for none."""

    def __init__(self, image, plugin, dialect="paper", answers=lambda n: None, debugger=False):
        self.console = ""
        self.request_count = 0
        self.damaged_count = 0  # frames with a wrong check
        self._hardened = dialect == "hardened"
        self._check = crc32 if self._hardened else fletcher16
        # The begin of a request.
        self._request = bytes([2]) if self._hardened else floats(2 if dialect == "paper" else 1)
        self._request_bytes = 7 if self._hardened else 4
        self._answers = answers
        self._received = b""
        self._folder = tempfile.TemporaryDirectory()
        folder = pathlib.Path(self._folder.name)
        command = ["qemu-system-arm", "-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-plugin", f"{plugin},realtime=on",
                   "-kernel", str(image)]
        lines = ["console", "main", "reference"]  # USART1, 2, 3
        for name in lines:
            command += ["-chardev", f"socket,id={name},path={folder / name},server=on,wait=on", "-serial", f"chardev:{name}"]
        if debugger:
            command += ["-chardev", f"socket,id=gdb,path={folder / 'gdb'},server=on,wait=off", "-gdb", "chardev:gdb"]
        self._log = open(folder / "log", "w+")
        self._qemu = subprocess.Popen(command, stdout=self._log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
        self._lines = {name: self._connect(folder / name) for name in lines}
        self._debugger = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._qemu.kill()
        self._qemu.wait()
        for line in self._lines.values():
            line.close()
        if self._debugger:
            self._debugger.close()
        self._log.close()
        self._folder.cleanup()

    def _connect(self, path):
        line = socket.socket(socket.AF_UNIX)
        for _ in range(500):
            try:
                line.connect(str(path))
                return line
            except OSError:
                time.sleep(0.02)
        raise RuntimeError(f"the emulator does not open {path.name}: {self._said()}")

    def _said(self):
        self._log.seek(0)
        return self._log.read()

    def messages(self, until):
        """Payloads of the frames that the firmware sends, each after it has been answered, until `until(self)`."""
        end = time.monotonic() + WALL_CLOCK_MAX_S
        while not until(self):
            if time.monotonic() > end:
                raise RuntimeError(f"nothing more to wait for in {WALL_CLOCK_MAX_S} s; console:\n{self.console}")
            for line in select.select(list(self._lines.values()), [], [], 0.1)[0]:
                data = line.recv(4096)
                if not data:
                    raise RuntimeError(f"the emulator has left: {self._said()}\nconsole:\n{self.console}")
                if line is self._lines["console"]:
                    self.console += data.decode(errors="replace").replace("\r", "")
                elif line is self._lines["main"]:
                    yield from self._decode(data)

    def run(self, until):
        return list(self.messages(until))

    def send_reference(self, *values):
        self._lines["reference"].sendall(frame(floats(*values)))

    def _decode(self, data):
        *frames, self._received = (self._received + data).split(bytes([FLAG]))
        for escaped in frames:
            if not escaped:
                continue
            parts = escaped.split(bytes([ESCAPE]))
            payload = parts[0] + b"".join(bytes([part[0] ^ 0x20]) + part[1:] for part in parts[1:])
            size = len(payload) - len(self._check(b""))
            payload, check = payload[:size], payload[size:]
            if self._check(payload) != check:
                self.damaged_count += 1
                continue
            if payload.startswith(self._request) and len(payload) == self._request_bytes:
                reply = self._answers(self.request_count)
                if reply is not None:
                    header = struct.pack("<BHI", 4, self.request_count, 12000 * self.request_count) if self._hardened else b""
                    self._lines["main"].sendall(frame(header + reply, self._check))
                self.request_count += 1
            yield payload

    # --- The debugger's end (GDB remote serial protocol).

    def _ask(self, text):
        self._debugger.sendall(f"${text}#{sum(text.encode()) % 256:02x}".encode())
        answer = b""
        while b"#" not in answer or len(answer) < answer.index(b"#") + 3:
            answer += self._debugger.recv(4096)
            if b"$T" in answer:  # that the core stopped, once
                answer = answer[:answer.index(b"$T")] + answer[answer.index(b"#") + 3:]
        self._debugger.sendall(b"+")
        return answer.decode().lstrip("+")[1:-3]

    def stop(self):
        """Stops the core wherever it is."""
        self._debugger = self._connect(pathlib.Path(self._folder.name, "gdb"))  # this stops it
        self._debugger.settimeout(20)
        self._ask("qSupported:xmlRegisters=arm")
        self._ask("qXfer:features:read:target.xml:0,ffb")

    def set_register(self, number, value):
        self._set(f"P{number:x}={struct.pack('<I', value).hex()}")

    def write_memory(self, address, data):
        self._set(f"M{address:x},{len(data):x}:{data.hex()}")

    def _set(self, text):
        answer = self._ask(text)
        if answer != "OK":
            raise RuntimeError(f"the debugger's stub answers {answer!r} to {text}")

    def go(self):
        self._debugger.sendall(b"$c#63")
