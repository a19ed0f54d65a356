#!/usr/bin/env python3
"""How programs under the virtual clock end a flight, in the words for libraries, and what is left of them. Usage: clocked_ends_test.py TILTPROOF"""
import subprocess
import sys
import time
import unittest

from program_flights import ProgramFlights

# Answers nothing. Waits for its first wake-up, then does what its argument says.
FIRMWARE = """\
import os, signal, socket, sys, time
way = sys.argv[1]
time.sleep(0.05)
if way == "blocks":
    os.open("pipe", os.O_RDONLY)  # until another process opens its other end
elif way == "sends":
    os.kill(os.getpid(), signal.SIGSEGV)
elif way == "stops":
    os.kill(os.getpid(), signal.SIGSTOP)
elif way == "quits":
    sys.exit("no such option: --fast")
elif way == "listens":
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", 0))
    print("listening", flush=True)
    udp.recv(100)
else:
    time.sleep(1e6)
"""


class ClockedEndsTest(ProgramFlights):
    def client(self, way):
        (self.folder / "firmware.py").write_text(FIRMWARE)
        return f"clocked:exec {sys.executable} firmware.py {way}"

    def test_a_hang_is_that_of_a_library(self):
        self.scenario("hang")
        subprocess.run(["mkfifo", self.folder / "pipe"], check=True)
        for way, reason in {"blocks": "the firmware did not return from grant within 5 s of its own time", "stops": "the firmware stopped itself in grant"}.items():
            code, text, results = self.flown("hang.yaml", client=self.client(way))
            self.assertEqual((code, results["hang"]["verdict"], results["hang"]["outcome"]), (1, "fail", "hung"), (way, text))
            self.assertIn(reason, results["hang"]["reason"])
            self.await_none()

    def test_a_crash_that_the_program_sends_itself(self):
        self.scenario("crash")
        code, text, results = self.flown("crash.yaml", client=self.client("sends"))
        self.assertEqual((code, results["crash"]["verdict"], results["crash"]["outcome"]), (1, "fail", "crashed"), text)
        self.assertIn("the firmware crashed in grant: Segmentation fault", results["crash"]["reason"])

    def test_a_program_that_ends_before_a_byte_is_on_its_lines_is_no_firmware(self):
        # Also where a failure is expected: none of a firmware was seen.
        self.scenario("quits", **{"duration_s: 0.6": "duration_s: 0.6\nexpect: fail"})
        code, text, results = self.flown("quits.yaml", client=self.client("quits"))
        self.assertEqual((code, results["quits"]["verdict"]), (3, "error"), text)
        self.assertIn("before a byte was on its lines, the firmware exited with code 1 in grant; it printed last: no such option: --fast",
                      results["quits"]["reason"])

    def test_a_network_socket_does_not_hold_up_the_flight(self):
        self.scenario("listens")
        began = time.monotonic()
        code, text, results = self.flown("listens.yaml", client=self.client("listens"))
        self.assertLess(time.monotonic() - began, 40)
        self.assertEqual((code, results["listens"]["verdict"]), (1, "fail"), text)
        self.assertIn("the server accepted no `start` message", results["listens"]["reason"])
        log = (self.latest() / "listens/firmware.log").read_text()
        self.assertRegex(log, "the program opens a network socket. Packets that arrive there come in the machine's time")
        self.assertIn("listening", log)
        self.await_none()

    def test_nothing_is_left_when_tiltproof_is_killed(self):
        self.scenario("long", **{"duration_s: 0.6": "duration_s: 300"})
        client = self.client("blocks")
        subprocess.run(["mkfifo", self.folder / "pipe"], check=True)
        self.killed("long.yaml", client, "firmware.py")


if __name__ == "__main__":
    unittest.main(argv=["clocked_ends_test.py"])
