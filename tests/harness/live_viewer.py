"""A viewer of a live page, over plain sockets: what the tests of `run --live` and `node monitor --http` look through."""
import http.client
import json
import re
import socket
import subprocess
import threading
import time


class LiveCommand:
    """A command that serves a live page, and its address as soon as it is printed."""

    def __init__(self, program, folder, *arguments):
        self.process = subprocess.Popen([program, *map(str, arguments)], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.errors = ""
        self.port, self.token = None, ""
        self.printed = threading.Event()
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()
        self.drain = threading.Thread(target=lambda: setattr(self, "output", self.process.stdout.read()), daemon=True)
        self.drain.start()

    def read(self):
        for line in self.process.stderr:
            self.errors += line
            found = re.search(r"http://127\.0\.0\.1:(\d+)/(?:#token=([0-9a-f]+))?", line)
            if found:
                self.port, self.token = int(found.group(1)), found.group(2) or ""
                self.printed.set()
        self.printed.set()

    def wait_page(self):
        assert self.printed.wait(60) and self.port, self.errors
        return self

    def wait(self, timeout_s=120):
        code = self.process.wait(timeout_s)
        self.reader.join(10)
        self.drain.join(10)
        return code

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    def request(self, method, path, body=None, headers=None, host=None):
        """Status, headers, body."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        try:
            connection.putrequest(method, path, skip_host=True)
            connection.putheader("Host", host or f"127.0.0.1:{self.port}")
            for key, value in (headers or {}).items():
                connection.putheader(key, value)
            data = body.encode() if body is not None else b""
            if body is not None or method == "POST":
                connection.putheader("Content-Length", str(len(data)))
            connection.endheaders(data or None)
            response = connection.getresponse()
            return response.status, dict(response.getheaders()), response.read().decode()
        finally:
            connection.close()

    def press(self, button, body="", token=None):
        status, _, text = self.request("POST", f"/{button}", body, {"X-Tiltproof-Token": self.token if token is None else token})
        return status, text


class Viewer:
    """Reads the events of a page until it ends."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=120)
        self.socket.sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        self.events = []  # (name, data)
        self.thread = threading.Thread(target=self.read, daemon=True)
        self.thread.start()

    def read(self):
        stream = self.socket.makefile("r", encoding="utf-8", newline="\n")
        name = None
        try:
            for line in stream:
                if line.startswith("event: "):
                    name = line[7:].strip()
                elif line.startswith("data: "):
                    self.events.append((name, json.loads(line[6:])))
        except OSError:
            pass
        stream.close()
        self.socket.close()

    def of(self, name):
        return [data for event, data in list(self.events) if event == name]

    def rows(self):
        return [row for data in self.of("rows") for row in data["rows"]]

    def wait_for(self, condition, what, timeout_s=60):
        end = time.monotonic() + timeout_s
        while not condition(self):
            assert time.monotonic() < end, f"not within {timeout_s} s: {what}; events {[e for e, _ in self.events][-20:]}"
            time.sleep(0.01)
        return self


class DeafViewer:
    """Asks for the events, and never reads one."""

    def __init__(self, port):
        self.socket = socket.socket()
        # Few bytes wait on this side, so that the server's writes come to a stand.
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        self.socket.connect(("127.0.0.1", port))
        self.socket.sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
