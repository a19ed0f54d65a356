#!/usr/bin/env python3
"""Images whose drivers are written in the usual ways (tests/emulator/drivers/board.c) hover in lockstep, three times alike.

Usage: drivers_test.py TILTPROOF SOURCE-FOLDER
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
del sys.argv[1:3]
EXAMPLE = SOURCE / "firmware/examples/minimal_c"

SCENARIO = """\
name: flight
duration_s: 4
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
"""


class Drivers(unittest.TestCase):
    def test_hover(self):
        for driver, time_base in (("POLLED", "SYSTICK"), ("INTERRUPT", "SYSTICK"), ("DMA", "SYSTICK"), ("INTERRUPT", "TIM6"), ("DMA", "TIM6")):
            with self.subTest(driver=driver, time_base=time_base), tempfile.TemporaryDirectory() as name:
                folder = pathlib.Path(name)
                (folder / "scenario.yaml").write_text(SCENARIO)
                subprocess.run(["arm-none-eabi-gcc", "-std=c11", "-O2", "-ffp-contract=off", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16",
                                "-mfloat-abi=hard", "-Wall", "-Wextra", "-Werror", f"-DDRIVER={driver}", f"-DTIME_BASE={time_base}",
                                "-I", SOURCE, "--specs=nano.specs", "-nostartfiles", "-T", EXAMPLE / "stm32f4.ld",
                                SOURCE / "tests/emulator/drivers/board.c", EXAMPLE / "minimal_firmware.c", "-o", folder / "image.elf"], check=True)
                done = subprocess.run([TILTPROOF, "run", folder / "scenario.yaml", "--client", f"qemu:{folder / 'image.elf'}", "--repeat", "3",
                                       "--seed", "1", "--out", folder / "out", "--no-progress"], capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                results = json.loads((folder / "out/latest/results.json").read_text())["scenarios"]
                self.assertEqual(len({result["trace_hash"] for result in results}), 1, results)
                for result in results:
                    self.assertEqual(result["metrics"]["firmware.receive_overruns_count"], 0)
                    self.assertAlmostEqual(result["metrics"]["timing.request_period_mean_ms"], 12, delta=1e-4)


if __name__ == "__main__":
    unittest.main(verbosity=2)
