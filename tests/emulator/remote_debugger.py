"""A debugger at the emulated board, as a few lines of GDB's remote protocol.

    debugger = RemoteDebugger(port)
    debugger.ask("?")              # it has stopped the processor
    debugger.program_counter()
"""
import re
import socket
import time


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


class RemoteDebugger:
    """GDB's remote serial protocol (GDB manual, appendix E)."""

    def __init__(self, port):
        # The emulator opens the port a moment after the flight says that it waits.
        end = time.monotonic() + 60
        while True:
            try:
                self.socket = socket.create_connection(("127.0.0.1", port), timeout=60)
                break
            except ConnectionRefusedError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.02)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.received = b""

    def send(self, text):
        body = text.encode()
        self.socket.sendall(b"$" + body + b"#%02x" % (sum(body) & 255))

    def packet(self):
        """The next one; none when the emulator is gone."""
        while not (packet := re.search(rb"\$([^#]*)#..", self.received)):
            try:
                got = self.socket.recv(4096)
            except ConnectionResetError:
                got = b""
            if not got:
                return None
            self.received += got
        self.received = self.received[packet.end():]
        self.socket.sendall(b"+")
        return packet.group(1).decode()

    def ask(self, text):
        self.send(text)
        return self.packet()

    def registers(self):
        answer = self.ask("g")
        while answer.startswith("T"):  # it had not quite stopped
            answer = self.packet()
        return answer

    def program_counter(self):
        return int.from_bytes(bytes.fromhex(self.registers())[60:64], "little")

    def registers_at_stops(self):
        """All registers at each stop, until the flight is over. The first is that of the connection."""
        stops = []
        self.ask("?")
        while True:
            stops.append(self.registers())
            self.send("c")
            if self.packet() is None:
                self.socket.close()
                return stops
