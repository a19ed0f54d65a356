#!/usr/bin/env python3
"""The images for the STM32F4 in the emulator, by the machine's clock: they speak the protocol, and come back from what breaks them.

Usage: images_test.py FOLDER-OF-IMAGES PLUGIN
"""
import pathlib
import struct
import subprocess
import sys
import unittest

from emulator import Emulator, floats

IMAGES, PLUGIN = (pathlib.Path(argument) for argument in sys.argv[1:3])
del sys.argv[1:3]
HOVER = floats(2, 0, 0.5, *[0] * 13)
SP, PC = 13, 15


def images(pattern):
    found = sorted(IMAGES.glob(pattern))
    if not found:
        raise RuntimeError(f"no image {pattern} in {IMAGES}")
    return found


def symbol(image, name):
    for line in subprocess.check_output(["arm-none-eabi-nm", image], text=True).splitlines():
        if line.split()[-1] == name:
            return int(line.split()[0], 16)
    raise RuntimeError(f"{image.name} has no symbol {name}")


class Protocol(unittest.TestCase):
    def test_every_image_starts_asks_and_answers_a_reply_with_actuators(self):
        flying = [i for i in images("*.elf") if i.stem != "budgets"]
        self.assertGreaterEqual(len(flying), 6)
        for image in flying:
            dialect = next((name for name in ("provant", "hardened") if name in image.stem), "paper")
            if dialect == "hardened":
                self.check_hardened(image)
                continue
            # id of `start` and how many floats follow it, of the request, of the actuators
            start, request, actuators = {"paper": ((1, 0), 2, 3), "provant": ((3, 4), 1, 0)}[dialect]
            with self.subTest(image.name), Emulator(image, PLUGIN, dialect, answers=lambda n: HOVER) as board:
                messages = board.run(until=lambda board: board.request_count >= 10)
                self.assertEqual(board.damaged_count, 0)
                self.assertEqual(messages[0][:4], floats(start[0]))
                self.assertEqual(len(messages[0]), 4 + 4 * start[1])
                self.assertEqual(messages[1], floats(request))
                commands = [m for m in messages if len(m) == 20 and m[:4] == floats(actuators)]
                self.assertGreaterEqual(len(commands), 3, "a busy machine may lose some of ten, not most")

    def check_hardened(self, image):
        """Ids in one byte, then number and time; each message of a type has the next number, and a later time."""
        with self.subTest(image.name), Emulator(image, PLUGIN, "hardened", answers=lambda n: HOVER) as board:
            messages = board.run(until=lambda board: board.request_count >= 10)
            self.assertEqual(board.damaged_count, 0)
            # Since the last restart: on a busy machine the watchdog may come first.
            messages = messages[max(i for i, message in enumerate(messages) if message[:3] == bytes([1, 0, 0])):]
            headers = [struct.unpack("<BHI", message[:7]) for message in messages]
            self.assertEqual([header[0] for header in headers[:2]], [1, 2])
            for kind, size in ((1, 7), (2, 7), (3, 23)):
                own = [(header, message) for header, message in zip(headers, messages) if header[0] == kind]
                self.assertEqual({len(message) for _, message in own}, {size})
                self.assertEqual([header[1] for header, _ in own], list(range(len(own))))
                times = [header[2] for header, _ in own]
                self.assertEqual(times, sorted(set(times)))
            self.assertGreaterEqual(sum(header[0] == 3 for header in headers), 3)


class Restart(unittest.TestCase):
    """Something is broken from outside; the next start says what it was."""

    def console_after(self, image, damage):
        with Emulator(image, PLUGIN, debugger=True) as board:
            board.run(until=lambda board: "no valid reply" in board.console)
            board.stop()
            damage(board)
            board.go()
            board.run(until=lambda board: board.console.count("no valid reply") == 2)
            return board.console

    def test_a_jump_into_nothing_is_recorded_with_its_address(self):
        for image in images("*-paper.elf"):
            with self.subTest(image.name):
                console = self.console_after(image, lambda board: board.set_register(PC, 0x6000_0000))
                self.assertRegex(console, r"restarted after (hard|bus|memory) fault at pc=0x60000000 .*\(fault 1\)")

    def test_a_stack_that_has_left_ram_still_leaves_a_record(self):
        for image in images("*-paper.elf"):
            with self.subTest(image.name):
                below_ram = 0x2000_0000 - 64
                console = self.console_after(image, lambda board: board.set_register(SP, below_ram))
                self.assertRegex(console, r"restarted after \w+ fault at .*\(fault 1\)")

    def test_a_task_that_has_used_up_its_stack_is_found_out(self):
        for image in IMAGES.glob("freertos-paper.elf"):
            end = symbol(image, "get_sensors_stack")
            console = self.console_after(image, lambda board: board.write_memory(end, bytes(16)))
            self.assertRegex(console, r"restarted after stack overflow at pc=0x0800.*\(fault 1\)")


class Symbols(unittest.TestCase):
    """What others look up in an image (firmware/ports/stm32f4/symbols.h)."""

    NAMES = {
        "*.elf": ["tiltproof_status", "tiltproof_fault_record", "tiltproof_receive_errors", "tiltproof_run_statistics",
                  "_sstack", "_estack", "_sdata", "_edata", "_sbss", "_ebss", "main_receive_ring", "main_transmit_ring",
                  "reference_receive_ring", "console_transmit_ring"],
        "executive-*.elf": ["flight_application"],
        "freertos-*.elf": ["sensor_cycle", "control_activity", "actuator_writer", "reference_receiver", "get_sensors_stack",
                           "get_references_stack", "control_stack", "send_actuators_stack", "idle_stack"],
    }

    def test_named_objects_are_there(self):
        for pattern, names in self.NAMES.items():
            for image in IMAGES.glob(pattern):
                if image.stem in ("budgets", "minimal_c"):
                    continue
                for name in names:
                    with self.subTest(image.name, name=name):
                        self.assertGreaterEqual(symbol(image, name), 0x2000_0000)


if __name__ == "__main__":
    unittest.main(verbosity=2)
