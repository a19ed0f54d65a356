#!/usr/bin/env python3
"""Unmodified programs in lockstep (`--client clocked:CMD`), as a user sees them: the bits of a library, the same ones in every
flight, and what becomes of programs that the virtual clock cannot hold. Usage: clocked_test.py TILTPROOF SOURCE_DIR CLIENTS_DIR"""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest

from command_line import PROGRAM
from program_flights import ProgramFlights

SOURCE, CLIENTS = (pathlib.Path(word).resolve() for word in sys.argv[2:4])
LIBRARY = f"library:{PROGRAM.parent / 'lib/minimal_firmware.so'}"
POSIX = f"{PROGRAM.parent / 'lib/posix_firmware'} {{port}} {{reference_port}} {{baud}}"
WAITING = CLIENTS / "waiting_program"
HOVER = f"exec {sys.executable} {SOURCE}/firmware/examples/python/hover.py design {{port}} {{reference_port}}"

FAULTS = {
    "clean": "",
    "late": "{id: late, type: frame.delay, target: to_client, start_s: 0.2, parameters: {mean_ms: 5}}",
    "noise": "{id: noise, type: wire.bit_error, target: both, start_s: 0.1, parameters: {ber: 1.0e-3}}",
    "drift": "{id: drift, type: clock.drift, start_s: 0.1, parameters: {node: client, ppm: 5000}}",
    "task": "{id: task, type: device.task_delay, start_s: 0.1, parameters: {delay_ms: 4, every_ms: 25}}",
}


