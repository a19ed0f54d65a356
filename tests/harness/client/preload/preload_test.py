#!/usr/bin/env python3
"""The virtual clock of `clocked:`: each way to wait ends at its own time, threads take turns, and what it cannot hold is refused.

Usage: preload_test.py CLOCK_LIBRARY WAITING_PROGRAM

The expected times follow from the program's calls and the times of its input: no clock of the machine is in them.
"""
import sys
import unittest

sys.dont_write_bytecode = True
from virtual_harness import Flight, NEVER  # noqa: E402

CLOCK, PROGRAM = sys.argv[1:3]
MS = 1_000_000
EPOCH_US = 1_767_225_600_000_000  # 1 January 2026

INPUTS = {
    "polls": [(100 * MS, 0, b"a"), (110 * MS, 0, b"bc"), (120 * MS, 0, b"d")],
    "ports": [(10 * MS, 0, b"AB"), (20 * MS, 0, b"CDE"), (30 * MS, 0, b"F"), (500 * MS, 0, b"xy"), (510 * MS, 0, b"GH"),
              (600 * MS, 1, b"line\n")],
}
# Name, value, time in us.
EXPECTED = {
    "clocks": [("monotonic", 2500, 2500), ("raw", 2500, 2500), ("coarse", 2500, 2500), ("boot", 2500, 2500),
               ("realtime", EPOCH_US + 2500, 2500), ("timeofday", EPOCH_US + 2500, 2500), ("time", EPOCH_US // 1_000_000, 2500),
               ("timespec_get", EPOCH_US + 2500, 2500), ("direct", 2500, 2500), ("by_hand", 2500, 2500),
               ("times", 200, 2002500), ("uptime", 2, 2002500), ("processor", 1, 2002500)],
    "sleeps": [("nanosleep", 0, 1500), ("clock_nanosleep", 0, 3000), ("absolute", 0, 13000), ("realtime", 0, 23000),
               ("past", 0, 23000), ("usleep", 0, 23250), ("sleep", 0, 2023250), ("direct", 0, 2024250)],
    "polls": [("poll", 0, 10000), ("zero", 0, 10000), ("ppoll", 0, 12500), ("select", 0, 19500), ("set", 0, 19500),
              ("left", 0, 19500), ("pselect", 0, 22000), ("epoll_wait", 0, 25000), ("epoll_pwait", 0, 29000), ("nothing", 0, 34000),
              ("poll_input", 1, 100000), ("read", 1, 100000), ("select_input", 1, 110000), ("left", 990000, 110000),
              ("read", 2, 110000), ("epoll_input", 1, 120000), ("data", 7, 120000)],
    # VMIN 4 waits for the second group; VTIME 0.2 s ends 200 ms after the call; 100 characters take 100 * 10 / 115200 s.
    "ports": [("exists", 0, 0), ("is_device", 1, 0), ("real_path", 0, 0), ("isatty", 1, 0), ("tcsetattr", 0, 0), ("speed", 1, 0), ("read4", 5, 20000), ("third", ord("C"), 20000),
              ("read1", 1, 30000), ("time_out", 0, 230000), ("poll_mode", 0, 230000), ("nonblocking", -1, 230000),
              ("errno", 1, 230000), ("written", 100, 230000), ("queued", 100, 230000), ("tcdrain", 0, 238680),
              ("waiting", 2, 500000), ("flushed", 0, 500000), ("copy", 1, 510000), ("byte", ord("G"), 510000),
              ("fgets", 1, 600000), ("line", 0, 600000)],
    "timers": [("settime", 0, 0), ("read", 8, 5000), ("count", 1, 5000), ("poll", 1, 12000), ("count", 3, 12000),
               ("left", 1000, 12000), ("absolute", 1, 15000), ("stopped", 0, 65000), ("early", -1, 65000), ("realtime", 1, 68000)],
    # The mutex is held from 16 ms on for 30 ms. 110 is ETIMEDOUT.
    "locks": [("cond_timedwait", 110, 4000), ("cond_clockwait", 110, 8000), ("cond_monotonic", 110, 12000),
              ("sem_timedwait", -1, 16000), ("mutex_timedlock", 110, 21000), ("mutex_lock", 0, 46000), ("join", 0, 46000)],
    # setitimer: 5 ms, then each 3 ms.
    "signals": [("pause", -1, 5000), ("sleep", -1, 8000), ("alarms", 2, 8000), ("interval", 3000, 8000), ("alarm", 8, 2008000),
                ("blocked", 0, 2018000), ("alarms", 0, 2018000), ("ppoll", -1, 2018000), ("alarms", 1, 2018000),
                ("sigsuspend", -1, 2022000), ("sigwait", 0, 2026000), ("signal", 1, 2026000), ("sigtimedwait", -1, 2028000),
                ("interrupted", -1, 2033000), ("left_ms", 9995, 2033000), ("join", 0, 2033000), ("cancelled", 0, 2034000)],
    "c11": [("slept", 1, 1000), ("result", 7, 1000)],
}
REFUSED = {
    "fork": "starts another process", "system": "starts another process", "exec": "replaces itself with another program",
    "rdtsc": "cycle counter", "spin_clock": "it reads the clock, or asks for input, again and again", "spin_port": "again and again",
    "spin_poll": "again and again", "spin_flag": "4 s of the processor", "timer_thread": "a timer that starts threads",
    "profile": "timer of processor time", "icanon": "cfmakeraw()", "io_uring": "io_uring",
    "mq_open": "POSIX message queue (mq_open)", "msgrcv": "System V message", "clock_settime": "it sets a clock (clock_settime",
}


def fly(case, **settings):
    return Flight(CLOCK, [PROGRAM, case, "{port}", "{reference_port}"], inputs=INPUTS.get(case, ()), wall_s=60, **settings)


class Waits(unittest.TestCase):
    def check_times(self, case):
        flight = fly(case)
        self.assertEqual(flight.code, 0, flight.output)
        self.assertIsNone(flight.refused)
        self.assertEqual(flight.output.splitlines(), [f"{name} {value} at {at}" for name, value, at in EXPECTED[case]])
        return flight

    def test_each_wait_ends_at_its_time(self):
        for case in EXPECTED:
            with self.subTest(case):
                self.check_times(case)

    def test_a_port_sends_what_is_written_at_its_time(self):
        flight = self.check_times("ports")
        self.assertEqual(flight.sent, [(230 * MS, 0, b"x" * 20)] * 5 + [(600 * MS, 1, b"reply\n")])

    def test_a_program_asks_for_nothing_but_its_deadlines(self):
        # Eight calls wait, of which one is for a time in the past.
        waits = [until_ns for _, until_ns in fly("sleeps").waits]
        self.assertEqual(waits, [at * 1000 for _, _, at in EXPECTED["sleeps"] if at not in (0,)][:4] +
                         [at * 1000 for _, _, at in EXPECTED["sleeps"][5:]])

    def test_time_begins_where_the_harness_says(self):
        flight = fly("sleeps", start_ns=5 * 10**9)
        self.assertEqual(flight.output.splitlines()[0], "nanosleep 0 at 5001500")


class Threads(unittest.TestCase):
    def test_threads_take_turns(self):
        lines = fly("threads").output.splitlines()
        turns = [f"{name} {i} at {(2 * i + (name == 'pong')) * 1000}" for i in range(3) for name in ("ping", "pong")]
        self.assertEqual(lines[:7], turns + ["joined 1 at 6000"])
        # One after the other through a lock for 0.1 ms; each of them twice.
        order = [line.split() for line in lines[7:-1]]
        self.assertEqual([int(words[3]) for words in order], [6000 + 100 * i for i in range(8)])
        self.assertEqual(sorted(int(words[1]) for words in order), [0, 0, 1, 1, 2, 2, 3, 3])
        self.assertEqual(lines[-1], "all 4 at 6800")

    def test_forty_threads_use_the_heap(self):
        self.assertEqual(fly("many").output, "joined 40 at 3000\n")

    def test_ten_repeats_are_equal(self):
        for case in ("threads", "locks", "random"):
            flights = [fly(case) for _ in range(10 if case == "threads" else 3)]
            self.assertEqual(len({flight.output for flight in flights}), 1, flights[0].output + flights[1].output)
            self.assertEqual(len({tuple(flight.waits) for flight in flights}), 1)


class Refusals(unittest.TestCase):
    def test_what_the_clock_cannot_hold_is_refused_with_the_reason(self):
        for case, reason in REFUSED.items():
            with self.subTest(case):
                flight = fly(case)
                self.assertIn(reason, flight.output)
                self.assertIn("tiltproof: the virtual clock cannot hold this program: it", flight.output)
                self.assertEqual(flight.code, 97)
                self.assertIn(reason, flight.refused)

    def test_a_crash_and_an_exit_stay_what_they_are(self):
        self.assertEqual(fly("crash").code, -11)
        self.assertEqual(fly("exit").code, 5)

    def test_helpers_of_a_script_are_not_the_program(self):
        flight = Flight(CLOCK, ["sh", "-c", '"$0" spin_clock 1 2; exec "$0" sleeps 1 2', PROGRAM], wall_s=60)
        self.assertEqual(flight.code, 0)
        self.assertEqual(flight.output.splitlines()[0], "nanosleep 0 at 1500")

    def test_the_end_of_the_flight_ends_a_program_that_waits(self):
        flight = fly("sleeps", until_ns=20 * MS)
        self.assertEqual(flight.code, 0)
        self.assertEqual(flight.output.splitlines(), [f"{name} {value} at {at}" for name, value, at in EXPECTED["sleeps"][:3]])


class Outside(unittest.TestCase):
    def test_without_a_flight_the_library_does_nothing(self):
        flight = Flight(CLOCK, [PROGRAM, "exit", "1", "2"], environment={"TILTPROOF_SOCKET": ""}, wall_s=5)
        self.assertEqual(flight.exchanges, 0)

    def test_a_wait_without_a_deadline_is_never(self):
        flight = fly("threads")
        self.assertTrue(all(until_ns < NEVER for _, until_ns in flight.waits))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
