#!/usr/bin/env python3
"""Programs in lockstep (`--client program:CMD`), as a user sees them: the bits of a library, and what becomes of programs
that do what they must not. Usage: program_test.py TILTPROOF SOURCE_DIR"""
import json
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import sys
import unittest

from command_line import PROGRAM
from program_flights import ProgramFlights

SOURCE = pathlib.Path(sys.argv[2]).resolve()
LIBRARY = f"library:{PROGRAM.parent / 'lib/minimal_firmware.so'}"
MINIMAL = f"program:{PROGRAM.parent / 'lib/minimal_program'}"
CLIENT = pathlib.Path(__file__).resolve().parent / "program_client.py"

FAULTS = {
    "clean": "",
    "late": "{id: late, type: frame.delay, target: to_client, start_s: 0.2, parameters: {mean_ms: 5}}",
    "noise": "{id: noise, type: wire.bit_error, target: both, start_s: 0.1, parameters: {ber: 1.0e-3}}",
    "reset": "{id: reset, type: device.reset, start_s: 0.3, parameters: {boot_ms: 20}}",
    "drift": "{id: drift, type: clock.drift, start_s: 0.1, parameters: {node: client, ppm: 5000}}",
    "jump": "{id: jump, type: clock.jump, start_s: 0.2, parameters: {node: client, jump_ms: 20}}",
    "task": "{id: task, type: device.task_delay, start_s: 0.1, parameters: {delay_ms: 4, every_ms: 25}}",
}


def python(way):
    return f"program:{sys.executable} {CLIENT} {SOURCE} {way}"


