#!/usr/bin/env python3
"""Firmware of users in real time: programs on pseudo-terminals, boards behind serial ports, libraries.
Usage: client_test.py TILTPROOF PTY_FIRMWARE FIRMWARE_LIBRARY MINIMAL_LIBRARY"""
import fcntl
import os
import pathlib
import pty
import shutil
import signal
import subprocess
import sys
import tempfile
import termios
import threading
import time
import tty
import unittest

from flight import Flight, become_subreaper, read, wait_until, write_hover

PROGRAM, FIRMWARE, LIBRARY, MINIMAL = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(4))
# A flight that the machine itself disturbed says nothing: it is flown again.
ATTEMPTS_COUNT = 2


def waiting_bytes(descriptor):
    """That have arrived there and were not read."""
    return int.from_bytes(fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)), sys.byteorder)


class ClientTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-client-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.attempt = 0

    def start(self, client, duration_s=3, **options):
        self.attempt += 1
        folder = self.folder / str(self.attempt)
        folder.mkdir()
        flight = Flight(PROGRAM, folder, write_hover(folder, duration_s=duration_s), "--client", client, **options)
        self.addCleanup(flight.end)
        return flight

    def fly(self, client, code, duration_s=3, timeout_s=30, **options):
        """To its end; again while the machine was too busy to judge, and in the end by what was flown."""
        for _ in range(ATTEMPTS_COUNT):
            flight = self.start(client, duration_s, **options)
            got = flight.wait(timeout_s)
            if got != 4 or code == 4:
                break
        self.assert_flown(flight, got, code)
        return flight

    def assert_flown(self, flight, got, code):
        if got == 4 and code == 0 and "too busy to judge" in flight.text():
            self.assertEqual({criterion["verdict"] for criterion in flight.result()["criteria"]}, {"pass"}, flight.text())
        else:
            self.assertEqual(got, code, flight.text())

    def report(self, flight):
        for event in flight.events("client_round_trip"):
            print(f"{self.id().split('.')[-1]}: {event['text']}", file=sys.stderr, flush=True)

    def check(self, flight):
        flight.check_results(self)
        flight.check_nothing_left(self)

    def log(self, flight):
        return read(flight.run_folder / "hover/firmware.log")

    # process:

    def test_process_finds_its_ports_in_the_environment(self):
        flight = self.fly(f"process:exec {FIRMWARE} {LIBRARY}", 0)
        self.assertIn(b"pty_firmware: up", self.log(flight))
        self.assertEqual(flight.column("hover", "supervisor_state"), [], "a program on a serial port tells nothing")
        self.report(flight)
        self.check(flight)

    def test_process_finds_its_ports_in_its_arguments(self):
        flight = self.fly(f"process:env -u TILTPROOF_PORT -u TILTPROOF_REFERENCE_PORT {FIRMWARE} {LIBRARY} {{port}} {{reference_port}}", 0)
        self.assertEqual(flight.result()["metrics"]["link.reference.frames_rejected_count"], 0)
        self.check(flight)

    def test_process_that_exits_has_failed(self):
        flight = self.fly(f"process:{FIRMWARE} {LIBRARY} --exit-after 1", 1)
        self.assertEqual(flight.result()["verdict"], "fail")
        self.assertIn("the firmware's process exited with code 3", flight.result()["reason"])
        self.assertIn(b"the watchdog has bitten", self.log(flight))
        self.assertIn(b"last words without end of line", self.log(flight))
        self.assertIn("last words without end of line", flight.text().split("the last lines that it printed (firmware.log):")[1])
        self.check(flight)

    def test_process_that_opens_no_port_never_started(self):
        flight = self.fly("process:sleep 100", 1, duration_s=2)
        self.assertEqual(flight.result()["verdict"], "fail")
        self.assertIn("never started", flight.result()["reason"])
        self.check(flight)

    def test_firmware_that_ends_as_a_shell_without_its_command_has_failed(self):
        # It has flown: these codes are its own.
        flight = self.fly(f"process:{FIRMWARE} {LIBRARY} --exit-after 1; exit 127", 1)
        self.assertEqual(flight.result()["verdict"], "fail")
        self.assertIn("the firmware's process exited with code 127", flight.result()["reason"])
        self.check(flight)

    def test_command_that_is_not_found(self):
        for command, code, what in (("no-such-firmware --fly", 127, "was not found"), ("/etc/passwd", 126, "may not be executed")):
            flight = self.fly(f"process:{command}", 3)
            self.assertEqual(flight.result()["verdict"], "error")
            self.assertIn(f"{what} (the shell exited with code {code}): {command};", flight.result()["reason"])
            self.assertIn(b"not found" if code == 127 else b"denied", self.log(flight))
        self.check(flight)

    def test_process_that_this_machine_stops_has_not_failed(self):
        flight = self.start(f"process:exec {FIRMWARE} {LIBRARY}", duration_s=6)
        flight.wait_flying()
        [firmware] = wait_until(lambda: [pid for pid, command in flight.processes().items() if command[0] == str(FIRMWARE)], 10, "no firmware")
        self.assertIsNotNone(flight.wait_fly_for(1.0), flight.text())
        os.kill(firmware, signal.SIGSTOP)
        # The vehicle is lost without it.
        self.assert_too_busy(flight)

    def take_processor(self):
        """The last one, from all that have no real-time priority."""
        if read("/proc/thread-self/schedstat").split()[2:] in ([], [b"0"]):
            self.skipTest("this kernel does not tell how long a thread waits for a processor")
        [*_, processor] = sorted(os.sched_getaffinity(0))
        hog = subprocess.Popen([sys.executable, "-c", "while True: pass"], preexec_fn=lambda: os.sched_setaffinity(0, [processor]))
        self.addCleanup(hog.wait)
        self.addCleanup(hog.kill)
        try:
            os.sched_setscheduler(hog.pid, os.SCHED_FIFO, os.sched_param(1))
        except PermissionError:
            self.skipTest("a user without the right to real-time scheduling cannot keep others from a processor")
        return processor

    def assert_too_busy(self, flight):
        self.assertEqual(flight.wait(30), 4, flight.text())
        self.assertEqual(flight.result()["verdict"], "inconclusive")
        self.assertIn("too busy to judge", flight.text())
        self.check(flight)

    def test_process_that_others_keep_from_its_processor_has_not_failed(self):
        flight = self.start(f"process:exec {FIRMWARE} {LIBRARY}", duration_s=6)
        flight.wait_flying()
        [firmware] = wait_until(lambda: [pid for pid, command in flight.processes().items() if command[0] == str(FIRMWARE)], 10, "no firmware")
        os.sched_setaffinity(firmware, [max(os.sched_getaffinity(0))])
        os.sched_setscheduler(firmware, os.SCHED_OTHER, os.sched_param(0))
        self.assertIsNotNone(flight.wait_fly_for(1.0), flight.text())
        # The vehicle may be lost before the program runs again: then its wait is not over when the flight ends.
        self.take_processor()
        self.assert_too_busy(flight)

    def test_process_that_others_keep_from_its_start_has_not_failed(self):
        processor = self.take_processor()
        # It would need a second of processor time, and gets a twentieth of it.
        wait = "import time; end = time.process_time() + 1\nwhile time.process_time() < end: pass"
        self.assert_too_busy(self.start(f"process:taskset -c {processor} {sys.executable} -c '{wait}'; exec {FIRMWARE} {LIBRARY}", duration_s=2))

    def test_process_with_grandchildren(self):
        flight = self.fly(f"process:sleep 1000 & {FIRMWARE} {LIBRARY} --grandchild", 0, duration_s=2)
        self.check(flight)

    def test_killed_node_takes_the_firmware_along(self):
        flight = self.start(f"process:sleep 1000 & {FIRMWARE} {LIBRARY} --grandchild", duration_s=6)
        os.kill(flight.wait_flying()["client"], signal.SIGKILL)
        self.assertEqual(flight.wait(20), 1, flight.text())
        self.check(flight)

    def test_killed_run_takes_the_firmware_along(self):
        flight = self.start(f"process:sleep 1000 & {FIRMWARE} {LIBRARY} --grandchild", duration_s=6)
        flight.wait_flying()
        flight.process.kill()
        flight.wait(5)
        flight.check_nothing_left(self)

    def test_process_that_prints_garbage(self):
        flight = self.fly(f"process:{FIRMWARE} {LIBRARY} --garbage", 0, duration_s=2)
        self.assertGreater(len(self.log(flight)), 20000)
        self.check(flight)

    def test_hostile_bytes_break_a_program(self):
        planted, out = PROGRAM.parent / "tests/planted", self.folder / "fuzz"
        done = subprocess.run([PROGRAM, "fuzz", "--client", f"process:exec {FIRMWARE} {planted}/planted_off_by_one.so", "--time", "6", "--seed", "1", "--out", out],
                              capture_output=True, text=True, timeout=120, check=False)
        found = list((out / "findings").glob("crash-*.yaml"))
        self.assertEqual((done.returncode, len(found)), (1, 1), done.stdout + done.stderr)
        self.assertIn("the firmware's process killed by signal 11", done.stdout)
        # The scenario breaks the program again, and not one that is correct.
        for name, green in (("off_by_one", False), ("correct", True)):
            for _ in range(ATTEMPTS_COUNT):
                flown = subprocess.run([PROGRAM, "run", found[0], "--mode", "realtime", "--out", self.folder / "again", "--client",
                                        f"process:exec {FIRMWARE} {planted}/planted_{name}.so"], capture_output=True, text=True, timeout=60, check=False)
                if flown.returncode != 4:
                    break
            self.assertIn(flown.returncode, (0, 4) if green else (1,), flown.stdout + flown.stderr)

    # serial:

    def cables(self, count):
        """Pseudo-terminals in place of cables: the board has their masters, the devices are their slaves."""
        cables = [pty.openpty() for _ in range(count)]
        for ends in cables:
            for end in ends:
                tty.setraw(end)

        def unplug():
            for ends in cables:
                for end in ends:
                    os.close(end)
            cables.clear()
        self.addCleanup(unplug)
        return [os.ttyname(slave) for _, slave in cables], [master for master, _ in cables], [slave for _, slave in cables], unplug

    def fly_board(self, count, duration_s=3, *how, unheard_bytes=0):
        """Until the board flies. It is switched on when the harness listens: a board sends `start` once. The link node stops until that
        many bytes of the board wait for it."""
        devices, masters, slaves, unplug_cables = self.cables(count)
        flight = self.start("serial:" + ",".join(devices), duration_s)
        link = flight.wait_flying(count=5)["link"]
        if unheard_bytes > 0:
            wait_until(lambda: "listening to the board" in flight.text(), 20, flight.text)
            os.kill(link, signal.SIGSTOP)
        with open(flight.folder / "board.log", "wb") as output:
            board = subprocess.Popen([FIRMWARE, LIBRARY, *(f"fd:{master}" for master in masters), *how], pass_fds=masters, stdout=output, stderr=output)

        def unplug():
            board.kill()
            board.wait()
            unplug_cables()
        self.addCleanup(unplug)
        if unheard_bytes > 0:
            wait_until(lambda: waiting_bytes(slaves[0]) >= unheard_bytes, 20, flight.text)
            os.kill(link, signal.SIGCONT)
        return flight, unplug

    def fly_board_to_the_end(self, count):
        for _ in range(ATTEMPTS_COUNT):
            flight, unplug = self.fly_board(count)
            code = flight.wait(30)
            unplug()
            if code != 4:
                break
        self.assert_flown(flight, code, 0)
        self.assertIn("listening to the board for 3 s: switch it on, or reset it, now", flight.text())
        self.assertNotIn("reset it by hand", flight.text())  # there is one flight
        self.report(flight)
        self.check(flight)
        return flight

    def test_board_with_both_ports(self):
        flight = self.fly_board_to_the_end(2)
        self.assertGreater(flight.result()["metrics"]["link.reference.frames_sent_count"], 200)

    def test_board_with_its_main_port_alone(self):
        self.fly_board_to_the_end(1)

    def test_board_is_not_blamed_for_bytes_that_waited_for_the_harness(self):
        flight, unplug = self.fly_board(1, unheard_bytes=80)  # `start` and nine requests
        code = flight.wait(30)
        unplug()
        self.assert_flown(flight, code, 0)

    def test_an_adapter_that_buffers_is_named_when_the_vehicle_is_lost(self):
        flight, unplug = self.fly_board(2, 3, "--adapter", "8")
        self.assertNotEqual(flight.wait(30), 0, flight.text())
        unplug()
        self.assertRegex(" ".join(flight.text().split()), r"\d+\.\d ms between reply and actuators: a USB-serial adapter that buffers, most likely")

    def board_that_can_be_reset(self, masters, firmware="paper"):
        """A board in a thread: each `r` in the pipe `reset` starts it again, and has an answer in the pipe `done`. Returns the path of
        `reset` and the starts so far."""
        reset, done, boards = self.folder / "reset", self.folder / "done", []
        os.mkfifo(reset)
        os.mkfifo(done)
        pipe, answers = os.open(reset, os.O_RDWR), os.open(done, os.O_RDWR)

        def work():
            while os.read(pipe, 1) == b"r":
                end()
                boards.append(subprocess.Popen([FIRMWARE, LIBRARY, *(f"fd:{master}" for master in masters)], pass_fds=masters,
                                               env={**os.environ, "TILTPROOF_FIRMWARE": firmware}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
                os.write(answers, b"\n")

        def end():
            for board in boards:
                board.kill()
                board.wait()
        thread = threading.Thread(target=work)
        thread.start()
        self.addCleanup(lambda: (os.write(pipe, b"e"), thread.join(), end(), os.close(pipe), os.close(answers)))
        return reset, boards

    def test_board_that_is_reset_by_a_command_before_each_flight(self):
        devices, masters, _, _ = self.cables(2)
        reset, boards = self.board_that_can_be_reset(masters)
        folder = self.folder / "twice"
        folder.mkdir()
        flight = Flight(PROGRAM, folder, write_hover(folder, duration_s=2), "--repeat", "2", "--client", f"serial:{','.join(devices)},reset=printf r >{reset}")
        self.addCleanup(flight.end)
        code = flight.wait(60)
        self.assertEqual(len(boards), 2, flight.text())
        self.assertIn(code, (0, 4), flight.text())
        self.assertNotIn("switch it on", flight.text())
        results = flight.run_results()
        self.assertEqual([result["end_reason"] for result in results], ["completed", "completed"], flight.text())

    def test_start_of_what_ran_before_the_reset_is_not_heard(self):
        # Until it is answered, this firmware repeats `start` in each period.
        devices, masters, _, _ = self.cables(2)
        reset, boards = self.board_that_can_be_reset(masters, "tolerant")
        reset.write_text("r")
        with open(self.folder / "done") as done:
            done.readline()
        self.assertEqual(len(boards), 1)
        flight = self.fly(f"serial:{','.join(devices)},reset=sleep 0.3; printf r >{reset}; read _ <{self.folder}/done", 0)
        self.assertEqual(flight.events("start_repeated"), [])

    def test_start_counts_that_comes_before_the_command_of_the_reset_ends(self):
        # This firmware sends `start` once, and is silent until it is answered.
        devices, masters, _, _ = self.cables(2)
        reset, _ = self.board_that_can_be_reset(masters)
        self.fly(f"serial:{','.join(devices)},reset=printf r >{reset}; sleep 0.3", 0)

    def test_board_that_nothing_resets_between_flights(self):
        devices, _, _, _ = self.cables(1)
        folder = self.folder / "by-hand"
        folder.mkdir()
        flight = Flight(PROGRAM, folder, write_hover(folder, duration_s=1), "--repeat", "2", "--client", f"serial:{devices[0]}")
        self.addCleanup(flight.end)
        flight.wait(60)
        self.assertIn(f"nothing resets the board of --client serial:{devices[0]} between flights: at the begin of each of the 2 flights, reset it by hand",
                      " ".join(flight.text().split()))
        self.assertEqual(flight.text().count("listening to the board"), 2, flight.text())

    def test_board_that_cannot_be_reset(self):
        devices, _, _, _ = self.cables(1)
        for how, reason in (("echo no probe; exit 3", "reset=echo no probe; exit 3: exited with code 3: no probe"), ("dtr", "no line DTR can be set here")):
            flight = self.start(f"serial:{devices[0]},reset={how}")
            self.assertEqual(flight.wait(20), 3, flight.text())
            self.assertIn(reason, flight.result()["reason"])
            self.assertEqual(flight.result()["verdict"], "error")
            self.check(flight)

    def refused(self, client, code, *texts, **options):
        flight = self.start(client, **options)
        self.assertEqual(flight.wait(10), code, flight.text())
        for text in texts:
            self.assertIn(text, flight.text())
        self.assertFalse(flight.results.exists())
        flight.check_nothing_left(self)

    def test_device_that_does_not_exist(self):
        self.refused("serial:/dev/ttyNONE7", 2, "/dev/ttyNONE7: no such device")
        self.refused("serial:/dev/null,/dev/ttyNONE7", 3, "/dev/null: not a serial device")

    def test_device_that_is_busy(self):

        devices, _, slaves, _ = self.cables(2)
        fcntl.flock(slaves[1], fcntl.LOCK_EX)
        self.refused("serial:" + ",".join(devices), 3, f"{devices[1]}: busy", "end it first")
        self.refused(f"serial:{devices[0]},{devices[0]}", 3, f"{devices[0]}: busy")

    def test_device_that_is_not_permitted(self):
        devices, _, _, _ = self.cables(1)
        options = {}
        if os.getuid() == 0:
            # The user `nobody` must be able to read the program and to write results.
            options["user"] = 65534
            self.folder.chmod(0o777)
            if subprocess.run(["sh", "-c", '"$0" --version', PROGRAM], user=65534, capture_output=True, check=False).returncode != 0:
                self.skipTest("no other user may run the program")
        os.chmod(devices[0], 0o000)
        old = os.umask(0)
        try:
            self.refused(f"serial:{devices[0]}", 3, f"{devices[0]}: no permission", "usermod", **options)
        finally:
            os.umask(old)

    def test_board_that_is_unplugged(self):
        flight, unplug = self.fly_board(2, duration_s=6)
        self.assertIsNotNone(flight.wait_fly_for(1.0), flight.text())
        unplugged = time.monotonic()
        unplug()
        self.assertEqual(flight.wait(10), 3, flight.text())
        print(f"unplugged: ended after {time.monotonic() - unplugged:.2f} s; {flight.result()['reason']}", file=sys.stderr, flush=True)
        self.assertEqual(flight.result()["verdict"], "error")
        self.assertRegex(flight.result()["reason"], r"the client's (reference )?port is gone: .*unplugged.*\(at (0\.[1-9]|1\.)\d* s\)")
        self.assertTrue(flight.events("port_lost"))
        self.check(flight)

    # library:

    def test_library_of_a_user(self):
        flight = self.fly(f"library:{MINIMAL}", 0)
        self.report(flight)
        self.check(flight)

    def test_host_library(self):
        flight = self.fly("host", 0, duration_s=2)
        self.report(flight)
        self.assertEqual(set(flight.column("hover", "supervisor_state")), {"0"})


if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
