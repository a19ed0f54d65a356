#!/usr/bin/env python3
"""Flights that wait for a debugger. It is played by a few lines of GDB's remote protocol, and by ptrace for a library.
Usage: debug_test.py TILTPROOF SOURCE_DIR"""
import ctypes
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

from remote_debugger import RemoteDebugger, free_port

PROGRAM, SOURCE = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(2))
PTRACE_CONT, PTRACE_ATTACH = 7, 16
WALL = 0x40000000
SCENARIO = """\
name: hover
duration_s: 3
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""


def is_running(pid):
    """No zombie, which may be waiting for another process to take note."""
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def wait_until(condition, what):
    end = time.monotonic() + 20
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"not within 20 s: {what}")
        time.sleep(0.05)


class DebugTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-debug-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        (self.folder / "hover.yaml").write_text(SCENARIO)

    def start(self, *arguments):
        """Until it says that it waits. Returns the process and the line."""
        run = subprocess.Popen([PROGRAM, "run", "hover.yaml", "--format", "jsonl", *arguments], cwd=self.folder, text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(run.wait)
        self.addCleanup(run.kill)
        self.addCleanup(run.stdout.close)
        self.addCleanup(run.stderr.close)
        for line in run.stderr:
            if "debugger" in line:
                return run, line
        self.fail("it does not wait")

    def result(self, run):
        out, err = run.communicate(timeout=120)
        self.assertEqual(run.returncode, 0, err)
        return json.loads(out.splitlines()[0])

    def fly(self, *arguments):
        return self.result(subprocess.Popen([PROGRAM, "run", "hover.yaml", "--format", "jsonl", *arguments], cwd=self.folder, text=True,
                                            stdout=subprocess.PIPE, stderr=subprocess.PIPE))

    def test_emulated_processor_at_power_on(self):
        port = free_port()
        run, line = self.start("--client", "qemu", "--gdb", str(port))
        self.assertIn(f"target remote :{port}", line)
        debugger = RemoteDebugger(port)
        self.assertRegex(debugger.ask("?"), "^T05")
        # At the reset vector: the second word of the image's table, without its Thumb bit.
        self.assertEqual(debugger.program_counter(), int.from_bytes(bytes.fromhex(debugger.ask("m8000004,4")), "little") & ~1)
        debugger.send("c")
        self.assertIsNone(debugger.packet())
        debugger.socket.close()
        self.assertEqual(self.result(run)["trace_hash"], self.fly("--client", "qemu")["trace_hash"])

    def test_emulated_processor_in_flight(self):
        seen = []
        for _ in range(2):
            port = free_port()
            run, line = self.start("--client", "qemu", "--gdb", str(port), "--gdb-at", "1.5")
            self.assertIn("at 1.5 s of the flight", line)
            # It may be there before the time: then it is stopped twice.
            seen.append(RemoteDebugger(port).registers_at_stops()[-1])
            result = self.result(run)
        self.assertEqual(*seen)
        self.assertEqual(result["trace_hash"], self.fly("--client", "qemu")["trace_hash"])

    def test_library(self):
        results = []
        for arguments in ((), ("--gdb-at", "1.5")):
            run, line = self.start("--gdb", *arguments)
            pid = int(re.search(r"gdb -p (\d+)", line).group(1))
            libc = ctypes.CDLL(None, use_errno=True)
            self.assertEqual(libc.ptrace(PTRACE_ATTACH, pid, None, None), 0, os.strerror(ctypes.get_errno()))
            os.waitpid(pid, WALL)
            # Once it has a debugger it goes on; signals of its own are passed on.
            signal_number = 0
            while libc.ptrace(PTRACE_CONT, pid, None, signal_number) == 0:
                _, status = os.waitpid(pid, WALL)
                if not os.WIFSTOPPED(status):
                    break
                signal_number = os.WSTOPSIG(status)
            results.append(self.result(run)["trace_hash"])
        self.assertEqual(set(results), {self.fly()["trace_hash"]})

    def family(self, pid):
        """Of a process and all that it has started."""
        children = pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return [pid, *(one for child in children for one in self.family(int(child)))]

    def test_the_end_of_a_run_that_waits(self):
        for client, at in (("qemu", ()), ("qemu", ("--gdb-at", "0.5")), ("host", ()), ("host", ("--gdb-at", "0.5"))):
            for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 130), (signal.SIGKILL, -signal.SIGKILL)):
                with self.subTest(client=client, at=at, signal=number.name):
                    out = self.folder / "out"
                    shutil.rmtree(out, ignore_errors=True)
                    port = (str(free_port()),) if client == "qemu" else ()
                    run, _ = self.start("--client", client, "--gdb", *port, *at, "--out", out)
                    # Nothing tells that it has flown as far as that.
                    time.sleep(0.5 if at else 0)
                    wait_until(lambda: len(self.family(run.pid)) >= (3 if client == "qemu" else 2), "its processes")
                    family = self.family(run.pid)
                    run.send_signal(number)
                    self.assertEqual(run.wait(20), code)
                    wait_until(lambda: not any(is_running(pid) for pid in family), f"the end of {family}")
                    for file in ("run.json", "results.json"):
                        self.assertTrue(json.loads((out / "latest" / file).read_text())["interrupted"], file)
                    [result] = json.loads((out / "latest/results.json").read_text())["scenarios"]
                    self.assertFalse(result["green"], result)

    def test_port_that_is_taken(self):
        with socket.create_server(("127.0.0.1", 0)) as server:
            run = subprocess.run([PROGRAM, "run", "hover.yaml", "--client", "qemu", "--gdb", str(server.getsockname()[1])], cwd=self.folder,
                                 capture_output=True, text=True, check=False, timeout=120)
        self.assertEqual(run.returncode, 3)
        self.assertIn("Address already in use", run.stdout + run.stderr)

    def test_what_cannot_be_debugged(self):
        for arguments, reason in ((["--repeat", "2"], "2 flights"), (["--mode", "realtime"], "only in lockstep"), (["--distributed"], "only in lockstep")):
            run = subprocess.run([PROGRAM, "run", "hover.yaml", *arguments, "--gdb"], cwd=self.folder, capture_output=True, text=True, check=False,
                                 timeout=120)
            self.assertEqual(run.returncode, 2)
            self.assertIn(reason, run.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
