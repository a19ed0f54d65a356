#!/usr/bin/env python3
"""Stops of a debugger at awkward moments change no flight: its trace, the bytes on its lines and what the firmware printed are
those of the flight without a debugger.
Usage: debug_stops_test.py TILTPROOF IMAGE_DIR"""
import json
import pathlib
import random
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

from remote_debugger import RemoteDebugger, free_port

PROGRAM, IMAGES = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(2))
SCENARIO = """\
name: hover
duration_s: 1
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.5)"}
"""
# Image: a variable that its SysTick counts, and a function that is called at the start of the flight.
FIRMWARE = {
    "minimal_c": ("tick_count", "tiltproof_client_start"),
    "executive-paper": ("_ZN9tiltproof7stm32f412_GLOBAL__N_110tick_countE", "_ZN9tiltproof7stm32f410StartTicksEv"),
    "executive-tolerant": ("_ZN9tiltproof7stm32f412_GLOBAL__N_110tick_countE", "_ZN9tiltproof7stm32f410StartTicksEv"),
}
HANDLERS = ("SysTick_Handler", "USART2_IRQHandler")
SYSTICK_VALUE = 0xE000E018
BREAKPOINT, WRITE_WATCHPOINT = 0, 2


class Stopped(RemoteDebugger):
    """A board that has stopped at power-on, or at a time. Raises Over at the end of its flight."""

    class Over(Exception):
        pass

    def __init__(self, port):
        super().__init__(port)
        self.stops_count = 0
        self.ask("?")

    def _after(self, packet):
        if packet is None:
            raise self.Over
        self.stops_count += 1
        return packet

    def go(self):
        """On, to the next stop. From a breakpoint only after a step, or it is the next stop."""
        self.registers()
        self.send("c")
        return self._after(self.packet())

    def go_for(self, wait_s):
        """On, until it is stopped by force; or it has stopped by itself before that."""
        self.registers()
        self.send("c")
        while b"$" not in self.received:  # an acknowledgement may come before
            if select.select([self.socket], [], [], wait_s)[0]:
                got = self.socket.recv(4096)
                if not got:
                    raise self.Over
                self.received += got
            else:
                self.socket.sendall(b"\x03")
                wait_s = 0.05  # it is not heard before the last answer has been acknowledged
        self._after(self.packet())
        self.registers()

    def step(self, count=1):
        for _ in range(count):
            self._after(self.ask("s"))

    def word(self, address):
        return int.from_bytes(bytes.fromhex(self.ask(f"m{address:x},4")), "little")

    def set(self, kind, address, size=2):
        assert self.ask(f"Z{kind},{address:x},{size}") == "OK"

    def clear(self, kind, address, size=2):
        assert self.ask(f"z{kind},{address:x},{size}") == "OK"


class Image:
    def __init__(self, name):
        self.path = IMAGES / f"{name}.elf"
        table = subprocess.run(["arm-none-eabi-nm", self.path], capture_output=True, text=True, check=True).stdout
        self.symbols = {name: int(value, 16) & ~1 for value, kind, name in (line.split() for line in table.splitlines() if line[0] != " ")}
        code = subprocess.run(["arm-none-eabi-objdump", "-d", self.path], capture_output=True, text=True, check=True).stdout
        self.sleeps = [int(address, 16) for address in re.findall(r"^ *([0-9a-f]+):\t.*\twfi", code, re.MULTILINE)]
        self.counted, self.first = (self.symbols[name] for name in FIRMWARE[name])
        self.handlers = [self.symbols[name] for name in HANDLERS]


