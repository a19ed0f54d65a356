#!/usr/bin/env python3
"""Firmware on an emulated board that hangs in real time, and firmware that merely waits. Each image is firmware/examples/minimal_c with one mistake.
Usage: emulator_hangs_test.py TILTPROOF SOURCE_FOLDER"""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from flight import Flight, become_subreaper, read

PROGRAM, SOURCE = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(2))
EXAMPLE = SOURCE / "firmware/examples/minimal_c"
NOT_RUN = 77

# A flight that the machine itself disturbed says nothing: it is flown again.
ATTEMPTS_COUNT = 3

SCENARIO = """\
name: flight
duration_s: {duration_s}
reference: {{type: hover, at_m: [0, 0, 2]}}
criteria:
  - {{name: near, stl: "always(position_error_m <= 20)"}}
"""
LOOP = "    wake_ns = "
FAULT = (LOOP, "    if (tick_count > 700) (void)REGISTER(0x60000000);\n" + LOOP)
NO_RESET = ("  SCB_AIRCR = 0x05FA0004; /* key, SYSRESETREQ */\n", "")
ASLEEP = (NO_RESET[0] + "  for (;;) {\n", '  for (;;) {\n    __asm volatile("wfi");\n')
IN_HANDLER = (r"firmware hung at .*: the firmware hangs in a fault's handler since t = 0\.[67]\d\d s: bus fault: precise data access to 0x60000000 \(no memory\) "
              r"by main \(stm32f4\.c:\d+\)(, LR in \w+( \(stm32f4\.c:\d+\))?)?; the hard fault's handler, Reset \(stm32f4\.c:\d+\), does not end")


class EmulatorHangsTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-hangs-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def image(self, *replacements):
        for file in ("stm32f4.c", "minimal_firmware.c"):
            text = (EXAMPLE / file).read_text()
            for old, new in replacements:
                if file == "stm32f4.c":
                    self.assertIn(old, text, "no replacement fits the example any more")
                text = text.replace(old, new)
            (self.folder / file).write_text(text)
        elf = self.folder / "image.elf"
        subprocess.run(["arm-none-eabi-gcc", "-std=c11", "-O2", "-g", "-ffp-contract=off", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16",
                        "-mfloat-abi=hard", "-I", SOURCE, "--specs=nano.specs", "-nostartfiles", "-T", EXAMPLE / "stm32f4.ld",
                        *sorted(self.folder.glob("*.c")), "-o", elf], check=True)
        return elf

    def start(self, elf, duration_s=8, more=""):
        path = self.folder / "flight.yaml"
        path.write_text(SCENARIO.format(duration_s=duration_s) + more)
        flight = Flight(PROGRAM, self.folder, path, "--client", f"qemu:{elf}")
        self.addCleanup(flight.end)
        return flight

    def end_of(self, flight, again):
        """Its exit code; of another one while the machine was too busy to judge."""
        for _ in range(ATTEMPTS_COUNT):
            code = flight.wait(60)
            if code != 4:
                return flight, code
            self.assertIn("too busy to judge", flight.text())
            flight = again()
        self.skipTest(f"this machine was too busy, {ATTEMPTS_COUNT} times over")

    def check_hangs(self, fly, reason):
        flight, code = self.end_of(fly(), fly)
        self.assertEqual(code, 1, flight.text())
        result = flight.result()
        self.assertEqual((result["verdict"], result["end_reason"]), ("fail", "firmware_hung"), result)
        self.assertRegex(result["reason"], reason)
        log = read(next(flight.run_folder.glob("*/firmware.log"))).decode()
        for words in ("PC 0x", "CFSR 0x", "USART2 (main line) has sent ", "R00="):
            self.assertIn(words, log)
        flight.check_results(self)
        flight.check_nothing_left(self)
        print(f"\n    {result['reason']}", file=sys.stderr)

    def check_flies_on(self, flight, codes=(0, 4)):
        code = flight.wait(60)
        self.assertIn(code, codes, flight.text())
        self.assertNotIn("firmware hang", flight.text())
        # A machine that is too busy to judge may also lose the vehicle.
        if code != 4:
            self.assertEqual(flight.result()["end_reason"], "completed")
        flight.check_nothing_left(self)

    def test_an_endless_loop(self):
        elf = self.image((LOOP, "    while (tick_count > 700) {\n    }\n" + LOOP))
        self.check_hangs(lambda: self.start(elf), r"firmware hung at [23]\.\d+ s: the firmware hangs: for 2 s, since t = 0\.[678]\d\d s, it has neither slept nor sent a byte; "
                                                  # An interrupt may be under way, and be all that was seen.
                                                  r"it is in \w+ \(stm32f4\.c:\d+\).*( and reads the variable tick_count again and again|which interrupted main)")

    def test_the_loop_of_a_faults_handler(self):
        elf = self.image(FAULT, NO_RESET)
        self.check_hangs(lambda: self.start(elf), IN_HANDLER)

    def test_sleep_in_a_faults_handler(self):
        elf = self.image(FAULT, ASLEEP)
        self.check_hangs(lambda: self.start(elf), IN_HANDLER)

    def test_time_in_which_the_emulator_is_stopped_is_not_charged(self):
        elf = self.image((LOOP, "    while (tick_count > 700) {\n    }\n" + LOOP))

        def fly():
            flight = self.start(elf, duration_s=30)
            flight.wait_flying()
            [emulator] = [pid for pid, command in flight.processes().items() if "qemu-system-arm" in command[0] and "-kernel" in command]
            time.sleep(1)
            os.kill(emulator, signal.SIGSTOP)
            # In all it is silent for longer than the limit by then.
            time.sleep(2.4)
            self.assertNotIn("firmware hung", flight.text())
            os.kill(emulator, signal.SIGCONT)
            return flight
        self.check_hangs(fly, "the firmware hangs: for 2 s")

    def test_who_waits_does_not_hang(self):
        # The fault loses all that the firmware sends, and all that it is sent.
        silence = "faults: [{id: silence, type: link.silence, target: both, start_s: 1, end_s: 4}]\n"
        self.check_flies_on(self.start(self.image(), duration_s=5, more=silence))

    def test_who_is_held_by_a_fault_does_not_hang(self):
        stall = "faults: [{id: stall, type: device.stall, start_s: 1, end_s: 3.5}]\n"
        self.check_flies_on(self.start(self.image(), duration_s=4, more=stall))

    def test_who_sleeps_does_not_hang(self):
        flight = self.start(self.image((LOOP, '    while (tick_count > 700) __asm volatile("wfi");\n' + LOOP)), duration_s=4)
        self.check_flies_on(flight, (1, 4))  # but it asks for nothing any more
        if flight.result()["verdict"] == "fail":
            self.assertRegex(flight.result()["reason"], r"^clean_line: \d+ of \d+ periods without a request, the first at 0\.7\d\d s")

    def test_a_busy_boot_is_no_hang(self):
        boot = ("  StartUsartsAndTicks();\n  while (tick_count == 0) {\n", "  StartUsartsAndTicks();\n  while (tick_count < 3000) {\n")
        self.check_flies_on(self.start(self.image(boot), duration_s=4))


if __name__ == "__main__":
    if shutil.which("qemu-system-arm") is None or shutil.which("arm-none-eabi-gcc") is None:
        print("no qemu-system-arm, or no arm-none-eabi-gcc", file=sys.stderr)
        sys.exit(NOT_RUN)
    become_subreaper()
    unittest.main(verbosity=2)
