#!/usr/bin/env python3
"""The registers that the plug-in adds to the emulated chip, against RM0090: one bare image for each block (tests/emulator/registers), which prints
what is wrong. What USART and DMA send is also timed here.

Usage: registers_test.py PLUGIN SOURCE-FOLDER
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

from lockstep_board import FRAMING, NOISE, NONE, PARITY, LockstepBoard

PLUGIN, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
del sys.argv[1:3]
IMAGES = SOURCE / "tests/emulator/registers"
MS = 1_000_000
BYTE_NS = 10_000  # at 1 Mbaud
# Answers of the other end to each request of the image, 1 ms later: bytes with the receiver's mark.
ANSWERS = {
    "A": [("x", NONE)],
    "B": [("x", NONE), ("y", NONE)],
    "C": [(character, NONE) for character in "12345"],
    "D": [(character, NONE) for character in "0123456789ab"],
    "F": [("x", FRAMING)],
    "N": [("x", NOISE)],
    "P": [("x", PARITY)],
    # Words with the parity bit on top: 8 data bits in 9, 7 data bits in 8.
    "Q": [(chr(0x178), NONE)],
    "R": [(chr(0xF8), PARITY)],
}


class Registers(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._folder = tempfile.TemporaryDirectory()

    @classmethod
    def tearDownClass(cls):
        cls._folder.cleanup()

    def run_image(self, name, more="", until_ns=300 * MS):
        elf = pathlib.Path(self._folder.name, f"{name}.elf")
        subprocess.run(["arm-none-eabi-g++", "-std=c++20", "-O2", "-mcpu=cortex-m4", "-mthumb", "-ffreestanding", "-fno-exceptions", "-fno-rtti",
                        "-Wall", "-Wextra", "-Werror", "-I", SOURCE, "-nostdlib", "-T", SOURCE / "firmware/examples/minimal_c/stm32f4.ld",
                        IMAGES / "bare.cpp", IMAGES / f"{name}.cpp", "-lgcc", "-o", elf], check=True)
        answered = 0

        def answer(board):
            nonlocal answered
            for at, byte in board.sent[answered:]:
                for i, (character, mark) in enumerate(ANSWERS.get(chr(byte), [])):
                    board.receive(at + MS + i * BYTE_NS, ord(character), mark)
            answered = len(board.sent)

        with LockstepBoard(PLUGIN, elf, more=more, on_stop=answer) as board:
            # A byte is answered in time although the board stops for none: turns are shorter than the answer's delay.
            while "done" not in board.console and board.now_ns < until_ns:
                board.run(board.now_ns + MS // 2)
            lines = board.console.splitlines()
            self.assertEqual([line for line in lines if not line.startswith(("ok ", "done"))], [], board.console)
            self.assertEqual(lines[-1:], ["done"], board.console)
            self.assertGreater(len(lines), 5)
            return board

    def test_clock_tree(self):
        self.run_image("clock_tree")

    def test_power_and_flash(self):
        self.run_image("power_and_flash")

    def test_gpio(self):
        self.run_image("gpio")

    def test_core(self):
        self.run_image("core")

    def test_reading(self):
        self.run_image("reading")

    def test_timers(self):
        self.run_image("timers")

    def test_usart(self):
        board = self.run_image("usart")
        self.assertEqual(board.usart[4], 16_000_000, "the clock that the harness is told")
        # A byte is given to the transmitter when the one before has been handed on, a byte time after the last.
        times = {chr(byte): at for at, byte in board.sent}
        self.assertAlmostEqual(times["a"] - times["b"], BYTE_NS, delta=500)

    def test_dma(self):
        board = self.run_image("dma")
        text = [(at, chr(byte)) for at, byte in board.sent if chr(byte) in "helo"][:5]
        self.assertEqual("".join(character for _, character in text), "hello")
        for (before, _), (after, _) in zip(text[1:], text[2:]):
            self.assertAlmostEqual(after - before, BYTE_NS, delta=10)


if __name__ == "__main__":
    unittest.main(verbosity=2)