class StopsTest(unittest.TestCase):
    maxDiff = None
    undisturbed = {}  # what the flight without a debugger leaves, by image

    def fly(self, image, script=None, at_s=None):
        """What a flight leaves, and how often it has stopped."""
        folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-stops-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        (folder / "hover.yaml").write_text(SCENARIO)
        command = [PROGRAM, "run", "hover.yaml", "--client", f"qemu:{image.path}", "--out", "out", "--format", "jsonl"]
        if script:
            port = free_port()
            command += ["--gdb", str(port)] + (["--gdb-at", str(at_s)] if at_s else [])
        run = subprocess.Popen(command, cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        stops_count = 0
        try:
            if script:
                board = Stopped(port)
                try:
                    script(board)
                    while True:
                        board.go()
                except (Stopped.Over, ConnectionError):  # a flight may end while a stop is on its way
                    pass
                stops_count = board.stops_count
                board.socket.close()
            out, errors = run.communicate(timeout=120)
        finally:
            run.kill()
            run.communicate()
        result = json.loads(out.splitlines()[0])
        kept = folder / "out/latest/hover"
        self.assertEqual(result["verdict"], "pass", errors)
        return [result["trace_hash"], *((kept / name).read_bytes() for name in ("firmware.log", "link.bin"))], stops_count

    def check(self, script, at_s=None, stops_min=1):
        for name in FIRMWARE:
            image = Image(name)
            with self.subTest(image=name, at_s=at_s):
                flown, stops_count = self.fly(image, lambda board, image=image: script(board, image), at_s)
                if name not in self.undisturbed:
                    self.undisturbed[name] = self.fly(image)[0]
                self.assertEqual(flown, self.undisturbed[name])
                self.assertGreaterEqual(stops_count, stops_min)

    def test_breakpoint_at_the_start_of_a_function(self):
        def script(board, image):
            board.set(BREAKPOINT, image.first)
            board.go()
            self.assertEqual(board.program_counter(), image.first)
            board.clear(BREAKPOINT, image.first)

        self.check(script)

    def test_each_entry_of_interrupt_handlers(self):
        def script(board, image):
            for handler in image.handlers:
                board.set(BREAKPOINT, handler)
            for _ in range(40):
                board.go()
                self.assertIn(board.program_counter(), image.handlers)
                board.step(3)
            for handler in image.handlers:
                board.clear(BREAKPOINT, handler)

        self.check(script, stops_min=160)

    def test_before_and_after_a_sleep(self):
        def script(board, image):
            self.assertTrue(image.sleeps)
            for sleep in image.sleeps:
                board.set(BREAKPOINT, sleep)
            for _ in range(30):
                board.go()
                self.assertIn(board.program_counter(), image.sleeps)
                board.step()  # until something wakes it
            for sleep in image.sleeps:
                board.clear(BREAKPOINT, sleep)

        self.check(script, stops_min=60)

    def test_steps_across_a_tick(self):
        def script(board, image):
            board.set(BREAKPOINT, image.handlers[0])
            board.go()
            board.clear(BREAKPOINT, image.handlers[0])
            before = board.word(image.counted)
            board.step(800)
            # Interrupts are taken, as without steps.
            self.assertGreater(board.word(image.counted), before)

        self.check(script, stops_min=800)

    def test_watchpoint_on_what_a_tick_writes(self):
        def script(board, image):
            board.set(BREAKPOINT, image.first)  # memory has been cleared
            board.go()
            board.clear(BREAKPOINT, image.first)
            board.set(WRITE_WATCHPOINT, image.counted, 4)
            for _ in range(30):
                before = board.word(image.counted)
                self.assertIn("watch", board.go())
                # It has stopped before the access.
                board.clear(WRITE_WATCHPOINT, image.counted, 4)
                board.step()
                self.assertEqual(board.word(image.counted), before + 1)
                board.set(WRITE_WATCHPOINT, image.counted, 4)
            board.clear(WRITE_WATCHPOINT, image.counted, 4)

        self.check(script, stops_min=30)

    def test_a_stop_moves_no_time(self):
        def script(board, image):
            board.set(BREAKPOINT, image.handlers[0])
            for _ in range(10):
                board.go()
                value = board.word(SYSTICK_VALUE)
                time.sleep(0.02)
                self.assertEqual(board.word(SYSTICK_VALUE), value)
                board.step()
            board.clear(BREAKPOINT, image.handlers[0])

        self.check(script, stops_min=20)

    def test_times_of_the_flight(self):
        # In a sleep, between two ticks, shortly before and after one, and while bytes arrive.
        for at_s in (0.1, 0.2345, 0.4999, 0.60054):
            self.check(lambda board, image: None, at_s)
        self.check(lambda board, image: (board.go(), board.step(200)), 0.5, stops_min=200)

    def test_stops_by_force(self):
        chance = random.Random(1)

        def script(board, image):
            board.go_for(0)
            for wait_s in (0.002, 0.012):  # while the firmware starts, and in the flight
                for _ in range(12):
                    board.go_for(chance.uniform(0, wait_s))
                    if chance.random() < 0.5:
                        board.step(chance.randrange(1, 20))

        self.check(script)


if __name__ == "__main__":
    unittest.main(verbosity=2)