class ProgramTest(ProgramFlights):
    def misbehaving(self, way, flags=()):
        self.scenario(way)
        code, text, results = self.flown(f"{way}.yaml", client=python(way), flags=flags)
        return code, text, results[way]

    def test_same_code_has_the_bits_of_a_library(self):
        for name, fault in FAULTS.items():
            self.scenario(name, **({"criteria:": f"faults:\n  - {fault}\ncriteria:"} if fault else {}))
        names = [f"{name}.yaml" for name in FAULTS]
        _, text, library = self.flown(*names, client=LIBRARY)
        self.assertEqual(set(library), set(FAULTS), text)
        hashes = {name: entry["trace_hash"] for name, entry in library.items()}
        self.assertGreater(len(set(hashes.values())), 4, "the faults do something")
        for flags in ([], ["-j", "3"], ["--distributed=socket"]):
            _, text, program = self.flown(*names, client=MINIMAL, flags=flags)
            self.assertEqual({name: entry["trace_hash"] for name, entry in program.items()}, hashes, (flags, text))
            self.assertEqual({name: entry["verdict"] for name, entry in program.items()},
                             {name: entry["verdict"] for name, entry in library.items()}, flags)

    def test_on_the_bus_and_again_from_its_folder(self):
        self.scenario("clean")
        _, _, library = self.flown("clean.yaml", client=LIBRARY)
        _, text, program = self.flown("clean.yaml", client=MINIMAL, flags=["--distributed"])
        self.assertEqual(program["clean"]["trace_hash"], library["clean"]["trace_hash"], text)
        self.assertEqual(self.tiltproof("replay", "results/latest")[0], 0)
        code, out, _ = self.tiltproof("compare", "results/latest", "results/latest")
        self.assertEqual(code, 0, out)

    def test_a_controller_in_python(self):
        self.scenario("hover")
        hashes = set()
        for _ in range(2):
            code, text, results = self.flown("hover.yaml", client=python("calm"))
            self.assertEqual((code, results["hover"]["verdict"]), (0, "pass"), text)
            hashes.add(results["hover"]["trace_hash"])
        self.assertEqual(len(hashes), 1)

    @unittest.skipUnless(shutil.which("rustc"), "no rustc")
    def test_a_controller_in_rust(self):
        subprocess.run(["rustc", "--edition", "2021", SOURCE / "firmware/examples/rust/hover.rs", "-o", "rust_hover"], cwd=self.folder, check=True)
        self.scenario("hover", **{"criteria:": f"faults:\n  - {FAULTS['reset']}\ncriteria:"})
        hashes = set()
        for _ in range(2):
            code, text, results = self.flown("hover.yaml", client="program:./rust_hover")
            self.assertEqual((code, results["hover"]["verdict"]), (0, "pass"), text)
            hashes.add(results["hover"]["trace_hash"])
        self.assertEqual(len(hashes), 1)

    FATAL = {"exception": r"exited with code 1 in grant: ValueError: beyond the last sensor at .*program_client.py:\d+",
             "exit": "exited with code 3 in grant", "exit_0": "exited with code 0 in grant",
             "print_and_exit": "exited with code 3 in grant; it printed last: no calibration",
             "print_and_raise": "exited with code 1 in grant: ValueError: behind three megabytes",
             "crash": "crashed in grant: Segmentation fault", "killed": "crashed in grant: Killed",
             "close": "closed its socket in grant",
             "garbage": r"broke the protocol of docs/program.md in grant: kind 47, .* at byte \d+ of what it sent \(47 45 54 20 2f 20 48 54\)",
             "huge": "broke the protocol .*a body of 2147483648 bytes", "uart": "broke the protocol .*number 9",
             "ready_again": "broke the protocol .*kind 129 has no place there",
             "two_answers": "broke the protocol .* it sent more behind `waiting`",
             "flood": "lets no time pass: it sent more than 64 MiB in grant",
             "nanoseconds": "lets no time pass: it wants to be woken again and again",
             "backwards": "lets no time pass: it wants to be woken again and again"}

    def test_what_fails_a_flight(self):
        for way, reason in self.FATAL.items():
            code, text, entry = self.misbehaving(way)
            self.assertEqual((code, entry["verdict"]), (1, "fail"), (way, text))
            self.assertRegex(entry["reason"], "the firmware .*" + reason, way)
            rows = (self.latest() / way / "trace.csv").read_text().splitlines()
            self.assertGreater(len(rows), 10, "the flight so far is kept")
            self.await_none()

    def test_its_log_keeps_the_last_lines_before_an_end_and_says_what_it_lacks(self):
        self.misbehaving("print_and_raise")
        log = (self.latest() / "print_and_raise/firmware.log").read_text()
        self.assertRegex(log, r"^\d+\.\d+ tiltproof: \d{5} lines before this one are not kept: they came at once\n")
        kept = [int(number) for number in re.findall(r" line (\d+) x{40}\n", log)]
        self.assertEqual(kept, list(range(kept[0], kept[-1] + 1)))
        self.assertTrue(10_000 < kept[0] < kept[-1] == 59_999, (kept[0], kept[-1]))
        self.assertIn("ValueError: behind three megabytes", log)
        code, text, _ = self.misbehaving("print_always")
        self.assertEqual(code, 0, text)
        log = (self.latest() / "print_always/firmware.log").read_text()
        self.assertTrue(log.endswith(" tiltproof: the log is full (1 MiB): later lines of the firmware are not kept\n"), log[-200:])
        self.assertLess(len(log), (1 << 20) + 2000)

    def test_in_a_process_of_its_own_too(self):
        for way in ("exception", "crash", "garbage"):
            code, text, entry = self.misbehaving(way, flags=["--distributed=socket"])
            self.assertEqual((code, entry["verdict"]), (1, "fail"), (way, text))
            self.assertRegex(entry["reason"], self.FATAL[way])
            self.await_none()

    def test_a_program_that_does_not_answer_hangs(self):
        for ways, expected in ((("hang", "sleep", "trickle"), "did not return from grant within 5 s of its own time"), (("stop",), "stopped itself in grant")):
            for way in ways:
                self.scenario(way)
            running = [subprocess.Popen([PROGRAM, "run", f"{way}.yaml", "--no-report", "--client", python(way), "--out", way], cwd=self.folder,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for way in ways]
            for way, process in zip(ways, running):
                self.assertEqual(process.wait(120), 1, way)
                entry = json.loads((self.folder / way / "latest/results.json").read_text())["scenarios"][0]
                self.assertEqual((entry["verdict"], entry["outcome"]), ("fail", "hung"), way)
                self.assertIn(expected, entry["reason"])
        self.await_none()

    def test_ctrl_c_ends_a_flight_whose_program_is_stopped(self):
        self.scenario("long", **{"duration_s: 0.6": "duration_s: 600"})
        running, program = self.fly_until("long.yaml", f"{MINIMAL}", "minimal_program")
        os.kill(program, signal.SIGSTOP)
        self.assertIn("is stopped", running.stderr.readline())
        running.send_signal(signal.SIGINT)
        self.assertEqual(running.wait(20), 130)
        self.assertIn("a process of the flight was stopped", self.results()["scenarios"][0]["reason"])
        self.await_none()

    def test_programs_that_never_fly(self):
        for way, reason in {"ends_at_once": "exited with code 1 and has not connected to TILTPROOF_SOCKET (docs/program.md): nothing to do here",
                            "refuses": "cannot be firmware 'paper' with dialect 'paper': no such build",
                            "another_version": "speaks version 7 of docs/program.md, this tiltproof version 1"}.items():
            code, text, entry = self.misbehaving(way)
            self.assertEqual((code, entry["verdict"]), (3, "error"), (way, text))
            self.assertIn(reason, entry["reason"])
        self.scenario("background")
        code, text, results = self.flown("background.yaml", client=f"{python('calm')} &")
        self.assertEqual((code, results["background"]["verdict"]), (3, "error"), text)
        self.assertIn("one that goes into the background must stay in the foreground", results["background"]["reason"])
        code, text, entry = self.misbehaving("wrong_greeting")
        self.assertEqual((code, entry["verdict"]), (1, "fail"), text)
        self.assertIn("its first message is not `ready`", entry["reason"])
        self.await_none()

    def test_a_flight_counts_as_it_was(self):
        for way, warning in {"fails_at_end": "warning: after the flight, which counts as it was, the firmware exited with code 1: RuntimeError: no way to end",
                             "stays": "warning: after the flight, which counts as it was, the firmware did not end within 1 s"}.items():
            code, text, entry = self.misbehaving(way)
            self.assertEqual((code, entry["verdict"]), (0, "pass"), (way, text))
            self.assertIn(warning, text)
        self.await_none()

    def test_its_socket_is_gone_afterwards(self):
        self.scenario("clean")
        for folder in ("short", "x" * 120):  # no socket has room for the second
            (self.folder / folder).mkdir()
            code, out, err = self.tiltproof("run", "clean.yaml", "--no-report", "--client", MINIMAL, environment={"TMPDIR": str(self.folder / folder)})
            self.assertEqual((code, list((self.folder / folder).iterdir())), (0, []), out + err)

    def test_its_output_status_and_children(self):
        code, text, _ = self.misbehaving("log")
        self.assertEqual(code, 0, text)
        log = (self.latest() / "log" / "firmware.log").read_text()
        self.assertIn("a line", log)
        self.assertIn("printed", log)
        code, text, _ = self.misbehaving("print")
        self.assertEqual(code, 0, text)
        code, text, _ = self.misbehaving("status")
        self.assertEqual(code, 0, text)
        header, *rows = (line.split(",") for line in (self.latest() / "status" / "trace.csv").read_text().splitlines() if not line.startswith("#"))
        states = [row[header.index("supervisor_state")] for row in rows]
        self.assertEqual({float(state) for state in states}, {0, 2})
        code, text, _ = self.misbehaving("leave_child")
        self.assertEqual(code, 0, text)
        self.await_none()

    def test_results_that_cannot_be_written_end_the_program(self):
        def small_files():  # as on a full disk: nothing larger than this
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

        self.scenario("full")
        done = subprocess.run([PROGRAM, "run", "full.yaml", "--no-report", "--client", MINIMAL], cwd=self.folder, capture_output=True, text=True,
                              check=False, preexec_fn=small_files)
        self.assertEqual(done.returncode, 3, done.stdout + done.stderr)
        self.assertIn("the flight's results are missing: cannot write", " ".join(done.stdout.split()))
        self.assertEqual(self.results()["scenarios"][0]["verdict"], "error")
        self.await_none()

    def test_nothing_is_left_when_tiltproof_is_killed(self):
        self.scenario("sleep")
        self.killed("sleep.yaml", python("sleep"), "program_client.py")

    def test_mistakes(self):
        self.scenario("hover")
        for client, flags, expected in (("program:", [], "names nothing"), ("program:./missing", [], "no program at ./missing"),
                                        ("program:./hover.yaml x", [], "./hover.yaml is not a program: it must be an executable file"),
                                        (MINIMAL, ["--mode", "realtime"], "it flies in lockstep only"),
                                        (MINIMAL, ["--gdb", "1234"], "start it in the debugger instead")):
            code, _, err = self.tiltproof("run", "hover.yaml", "--client", client, *flags)
            self.assertEqual(code, 2, err)
            self.assertIn(expected, err)
        code, out, err = self.tiltproof("check", "hover.yaml", "--client", MINIMAL)
        self.assertEqual(code, 0, out + err)
        code, _, err = self.tiltproof("check", "hover.yaml", "--client", "program:./missing")
        self.assertEqual(code, 2, err)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
