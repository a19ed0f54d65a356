#!/usr/bin/env python3
"""Images whose drivers are written in the usual ways (tests/emulator/drivers/board.c) hover in lockstep, three times alike, with parity, too.

Usage: drivers_test.py TILTPROOF SOURCE-FOLDER
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
del sys.argv[1:3]
EXAMPLE = SOURCE / "firmware/examples/minimal_c"

M, PCE, PS = 1 << 12, 1 << 10, 1 << 9  # of CR1

SCENARIO = """\
name: flight
duration_s: 4
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
"""


def build(folder, driver, time_base, cr1_format=0):
    image = folder / "image.elf"
    subprocess.run(["arm-none-eabi-gcc", "-std=c11", "-O2", "-g", "-ffp-contract=off", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16",
                    "-mfloat-abi=hard", "-Wall", "-Wextra", "-Werror", f"-DDRIVER={driver}", f"-DTIME_BASE={time_base}", f"-DFORMAT={cr1_format:#x}u",
                    "-I", SOURCE, "--specs=nano.specs", "-nostartfiles", "-T", EXAMPLE / "stm32f4.ld",
                    SOURCE / "tests/emulator/drivers/board.c", EXAMPLE / "minimal_firmware.c", "-o", image], check=True)
    return image


def fly(folder, image, scenario, *more):
    (folder / "scenario.yaml").write_text(scenario)
    done = subprocess.run([TILTPROOF, "run", folder / "scenario.yaml", "--client", f"qemu:{image}", "--seed", "1", "--out", folder / "out",
                           "--no-progress", *more], capture_output=True, text=True)
    if not (folder / "out/latest").exists():
        raise AssertionError(done.stdout + done.stderr)
    return done, json.loads((folder / "out/latest/results.json").read_text())["scenarios"]


class Drivers(unittest.TestCase):
    def test_hover(self):
        for driver, time_base in (("POLLED", "SYSTICK"), ("INTERRUPT", "SYSTICK"), ("DMA", "SYSTICK"), ("INTERRUPT", "TIM6"), ("DMA", "TIM6")):
            with self.subTest(driver=driver, time_base=time_base), tempfile.TemporaryDirectory() as name:
                folder = pathlib.Path(name)
                done, results = fly(folder, build(folder, driver, time_base), SCENARIO, "--repeat", "3")
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                self.assertEqual(len({result["trace_hash"] for result in results}), 1, results)
                for result in results:
                    self.assertEqual(result["metrics"]["firmware.receive_overruns_count"], 0)
                    self.assertAlmostEqual(result["metrics"]["timing.request_period_mean_ms"], 12, delta=1e-4)

    def test_parity(self):
        """Drivers with 8E1 and 8O2 hover on such a line, and see each parity error of the line as PE (RM0090, sections 30.3.3 and 30.6.1)."""
        for link, cr1_format in (("parity: even", M | PCE), ("parity: odd, stop_bits: 2", M | PCE | PS)):
            for ber in (1e-4, 4e-4):
                with self.subTest(link=link, ber=ber), tempfile.TemporaryDirectory() as name:
                    folder = pathlib.Path(name)
                    faults = f"[{{id: noise, type: wire.bit_error, target: to_client, start_s: 0.5, end_s: 3.5, parameters: {{ber: {ber}}}}}]"
                    scenario = SCENARIO + f"link: {{{link}}}\nfaults: {faults}\nwatch: ['parity_errors[0]', 'parity_errors[1]']\n"
                    done, [result] = fly(folder, build(folder, "INTERRUPT", "SYSTICK", cr1_format), scenario)
                    self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                    count = result["metrics"]["link.to_client.parity_errors_count"]
                    with open(folder / "out/latest/flight/trace.csv", newline="") as trace:
                        last = list(csv.DictReader(trace))[-1]
                    self.assertEqual(float(last["watch_parity_errors_0"]), count)
                    self.assertEqual(float(last["watch_parity_errors_1"]), 0)
                    # 250 replies of 68 bytes at least, 9 bits a byte.
                    self.assertAlmostEqual(count, ber * 250 * 69 * 9, delta=4 * (ber * 250 * 69 * 9) ** 0.5)

    def test_other_characters(self):
        """A board that is set to other characters than the line: an event names both. With other bits in each byte the flight never starts."""
        for link, cr1_format, code, text in (("parity: even", 0, 1, "USART2 is set to 8N1, the main line to 8E1"),
                                             ("parity: none", PCE, 1, "USART2 is set to 7E1, the main line to 8N1"),
                                             # Each byte is right but for its parity bit, which neither end heeds.
                                             ("parity: even", M | PCE | PS, 0, "USART2 is set to 8O1, the main line to 8E1"),
                                             # Receivers check the first stop bit only.
                                             ("stop_bits: 2", 0, 0, "USART2 is set to 8N1, the main line to 8N2")):
            with self.subTest(text=text), tempfile.TemporaryDirectory() as name:
                folder = pathlib.Path(name)
                scenario = SCENARIO + f"link: {{{link}}}\nwatch: ['parity_errors[0]']\n"
                done, [result] = fly(folder, build(folder, "INTERRUPT", "SYSTICK", cr1_format), scenario)
                self.assertEqual(done.returncode, code, done.stdout + done.stderr)
                self.assertIn(text, (folder / "out/latest/flight/flight.json").read_text())
                if code == 1:
                    self.assertIn(text, json.dumps(result))
                if cr1_format == M | PCE | PS:
                    with open(folder / "out/latest/flight/trace.csv", newline="") as trace:
                        errors = float(list(csv.DictReader(trace))[-1]["watch_parity_errors_0"])
                    self.assertGreater(errors, 330 * 68)  # every byte of the replies of four seconds


if __name__ == "__main__":
    unittest.main(verbosity=2)
