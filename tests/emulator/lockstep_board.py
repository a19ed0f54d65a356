"""An image in the emulator with the plug-in, in lockstep, with this process as the harness (harness/emulator/lockstep_protocol.h).

    board = LockstepBoard(plugin, image)
    board.run(until_ns=20_000_000)
    board.console, board.sent  # text of USART1; (time in ns, byte) of USART2
"""
import os
import pathlib
import re
import socket
import struct
import subprocess

PROTOCOL = (pathlib.Path(__file__).parents[2] / "harness/emulator/lockstep_protocol.h").read_text()
KINDS = re.findall(r"^  k(\w+),", PROTOCOL[PROTOCOL.index("enum class Kind"):PROTOCOL.index("struct Header")], re.MULTILINE)
RECEIVE, RUN, HELLO, TRANSMIT, USART, STOPPED = map(KINDS.index, ("Receive", "Run", "Hello", "Transmit", "Usart", "Stopped"))
MAIN, REFERENCE, CONSOLE = 0, 1, 2
NONE, OVERRUN, FRAMING, NOISE, PARITY = range(5)
COMMAND = ["qemu-system-arm", "-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-nodefaults", "-icount", "shift=3,sleep=off"]


class LockstepBoard:
    """`barrier`: the byte at which the board stops when it has sent it. `on_stop(board)`: called then."""

    def __init__(self, plugin, image, barrier=0x7E, more="", on_stop=lambda board: None):
        self.console = ""
        self.sent = []
        self.usart = None  # of the main line: BRR, CR1, CR2, CR3, its clock
        self._on_stop = on_stop
        self._socket, far = socket.socketpair()
        self._socket.settimeout(60)
        arguments = f"{plugin},socket=3,barrier={barrier},main=2,reference=3,console=1{more}"

        def pass_socket():
            os.dup2(far.fileno(), 3)

        self._qemu = subprocess.Popen([*COMMAND, "-plugin", arguments, "-kernel", str(image)], stdin=subprocess.DEVNULL,
                                      pass_fds=[3] if far.fileno() == 3 else [far.fileno(), 3], preexec_fn=pass_socket)
        far.close()
        self._expect(HELLO)
        self.now_ns = 0

    def close(self):
        self._socket.close()
        self._qemu.kill()
        self._qemu.wait()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def receive(self, at_ns, word, mark=NONE, usart=MAIN):
        self._send(RECEIVE, struct.pack("<qHBB?3x", at_ns, word, usart, mark, False))

    def run(self, until_ns):
        while self.now_ns < until_ns:
            self._send(RUN, struct.pack("<qqqq", until_ns, 0, 0, 0))
            self.now_ns = struct.unpack_from("<q", self._expect(STOPPED))[0]
            self._on_stop(self)

    def _send(self, kind, body):
        self._socket.sendall(struct.pack("<II", kind, len(body)) + body)

    def _read(self, size):
        data = b""
        while len(data) < size:
            part = self._socket.recv(size - len(data))
            if not part:
                raise RuntimeError(f"the emulator has left; console:\n{self.console}")
            data += part
        return data

    def _expect(self, wanted):
        while True:
            kind, size = struct.unpack("<II", self._read(8))
            body = self._read(size)
            if kind == TRANSMIT:
                for at, usart, byte in struct.iter_unpack("<qBB6x", body):
                    if usart == CONSOLE:
                        self.console += chr(byte)
                    elif usart == MAIN:
                        self.sent.append((at, byte))
            elif kind == USART and body[0] == MAIN:
                self.usart = struct.unpack("<4x5I", body)
            if kind == wanted:
                return body