class ClockedTest(ProgramFlights):
    def write(self, names):
        for name in names:
            fault = FAULTS[name]
            self.scenario(name, **({"criteria:": f"faults:\n  - {fault}\ncriteria:"} if fault else {}))
        return [f"{name}.yaml" for name in names]

    def test_a_posix_program_has_the_bits_of_a_library(self):
        paths = self.write(FAULTS)
        _, text, library = self.flown(*paths, client=LIBRARY)
        hashes = {name: entry["trace_hash"] for name, entry in library.items()}
        self.assertEqual(set(hashes), set(FAULTS), text)
        for flags in ([], ["-j", "2"], ["--distributed=socket"]):
            _, text, clocked = self.flown(*paths, client=f"clocked:{POSIX}", flags=flags)
            self.assertEqual({name: entry["trace_hash"] for name, entry in clocked.items()}, hashes, (flags, text))
        self.await_none()

    def test_a_command_is_read_as_a_shell_reads_it(self):
        self.write(["clean"])
        (self.folder / "my firmware (2)").mkdir()
        shutil.copy(POSIX.split()[0], self.folder / "my firmware (2)/fw")
        ports = POSIX.split(maxsplit=1)[1]
        hashes = set()
        for command in (f"'./my firmware (2)/fw' {ports}", f"./my\\ firmware\\ \\(2\\)/fw {ports}", f'NAME="a b;c" "./my firmware (2)/fw" {ports} 2>&1',
                        f"$PWD/my?firmware*/fw {ports}", f"true; cd . && exec './my firmware (2)/fw' {ports}"):
            code, text, results = self.flown("clean.yaml", client=f"clocked:{command}")
            self.assertEqual((code, results["clean"]["verdict"]), (0, "pass"), (command, text))
            hashes.add(results["clean"]["trace_hash"])
        self.assertEqual(len(hashes), 1)

    def test_python_three_times(self):
        paths = self.write(["clean", "noise"])
        seen = []
        for flags in ([], ["-j", "2"], ["--distributed"]):
            code, text, results = self.flown(*paths, client=f"clocked:{HOVER}", flags=flags)
            self.assertEqual((code, results["clean"]["verdict"]), (0, "pass"), text)
            seen.append({name: entry["trace_hash"] for name, entry in results.items()})
        self.assertEqual(seen, seen[:1] * 3)
        self.assertEqual(self.tiltproof("replay", "results/latest")[0], 0)
        self.await_none()

    def test_a_reset_starts_the_program_again(self):
        self.scenario("reset", **{"criteria:": "faults:\n  - {id: reset, type: device.reset, start_s: 0.3, parameters: {boot_ms: 20}}\ncriteria:"})
        hashes = set()
        for _ in range(3):
            _, text, results = self.flown("reset.yaml", client=f"clocked:{HOVER}")
            self.assertEqual(results["reset"]["verdict"], "pass", text)
            self.assertIn("1 restart", text)
            hashes.add(results["reset"]["trace_hash"])
        self.assertEqual(len(hashes), 1)
        self.await_none()

    def test_programs_that_the_clock_cannot_hold(self):
        self.scenario("held")
        for case, reason in {"fork": "it starts another process", "rdtsc": "it reads the processor's cycle counter",
                             "spin_clock": "it spins", "icanon": "call cfmakeraw()"}.items():
            _, text, results = self.flown("held.yaml", client=f"clocked:{WAITING} {case} {{port}} {{reference_port}}")
            self.assertEqual(results["held"]["verdict"], "error", (case, text))
            self.assertRegex(results["held"]["reason"], f"the virtual clock cannot hold this program: .*{re.escape(reason)}")
            self.await_none()

    def test_programs_that_are_refused_before_they_start(self):
        self.scenario("held")
        (self.folder / "main.c").write_text("int main(void) { return 0; }\n")
        subprocess.run(["cc", "-static", "main.c", "-o", "static"], cwd=self.folder, check=True)
        shutil.copy(WAITING, self.folder / "privileged")
        os.chmod(self.folder / "privileged", 0o4755)
        (self.folder / "script").write_text(f"#!{self.folder}/static\n")
        os.chmod(self.folder / "script", 0o755)
        (self.folder / "my files").mkdir()
        shutil.copy(self.folder / "static", self.folder / "my files")
        for command, reason in {"./static": "is statically linked", "exec ./static {port}": "is statically linked",
                                "A=1 ./static {port} > log": "is statically linked", "./script": "is statically linked",
                                "'./my files/static' {port} 'a;b'": "is statically linked", "exec ./my\\ files/static": "is statically linked",
                                "./privileged": "set-user-ID", "./missing {port}": "no program at ./missing",
                                "./a {prot}": "did you mean {port}?"}.items():
            code, out, err = self.tiltproof("run", "held.yaml", "--client", f"clocked:{command}", "--no-report")
            self.assertEqual(code, 2, (command, out, err))
            self.assertIn(reason, err, command)
        # A shell decides here what it starts.
        _, text, results = self.flown("held.yaml", client="clocked:true && ./static")
        self.assertEqual(results["held"]["verdict"], "error", text)
        self.assertIn("has not loaded the virtual clock", results["held"]["reason"])
        code, _, err = self.tiltproof("run", "held.yaml", "--client", f"clocked:{HOVER}", "--mode", "realtime")
        self.assertEqual(code, 2)
        self.assertIn("lockstep only", err)

    def test_a_death_is_the_firmware_s(self):
        self.scenario("dies")
        for case, reason in {"exit": "exited with code 5 in grant", "crash": "crashed in grant: Segmentation fault"}.items():
            code, text, results = self.flown("dies.yaml", client=f"clocked:{WAITING} {case} {{port}} {{reference_port}}")
            self.assertEqual((code, results["dies"]["verdict"]), (1, "fail"), text)
            self.assertIn(reason, results["dies"]["reason"])
            self.await_none()

    def test_an_interrupt_leaves_no_process(self):
        self.scenario("long", **{"duration_s: 0.6": "duration_s: 3000"})
        running = subprocess.Popen([PROGRAM, "run", "long.yaml", "--no-report", "--client", f"clocked:{HOVER}"], cwd=self.folder,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for number in (signal.SIGINT,):
            while len(self.processes()) < 3 and running.poll() is None:
                time.sleep(0.05)
            running.send_signal(number)
        self.assertNotEqual(running.wait(60), 0)
        self.await_none()


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
