"""One `tiltproof run --mode realtime` under the eyes of a test: its processes, how it ended, what it left behind.

    flight = Flight(program, folder, "hover.yaml", "--client", "process:...")
    flight.wait_flying()
    os.kill(flight.nodes()["plant"], signal.SIGKILL)
    code = flight.wait(20)
    flight.check_results(self), flight.check_nothing_left(self)

This process becomes the reaper of orphans (PR_SET_CHILD_SUBREAPER), so that what a killed run leaves behind is seen.
"""
import ctypes
import json
import os
import pathlib
import re
import signal
import subprocess
import time
import uuid
import xml.etree.ElementTree

PR_SET_CHILD_SUBREAPER = 36
MARK = "TILTPROOF_TEST_FLIGHT"

HOVER = """\
name: NAME
duration_s: DURATION
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


def become_subreaper():
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def wait_until(condition, timeout_s, what):
    """Polls; a condition of the machine that nothing announces."""
    end = time.monotonic() + timeout_s
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError(f"not within {timeout_s} s: {what() if callable(what) else what}")
        time.sleep(0.005)


def parent_of(pid):
    """None: it has ended."""
    words = read(f"/proc/{pid}/stat").rpartition(b")")[2].split()
    return int(words[1]) if words else None


def read(path):
    try:
        return pathlib.Path(path).read_bytes()
    except OSError:
        return b""


def write_hover(folder, name="hover", duration_s=6):
    path = pathlib.Path(folder) / f"{name}.yaml"
    path.write_text(HOVER.replace("NAME", name).replace("DURATION", str(duration_s)))
    return path


class Flight:
    def __init__(self, program, folder, *arguments, stdin=subprocess.DEVNULL, user=None, pass_fds=(), environment=None):
        self.folder = pathlib.Path(folder)
        self.program = program
        self.mark = f"{MARK}={uuid.uuid4()}".encode()
        self.temporary = self.folder / "tmp"
        self.temporary.mkdir(exist_ok=True)
        self.shared_before = set(os.listdir("/dev/shm"))
        self.out, self.err = self.folder / "stdout", self.folder / "stderr"
        name, value = self.mark.decode().split("=")
        self.results = self.folder / "results"
        self.terminals = {}
        with open(self.out, "wb") as out, open(self.err, "wb") as err:
            self.process = subprocess.Popen(
                [program, "run", *map(str, arguments), "--mode", "realtime", "--no-progress", "--out", self.results],
                stdin=stdin, stdout=out, stderr=err, cwd=self.folder, user=user, pass_fds=pass_fds,
                env={**os.environ, name: value, "TMPDIR": str(self.temporary), "NO_COLOR": "1", **(environment or {})})

    # its processes

    def processes(self):
        """Of all of them, whoever their parent is by now: {pid: command line}. A zombie has no environment any more."""
        found = {}
        for entry in os.listdir("/proc"):
            if entry.isdigit() and self.mark in read(f"/proc/{entry}/environ").split(b"\0"):
                found[int(entry)] = read(f"/proc/{entry}/cmdline").decode(errors="replace").split("\0")
        return found

    def zombies(self):
        """Children that this process has inherited and not yet reaped."""
        children = read(f"/proc/{os.getpid()}/task/{os.getpid()}/children").split()
        return [int(pid) for pid in children if re.search(rb"\) Z ", read(f"/proc/{int(pid)}/stat"))]

    def nodes(self):
        """{"plant": pid, ..., "worker": pid, "main": pid}; with several clients "link-a", "client-a" """
        nodes = {"main": self.process.pid}
        processes = self.processes()
        for pid, command in processes.items():
            if len(command) > 2 and command[1] == "node":
                # A process that a node starts has the node's words until it executes its own.
                if processes.get(parent_of(pid)) == command:
                    continue
                of_client = "-" + command[command.index("--id") + 1] if "--id" in command else ""
                nodes[command[2].replace("-", "_") + of_client] = pid
            elif pid != self.process.pid and command[1:2] == ["run"]:
                nodes["worker"] = pid
        return nodes

    def place(self):
        """Domain and tag of its bus, as soon as run.json says them."""
        bus = self.bus()
        return [str(bus["domain"]), bus["tag"]]

    def _note_terminals(self, pid):
        """Path and birth of the pseudo-terminals that a process has open."""
        held = []
        try:
            for descriptor in os.listdir(f"/proc/{pid}/fd"):
                path = os.readlink(f"/proc/{pid}/fd/{descriptor}")
                if re.fullmatch(r"/dev/pts/\d+", path):
                    held.append(path)
                    self.terminals.setdefault(path, os.stat(path).st_ctime)
        except OSError:
            pass
        return held

    def wait_flying(self, count=6, timeout_s=20):
        """Until the plant has opened its port: the last that happens before the start."""
        def armed():
            if self.process.poll() is not None:
                raise AssertionError(f"ended with code {self.process.returncode} before it flew: {self.text()}")
            nodes = self.nodes()
            if len(nodes) < count:
                return False
            for pid in nodes.values():
                self._note_terminals(pid)
            return bool(self._note_terminals(nodes["plant"]))
        wait_until(armed, timeout_s, lambda: f"the plant's port was not opened: {self.nodes()}, {self.text()}")
        self.armed_at = time.monotonic()
        return self.nodes()

    def wait_fly_for(self, seconds):
        """Until this long after wait_flying; the flight must still be going on then."""
        while time.monotonic() < self.armed_at + seconds:
            try:
                self.process.wait(max(0.0, self.armed_at + seconds - time.monotonic()))
            except subprocess.TimeoutExpired:
                return self.nodes()
            return None
        return self.nodes()

    def wait(self, timeout_s):
        return self.process.wait(timeout_s)

    def end(self):
        """For tests' clean-up: whatever is left."""
        for pid in [*self.processes(), self.process.pid]:
            try:
                os.kill(pid, signal.SIGKILL)
            except OSError:
                pass
        self.process.wait()

    def text(self):
        return (read(self.out) + read(self.err)).decode(errors="replace")

    # its results

    @property
    def run_folder(self):
        return (self.results / "latest").resolve()

    def run_results(self):
        return json.loads(read(self.run_folder / "results.json"))["scenarios"]

    def result(self):
        return self.run_results()[0]

    def bus(self, timeout_s=20):
        """Where run.json says, while it flies, that the first flight is: {"domain": ..., "tag": ..., "run_id": ...}"""
        def known():
            if self.process.poll() is not None:
                raise AssertionError(f"ended with code {self.process.returncode} before it was on the bus: {self.text()}")
            text = read(self.run_folder / "run.json")
            return text and json.loads(text)["flights"][0].get("bus")
        return wait_until(known, timeout_s, lambda: f"run.json names no place on the bus: {self.text()}")

    def events(self, kind=None):
        lines = map(json.loads, read(self.run_folder / "events.jsonl").splitlines())
        return [line for line in lines if kind is None or line["kind"] == kind]

    def check_results(self, test, finished=True):
        """Every file that a run must leave parses, and they agree."""
        run = json.loads(read(self.run_folder / "run.json"))
        results = json.loads(read(self.run_folder / "results.json"))
        junit = xml.etree.ElementTree.fromstring(read(self.run_folder / "junit.xml"))
        self.events()
        interrupted = self.process.returncode in (130, -signal.SIGKILL)
        test.assertEqual((run["interrupted"], results["interrupted"]), (interrupted, interrupted))
        test.assertEqual(junit[0].get("tests"), str(len(results["scenarios"])))
        test.assertFalse(list(self.run_folder.rglob("*.part")))
        flown = [result for result in results["scenarios"] if not result["reason"].startswith("not flown")]
        for result in flown:
            scenario = self.run_folder / result["name"]
            test.assertTrue(read(scenario / "scenario.resolved.yaml"), result)
            verdict = json.loads(read(scenario / "verdict.json"))
            for key in ("files", "hash"):
                verdict.pop(key, None)
            test.assertEqual(verdict, result)
            if (scenario / "flight.json").exists():
                for file in ("flight.json", "faults.jsonl"):
                    for line in read(scenario / file).decode().splitlines() if file.endswith("l") else [read(scenario / file)]:
                        json.loads(line)
                rows = read(scenario / "trace.csv").decode().splitlines()
                test.assertEqual({row.count(",") for row in rows}, {rows[0].count(",")})
        if not finished:
            test.assertEqual({result["verdict"] for result in results["scenarios"]}, {"error"})
        self.check_score(test, flown)

    def column(self, name, column):
        """Of a scenario's trace, as text; empty when it has no such column."""
        rows = [row.split(",") for row in read(self.run_folder / name / "trace.csv").decode().splitlines()]
        return [row[rows[0].index(column)] for row in rows[1:]] if column in rows[0] else []

    def check_score(self, test, results):
        """`score` comes to the same verdict, or says why it cannot."""
        done = subprocess.run([self.program, "score", self.run_folder, "--format", "jsonl"], capture_output=True, timeout=60, check=False)
        again = {entry["name"]: entry for entry in map(json.loads, done.stdout.decode().splitlines())}
        for result in results:
            entry = again[result["name"]]
            if (self.run_folder / result["name"] / "flight.json").exists() and "ended the worker process" not in result["reason"]:
                test.assertEqual((entry["verdict"], entry["reason"]), (result["verdict"], result["reason"]))
            else:
                test.assertTrue(entry["reason"], entry)
        if not results:
            test.assertTrue(done.stdout or done.stderr)
            test.assertIn(done.returncode, (2, 3), done)

    # what it left behind

    def check_nothing_left(self, test, timeout_s=5):
        """No process, no zombie, no pseudo-terminal, no shared memory, no temporary file."""
        test.assertIsNotNone(self.process.poll(), "it has not ended yet")

        def gone():
            for pid in self.zombies():
                if pid != self.process.pid:
                    os.waitpid(pid, 0)
            # A process that ends loses its environment a moment before its descriptors.
            return not self.processes() and not any(map(still_there, self.terminals))

        def still_there(path):
            try:
                # A later one of that name belongs to another process.
                return os.stat(path).st_ctime <= self.terminals[path]
            except OSError:
                return False
        wait_until(gone, timeout_s,
                   lambda: f"left running: {self.processes()}, left open: {[path for path in self.terminals if still_there(path)]}")
        test.assertLessEqual(set(os.listdir("/dev/shm")), self.shared_before)
        test.assertEqual(list(self.temporary.iterdir()), [])
