#!/usr/bin/env python3
"""Firmware that does what firmware must not, as a user sees it. Usage: misbehaving_test.py TILTPROOF SOURCE_DIR CLIENTS_DIR"""
import json
import pathlib
import re
import signal
import subprocess
import sys
import time
import unittest
import xml.etree.ElementTree

from command_line import PROGRAM, CommandLineTest

CLIENTS = pathlib.Path(sys.argv[3]).resolve()


class MisbehavingTest(CommandLineTest):
    def misbehaving(self, *ways, flags=(), environment=None):
        """A flight for each, all at once: exit code, what was printed, results by name."""
        for how in ways:
            self.scenario(how, **{"seed: 3": f"seed: 3\nfirmware: {how}"})
        code, out, err = self.tiltproof("run", *(f"{how}.yaml" for how in ways), "-j", len(ways), "--client",
                                        f"library:{CLIENTS / 'libmisbehaving_client.so'}", *flags, environment=environment)
        return code, out + err, {entry["name"]: entry for entry in self.results()["scenarios"]}

    def rows_count(self, name):
        trace = self.latest() / name / "trace.csv"
        return len(trace.read_text().splitlines()) if trace.exists() else 0

    # Ways in which a firmware may break its flight, each with the reported reason. The run keeps what was flown.
    FATAL = {"crash": "crashed in tiltproof_client_grant: Segmentation fault at", "recursion": r"crashed in tiltproof_client_grant: Segmentation fault \(stack overflow\) at libmisbehaving_client.so", "abort": "crashed in tiltproof_client_grant: Aborted",
             "assertion": r"Aborted: .*misbehaving_client.c:\d+: misbehave: Assertion `how == .*' failed", "smash": "Aborted: .* stack smashing detected",
             "free_twice": r"Aborted at .*misbehaving_client.so\+0x[0-9a-f]+.*: free\(\): double free detected",
             "exit": r"called exit\(3\) in tiltproof_client_grant", "quick_exit": r"called quick_exit\(3\)", "underscore_exit": r"called _exit\(0\)",
             "exec": r"called exec \(true\)", "pthread_exit": "called pthread_exit", "throw": "threw an exception: beyond the last sensor",
             "nanoseconds": "lets no time pass", "hang": "did not return from tiltproof_client_grant within 5 s of its own time",
             "stop": "stopped itself in tiltproof_client_grant", "stop_forever": "stopped itself in tiltproof_client_grant",
             "raise_term": r"raised SIGTERM in its process \(raise\)", "kill_int": r"raised SIGINT in its process \(kill\)", "kill_hup": "raised SIGHUP in its process",
             "kill_kill": "raised SIGKILL in its process",
             "thread_transmits": "called host->transmit from a thread of its own"}
    # Ways that nothing in the firmware's process can prevent: the flight is lost, the verdict is not.
    FATAL_AND_LOST = {"raw_exit": "ended its process in tiltproof_client_grant.*exit code 0", "raw_exec": "ended its process in tiltproof_client_grant", "copy": "ended its process in tiltproof_client_grant.*exit code 0",
                      "thread": r"a thread that the firmware started crashed at libmisbehaving_client\.so\+0x[0-9a-f]+.*Segmentation fault",
                      "hang_blocked": "did not return from tiltproof_client_grant"}

    # Who may raise a limit again keeps the flight.
    FATAL_AND_PERHAPS_LOST = {"close_all": "closed descriptors of its process", "lower_files": "lowered RLIMIT_NOFILE of its process", "lower_size": "lowered RLIMIT_FSIZE of its process"}

    def test_a_firmware_that_breaks_its_flight_has_failed(self):
        for ways, kept in ((self.FATAL, True), (self.FATAL_AND_LOST, False), (self.FATAL_AND_PERHAPS_LOST, None)):
            code, text, results = self.misbehaving(*ways)
            self.assertEqual(code, 1, text)
            for how, reason in ways.items():
                self.assertEqual(results[how]["verdict"], "fail", (how, text))
                self.assertRegex(results[how]["reason"], reason)
                if kept is not None:
                    self.assertEqual(self.rows_count(how) > 10, kept, how)
            # None drops out of the score later on, be there a flight or not.
            self.assertIn(self.tiltproof("score", self.latest())[0], (1,) if kept else (1, 3))

    def test_in_a_process_of_its_own_too(self):
        ways = {how: reason for how, reason in self.FATAL.items() if how not in ("hang", "stop", "stop_forever")}
        code, text, results = self.misbehaving(*ways, "raw_exit", "raw_exec", flags=["--distributed=socket"])
        self.assertEqual(code, 1, text)
        for how, entry in results.items():
            self.assertEqual(entry["verdict"], "fail", (how, text))
            self.assertRegex(entry["reason"], ways.get(how, "the firmware's process"))
            self.assertGreater(self.rows_count(how), 10, how)

    def test_while_it_is_loaded(self):
        for how, reason in (("crash", "crashed in dlopen"), ("exit", r"called exit\(3\) in dlopen"), ("throw", "crashed|threw")):
            code, text, results = self.misbehaving("calm", environment={"MISBEHAVE_AT_LOAD": how})
            self.assertEqual((code, results["calm"]["verdict"]), (1, "fail"), text)
            self.assertRegex(results["calm"]["reason"], reason)

    # The vehicle hovers where it should, because no command changes the hover input.
    SILENT = {"starts_only": "no actuator message was accepted in the whole flight; 49 of 49 periods without a request, the first at 0.012 s",
              "asks_only": "no actuator message was accepted in the whole flight; .* periods without an actuator message",
              "wrong_id": r"no actuator message was accepted in the whole flight; \d+ malformed frames, the first at 0\.0\d\d s \(unknown_id, bytes 7e 00 00 a0 40 ",
              "short": r"no actuator message was accepted in the whole flight; \d+ malformed frames, .*bad_length", "not_a_number": r"no actuator message was accepted in the whole flight; .*not_finite",
              "mute": r"answered none of \d+ good replies since 0\.\d\d s", "silent": r"\d+ of 49 periods without a request, the first at 0\.3\d\d s"}

    def test_a_firmware_that_says_nothing_of_use_has_failed(self):
        code, text, results = self.misbehaving(*self.SILENT)
        self.assertEqual(code, 1, text)
        for how, reason in self.SILENT.items():
            self.assertEqual((results[how]["verdict"], results[how]["outcome"]), ("fail", "failed"), how)
            self.assertRegex(results[how]["reason"], "^clean_line: " + reason)
        # The same from the files.
        code, out, _ = self.tiltproof("score", self.latest(), "--format", "jsonl")
        again = {entry["name"]: entry["reason"] for entry in map(json.loads, out.splitlines()) if "name" in entry}
        self.assertEqual(again, {how: entry["reason"] for how, entry in results.items()})

    def test_what_it_leaves_behind_ends_with_its_flight(self):
        # During the flight, and as the library is loaded.
        for how, environment in (("leave_child", {}), ("calm", {"MISBEHAVE_AT_LOAD": "leave_child"})):
            began = time.monotonic()
            code, text, _ = self.misbehaving(how, "calm", environment=environment)  # until no process has its output open any more
            self.assertEqual(code, 0, text)
            self.assertLess(time.monotonic() - began, 60)
            self.assert_nothing_is_left()

    def assert_nothing_is_left(self):
        left = [process for process in pathlib.Path("/proc").glob("[0-9]*") if self.command_of(process).count(str(self.folder)) or self.folder_of(process) == self.folder]
        self.assertEqual(left, [])

    @staticmethod
    def command_of(process):
        try:
            return (process / "cmdline").read_text()
        except OSError:
            return ""

    @staticmethod
    def folder_of(process):
        try:
            return (process / "cwd").readlink()
        except OSError:
            return None

    def test_what_it_does_after_the_flight_changes_no_verdict(self):
        ways = [f"destroy_{how}" for how in ("abort", "exit", "raw_exit", "asleep_blocked")]
        code, text, results = self.misbehaving("calm", *ways)
        self.assertEqual(code, 0, text)
        hashes = {entry["trace_hash"] for entry in results.values()}
        self.assertEqual(len(hashes), 1, results)
        self.assertIn("called exit(3) in tiltproof_client_destroy", text)
        self.assertIn("crashed in tiltproof_client_destroy: Aborted", text)
        self.assertIn("hung in tiltproof_client_destroy", text)

    def test_what_it_says_reaches_the_terminal_without_control_characters(self):
        said = "threw an exception: \\x1b[2J PASS forged\\x9b\\xc2\\x9b\\xe2\\x80\\xae"
        code, text, results = self.misbehaving("throw_escapes")
        self.assertEqual((code, results["throw_escapes"]["verdict"]), (1, "fail"), text)
        self.assertIn(said, text)
        self.assertEqual([c for c in text if not c.isprintable() and c != "\n"], [])
        xml.etree.ElementTree.parse(self.latest() / "junit.xml")
        # A script gets what was said, but for the byte that is no UTF-8.
        code, text, _ = self.misbehaving("throw_escapes", flags=["--format", "jsonl"])
        self.assertTrue(text.isascii() and text.rstrip("\n").isprintable(), text)
        self.assertIn("\x1b[2J PASS forged\ufffd\x9b\u202e", json.loads(text)["reason"])

    def test_its_floating_point_modes_are_its_own(self):
        _, _, results = self.misbehaving("calm", "round")
        _, _, at_load = self.misbehaving("calm", environment={"MISBEHAVE_AT_LOAD": "round"})
        hashes = {entry["trace_hash"] for entry in [*results.values(), *at_load.values()]}
        self.assertEqual(len(hashes), 1)

    def test_a_process_that_it_forks_flies_nothing(self):
        code, text, results = self.misbehaving("fork")
        self.assertEqual((code, text.count("fork ")), (0, 1), text)

    def test_an_interrupt_ends_a_firmware_that_blocks_all_signals_and_hangs(self):
        """By the interrupt, not by the seven seconds after which such a firmware is ended by itself."""
        self.scenario("hang_blocked", **{"seed: 3": "seed: 3\nfirmware: hang_blocked"})
        with subprocess.Popen([PROGRAM, "run", "hang_blocked.yaml", "--client", f"library:{CLIENTS / 'libmisbehaving_client.so'}"], cwd=self.folder,
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            while not self.a_child_blocks_interrupts(process.pid):
                self.assertIsNone(process.poll())
            process.send_signal(signal.SIGINT)
            self.assertEqual(process.wait(60), 130)
        self.assertRegex(self.results()["scenarios"][0]["reason"], "interrupted while the firmware was in tiltproof_client_grant")

    @staticmethod
    def a_child_blocks_interrupts(pid):
        for child in pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            try:
                blocked = re.search(r"SigBlk:\s*(\w+)", pathlib.Path(f"/proc/{child}/status").read_text())[1]
            except OSError:
                continue
            if int(blocked, 16) & 1 << signal.SIGINT - 1:
                return True
        return False

    def test_what_it_prints_is_in_its_log_and_nowhere_else(self):
        for flags in ((), ("--distributed=socket",)):
            _, text, _ = self.misbehaving("chatter", flags=flags)
            self.assertNotIn("chatter-on", text)
            log = (self.latest() / "chatter/firmware.log").read_text()
            self.assertRegex(log, r"(?m)^0\.\d+ chatter-on-stdout$")
            self.assertRegex(log, r"(?m)^0\.\d+ chatter-on-stderr$")
            self.assertIn("?[2J", log)

    def test_a_file_that_is_no_firmware_library(self):
        path = self.scenario("calm")
        (self.folder / "text.so").write_text("hello")
        (self.folder / "none.c").write_text("int nothing;")
        subprocess.run(["cc", "-shared", "-fPIC", "-o", "none.so", "none.c"], cwd=self.folder, check=True)
        for library, words in (("text.so", "cannot load"), ("none.so", "does not export tiltproof_client_abi_version")):
            code, out, err = self.tiltproof("run", path, "--client", f"library:{library}")
            self.assertEqual((code, out), (2, ""), err)
            self.assertIn(words, err)
            self.assertIn(library, err)
        self.assertFalse((self.folder / "results").exists())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=1)
