"""tiltproof on three hosts: the nodes that wait for flights, and flights with them.

    fleet = Fleet(program, folder, seed=1)
    with fleet.flight(scenario_text) as flight:
        flight.wait_for("running")           # the monitor, on the third host, saw it
        fleet.network.set(between=["harness", "vehicle"], cut=True)
        results = flight.finish(limit_s=60)  # exit code, verdict, metrics, files
    fleet.close()

Host `vehicle` has plant, link and client, `harness` has `tiltproof run`, `watch` has base station and monitor. A fleet may
have other hosts and nodes:

    fleet = Fleet(program, folder, seed=1, hosts=["vehicle", "left"], nodes={"client-a": Node("left", "client", ("--id", "a"))})
"""
import contextlib
import csv
import json
import os
import pathlib
import select
import signal
import struct
import subprocess
import time
import typing

from network import INTERFACE, Network



class Node(typing.NamedTuple):
    host: str
    kind: str
    more: tuple = ()  # of its command


NODES = {kind: Node("vehicle", kind) for kind in ("plant", "link", "client")}
NODES |= {kind: Node("watch", kind) for kind in ("base-station", "monitor")}
END_LIMIT_S = 10


def wait_until(condition, limit_s, what):
    """The condition's value once it is true. Looks every 5 ms."""
    end = time.monotonic() + limit_s
    while not (value := condition()):
        if time.monotonic() > end:
            raise AssertionError(f"not within {limit_s} s: {what}")
        select.select([], [], [], 0.005)
    return value


def end_process(process):
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(END_LIMIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
    return process.wait()


class Fleet:
    def __init__(self, program, folder, seed, peers=False, hosts=("vehicle", "harness", "watch"), nodes=NODES):
        self.program, self.folder, self.places = program, folder, nodes
        self.flights_count = 0
        self.nodes, self.logs = {}, {}
        self.network = Network(list(hosts), seed)
        hosts = self.network.hosts
        self.bus = ["--interface", INTERFACE]
        if peers:
            self.bus += ["--peers", ",".join(host.address for host in hosts.values())]

    def start(self, *names):
        for name in names or self.places:
            # A node that is started again continues its log.
            self.logs[name] = self.folder / f"{name}.log"
            node = self.places[name]
            with open(self.logs[name], "ab") as log:
                self.nodes[name] = self.network.hosts[node.host].start(
                    [self.program, "node", node.kind, *node.more, *self.bus], log)

    def kill(self, kind):
        self.nodes[kind].kill()
        self.nodes[kind].wait()

    def read(self, kind):
        return self.logs[kind].read_text()

    @contextlib.contextmanager
    def flight(self, scenario):
        self.flights_count += 1
        flight = Flight(self, scenario, self.folder / f"flight{self.flights_count}")
        try:
            yield flight
        finally:
            end_process(flight.process)

    def close(self):
        for process in self.nodes.values():
            if process.poll() is None:
                process.terminate()
        for process in self.nodes.values():
            end_process(process)
        self.network.close()


class Flight:
    """One `tiltproof run` of one scenario with the fleet's nodes."""

    def __init__(self, fleet, scenario, folder):
        self.fleet, self.folder = fleet, folder
        folder.mkdir()
        (folder / "flight.yaml").write_text(scenario)
        self.log_begin = len(fleet.read("monitor"))
        self.began = time.monotonic()
        with open(folder / "run.log", "wb") as log:
            self.process = fleet.network.hosts["harness"].start(
                [fleet.program, "run", folder / "flight.yaml", "--mode", "realtime", "--attach", *fleet.bus, "--out", folder,
                 "--no-progress"], log)

    def seen(self):
        """What the monitor printed since this flight began."""
        return self.fleet.read("monitor")[self.log_begin:]

    def wait_for(self, text, limit_s=20):
        """Until the monitor has printed it. Returns the time since the harness was started."""
        self._await(lambda: text in self.seen(), limit_s, f"the monitor sees {text!r}")
        return time.monotonic() - self.began

    def wait_for_sim_time(self, time_s, limit_s=20):
        """Until the monitor has printed a state of the vehicle at that time of the simulation or later."""
        self.wait_for("running", limit_s)

        def seen():
            # The monitor shows the vehicle once a second: what comes first may still be the last state of the flight before.
            lines = [line.split() for line in self.seen().partition("running")[2].splitlines() if line.startswith("plant ")]
            times_s = [float(line[1]) for line in lines if len(line) > 1]
            return any(own_s != times_s[0] and own_s >= time_s for own_s in times_s)
        self._await(seen, limit_s, f"the monitor sees the vehicle at {time_s} s")

    def _await(self, condition, limit_s, what):
        def look():
            ended = self.process.poll() is not None
            if condition():
                return True
            if ended:
                raise AssertionError(f"the flight ended before {what}:\n{self.output()}\n{self.seen()}")
            return False
        wait_until(look, limit_s, what)

    def output(self):
        return (self.folder / "run.log").read_text()

    def crash(self):
        os.kill(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def finish(self, limit_s):
        try:
            code = self.process.wait(limit_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"the flight did not end within {limit_s} s:\n{self.output()}\n{self.seen()}") from None
        return Results(code, self.folder / "latest")


class Results:
    """A results folder, which must be whole and valid whatever happened."""

    def __init__(self, code, folder):
        self.code = code
        results = json.loads((folder / "results.json").read_text())
        json.loads((folder / "run.json").read_text())
        self.scenario, = results["scenarios"]
        self.verdict, self.reason = self.scenario["verdict"], self.scenario["reason"]
        self.metrics = self.scenario["metrics"]
        self.folder = folder / self.scenario["name"]
        if json.loads((self.folder / "verdict.json").read_text())["verdict"] != self.verdict:
            raise AssertionError("verdict.json and results.json disagree")
        events = (folder / "events.jsonl").read_text() if (folder / "events.jsonl").exists() else ""
        self.events = [json.loads(line) for line in events.splitlines()]

    def row_times_s(self):
        with open(self.folder / "trace.csv", newline="") as file:
            return [float(row["t_s"]) for row in csv.DictReader(file)]

    def frames(self):
        """The records of link.bin: (begin_ns, direction, delivered, bytes)."""
        content = (self.folder / "link.bin").read_bytes()
        if content[:8] != b"TPLINK2\n":
            raise AssertionError("link.bin has a wrong beginning")
        offset, frames = 8, []
        while offset < len(content):
            begin_ns, _, direction, delivered, size = struct.unpack_from("<qBBBH", content, offset)
            offset += 13
            frames.append((begin_ns, direction, bool(delivered), content[offset:offset + size]))
            offset += size
        if offset != len(content):
            raise AssertionError("link.bin ends within a record")
        return frames
