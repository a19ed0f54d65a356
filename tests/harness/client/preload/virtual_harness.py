"""The harness's end of a program under the virtual clock, for tests: it grants time, and plays the other end of the ports.

    flight = Flight(clock, ["./prog", "{port}"], inputs=[(5_000_000, 0, b"abc")], until_ns=100_000_000)
    flight.sent      # [(ns, uart, bytes), ...]
    flight.refused   # the reason, or None
"""
import os
import pathlib
import select
import socket
import struct
import subprocess
import tempfile
import time

NEVER = 2**63 - 1
HELLO, GRANT, BYTES, RESET, SENT, END = range(1, 7)
READY, WAITING, TRANSMIT, STATUS, ROLE, LOG, REFUSED = range(0x81, 0x88)


def message(kind, body=b"", number=0):
    return struct.pack("<IBBBB", len(body), kind, number, 0, 0) + body


class Flight:
    """Flies at once; `code` is how the program ended, None when the flight's end ended it."""

    def __init__(self, clock, command, inputs=(), until_ns=10**10, wall_s=20, baud=115200, environment=None, start_ns=0, shell=True):
        self.sent, self.logs, self.waits = [], [], []
        self.refused, self.code, self.exchanges, self.output = None, None, 0, ""
        self.inputs, self.until_ns, self.baud, self.start_ns = sorted(inputs), until_ns, baud, start_ns
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "s")
            ports = ["/dev/tiltproof0", "/dev/tiltproof1"]
            listener = socket.socket(socket.AF_UNIX)
            listener.bind(path)
            listener.listen(1)
            listener.settimeout(wall_s)
            own = dict(os.environ, TILTPROOF_SOCKET=path, TILTPROOF_PORT=ports[0], TILTPROOF_REFERENCE_PORT=ports[1], LD_PRELOAD=str(pathlib.Path(clock).absolute()))
            own.update(environment or {})
            words = [word.format(port=ports[0], reference_port=ports[1], baud=baud) for word in command]
            with tempfile.TemporaryFile() as output:
                self.process = subprocess.Popen(["sh", "-c", 'exec "$@"', "sh", *words] if shell else words, env=own, stdout=output, stderr=subprocess.STDOUT,
                                                stdin=subprocess.DEVNULL, start_new_session=True)
                deadline = time.monotonic() + wall_s
                try:
                    while not select.select([listener], [], [], 0.02)[0]:
                        if self.process.poll() is not None or time.monotonic() > deadline:
                            return
                    self.line, _ = listener.accept()
                    self.line.settimeout(wall_s)
                    listener.close()
                    self.buffer = b""
                    self.fly()
                    self.line.close()
                    self.code = self.process.wait(5)
                finally:
                    self.process.kill()
                    self.process.wait()
                    listener.close()
                    output.seek(0)
                    self.output = output.read().decode(errors="replace")

    def read(self):
        while len(self.buffer) < 8 or len(self.buffer) < 8 + struct.unpack_from("<I", self.buffer)[0]:
            received = self.line.recv(65536)
            if not received:
                raise EOFError
            self.buffer += received
        length, kind, number = struct.unpack_from("<IBB", self.buffer)
        body, self.buffer = self.buffer[8 : 8 + length], self.buffer[8 + length :]
        return kind, number, body

    def fly(self):
        rates = struct.pack("<II", self.baud, 10) * 2
        try:
            self.line.sendall(message(HELLO, struct.pack("<II", 1, 2) + rates + struct.pack("<III", 0, 0, 0)))
            now_ns = self.start_ns
            self.line.sendall(message(GRANT, struct.pack("<q", now_ns)))
            while True:
                kind, number, body = self.read()
                if kind == TRANSMIT:
                    self.sent.append((struct.unpack_from("<q", body)[0], number, body[8:]))
                elif kind == LOG:
                    self.logs.append(body[8:].decode())
                elif kind == REFUSED:
                    self.refused = body.decode()
                elif kind == WAITING:
                    (until_ns,) = struct.unpack("<q", body)
                    self.exchanges += 1
                    self.waits.append((now_ns, until_ns))
                    at_ns = min([until_ns, self.until_ns] + [when for when, _, _ in self.inputs[:1]])
                    if at_ns >= self.until_ns:
                        self.line.sendall(message(END))
                        return
                    now_ns, answer = max(now_ns, at_ns), b""
                    while self.inputs and self.inputs[0][0] <= now_ns:
                        when, uart, data = self.inputs.pop(0)
                        answer += message(BYTES, struct.pack("<q", when) + data, uart)
                    self.line.sendall(answer + message(GRANT, struct.pack("<q", now_ns)))
        except (EOFError, ConnectionError):
            pass
