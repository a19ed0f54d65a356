#!/usr/bin/env python3
"""Images whose board is set up wrongly - they restart for ever, ask at the wrong rate, send at the wrong baud rate, have their USARTs exchanged - must not pass,
and the harness must say what is wrong. Each is firmware/examples/minimal_c with one mistake.

Usage: wrong_boards_test.py TILTPROOF FOLDER-OF-IMAGES SOURCE-FOLDER [WrongPrograms | WrongChips]
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import minimal_image

TILTPROOF, IMAGES, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:4])
del sys.argv[1:4]
EXAMPLE = SOURCE / "firmware/examples/minimal_c"

SCENARIO = """\
name: flight
duration_s: {duration_s}
reference: {{type: hover, at_m: [0, 0, 2]}}
criteria:
  - {{name: near, stl: "always(position_error_m <= 1)"}}
"""
# An endless loop. One of long blocks is emulated in much less time than a short one.
LOOP = '  for (;;) __asm volatile(".rept 200\\n\\tnop\\n\\t.endr");\n'
# Enough for a board that talks: it starts within 30 ms.
SOON = "start_within_s: 2\n"
# Runs for a while, then into a bus fault, whose handler waits for the independent watchdog.
CRASH_LOOP = [
    ("static void Reset(void) {\n", "static void Reset(void) {\n" + LOOP),
    ("  StartUsartsAndTicks();\n  while", "  StartUsartsAndTicks();\n  REGISTER(0x40003000) = 0xCCCC;\n  while"),
    ("    wake_ns = ", "    REGISTER(0x40003000) = 0xAAAA;\n    if (tick_count > 700) (void)REGISTER(0x60000000);\n    wake_ns = "),
]


class Flights(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls._folder.name)
        cls.runs = 0

    @classmethod
    def tearDownClass(cls):
        cls._folder.cleanup()

    def image(self, name, replacements):
        """The example with these mistakes."""
        return f"qemu:{minimal_image.build(SOURCE, self.root / name, replacements)}"

    def run_tiltproof(self, *arguments):
        return subprocess.run([str(TILTPROOF), *map(str, arguments)], capture_output=True, text=True, timeout=120)

    def fly(self, client, *flags, duration_s=3, more=""):
        type(self).runs += 1
        file, out = self.root / f"scenario{self.runs}.yaml", self.root / f"out{self.runs}"
        file.write_text(SCENARIO.format(duration_s=duration_s) + more)
        done = self.run_tiltproof("run", file, "--client", client, "--out", out, "--no-progress", *flags)
        self.assertTrue((out / "latest").exists(), done.stdout + done.stderr)
        [result] = json.loads((out / "latest/results.json").read_text())["scenarios"]
        return out / "latest", result, done.stdout

    def criterion(self, result, name):
        return next((criterion for criterion in result["criteria"] if criterion["name"] == name), None)

    def events(self, folder, kind):
        lines = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
        return " ".join(line["text"] for line in lines if line["kind"] == kind)

    def score(self, folder):
        return json.loads(self.run_tiltproof("score", folder, "--format", "jsonl").stdout.splitlines()[0])


class WrongPrograms(Flights):
    # --- restarts ---

    def test_a_crash_loop_fails_survival(self):
        client = self.image("loop", CRASH_LOOP)
        for flags in ([], ["--distributed=socket"]):
            folder, result, output = self.fly(client, *flags, duration_s=4.5)
            self.assertEqual(result["verdict"], "fail", output)
            survival = self.criterion(result, "survival")
            self.assertEqual(survival["verdict"], "fail")
            self.assertTrue(1.1 < survival["time_s"] < 1.3, survival)  # the crash at 0.7 s, the watchdog 512 ms later
            self.assertIn("no fault asked for", survival["explanation"])
            self.assertRegex(survival["explanation"], r"reset by watchdog: bus fault: precise data access to 0x60000000 \(no memory\) by main \(stm32f4\.c:\d+\)")
            self.assertGreaterEqual(result["restarts"], 3)
            self.assertIn(f"{result['restarts']} restarts", output)
            # The same from the files.
            again = self.score(folder)
            self.assertEqual((again["verdict"], again["reason"]), (result["verdict"], result["reason"]))

    def test_restarts_can_be_allowed(self):
        _, result, output = self.fly(self.image("allowed", CRASH_LOOP), duration_s=4.5, more="allow_restarts: true\n")
        self.assertEqual(self.criterion(result, "survival")["verdict"], "pass", output)
        self.assertGreaterEqual(result["restarts"], 3)
        self.assertIn(f"{result['restarts']} restarts", output)

    def test_a_fault_asks_for_one_restart_and_no_more(self):
        fault = "faults: [{{id: r, type: device.reset, start_s: {}, parameters: {{boot_ms: 5}}}}]\n"
        _, result, output = self.fly(f"qemu:{IMAGES / 'minimal_c.elf'}", duration_s=2, more=fault.format(1))
        self.assertEqual((result["verdict"], result["restarts"]), ("pass", 1), output)
        _, result, _ = self.fly(self.image("looping", CRASH_LOOP), more=fault.format(0.3))
        self.assertEqual(self.criterion(result, "survival")["verdict"], "fail")
        self.assertGreater(self.criterion(result, "survival")["time_s"], 0.9)

    # --- faults and waits in flight ---

    def test_a_fault_in_flight_is_told_with_its_time_and_line(self):
        # The same number of lines before it, since one is taken out.
        line = (EXAMPLE / "stm32f4.c").read_text().split("    wake_ns = tiltproof_client_grant")[0].count("\n")
        fault = [("    wake_ns = tiltproof_client_grant", "    if (tick_count > 700) (void)REGISTER(0x60000000); wake_ns = tiltproof_client_grant"),
                 ("  SCB_AIRCR = 0x05FA0004; /* key, SYSRESETREQ */\n  for (;;) {\n  }\n", LOOP + "\n")]
        client = self.image("faulty", fault)
        for flags in ([], ["--distributed=socket"]):
            _, result, output = self.fly(client, *flags)
            self.assertRegex(result["reason"], rf"hangs in a fault's handler since t = 0\.[67]\d\d s: bus fault: precise data access to 0x60000000 \(no memory\) by main \(stm32f4\.c:{line}\)")

    def test_a_long_boot_is_no_hang(self):
        boot = [("  StartUsartsAndTicks();\n", "  StartUsartsAndTicks();\n  while (tick_count < 3000) {\n  }\n")]
        _, result, output = self.fly(self.image("long-boot", boot), duration_s=4)
        self.assertEqual(result["verdict"], "pass", output)

    # --- the core clock ---

    def test_a_period_of_6_ms_fails_control_period(self):
        client = self.image("fast", [("kPeriodNs = 12000000", "kPeriodNs = 6000000")])
        for flags in ([], ["--distributed=socket"]):
            folder, result, output = self.fly(client, *flags)
            self.assertEqual(result["verdict"], "fail", output)
            control_period = self.criterion(result, "control_period")
            self.assertEqual(control_period["verdict"], "fail")
            self.assertIn("asks every 6.000 ms, the protocol requires 12 ms: is the core clock right?", control_period["explanation"])
            self.assertIn("asks every 6.000 ms", output)
            self.assertEqual(self.score(folder)["verdict"], "fail")
        _, result, _ = self.fly(client, more="control_period: {tolerance_percent: 60}\n")
        self.assertEqual(self.criterion(result, "control_period")["verdict"], "pass")

    def test_a_right_period_passes(self):
        _, result, _ = self.fly(f"qemu:{IMAGES / 'minimal_c.elf'}")
        self.assertEqual(self.criterion(result, "control_period")["verdict"], "pass")
        self.assertEqual(result["verdict"], "pass")
        _, result, _ = self.fly(f"qemu:{IMAGES / 'minimal_c.elf'}", duration_s=0.5)
        self.assertIsNone(self.criterion(result, "control_period"), "too short to judge")

    def fly_by_the_clock(self, client):
        """A machine that was late itself blames no firmware, and flies again."""
        for _ in range(3):
            _, result, output = self.fly(client, "--mode", "realtime")
            if result["verdict"] != "inconclusive":
                return result, output
        self.assertIn("this machine was too busy to judge a firmware", output)
        self.skipTest("this machine was too busy, three times, to judge a firmware in real time")

    def test_a_period_of_6_ms_fails_by_the_clock_too(self):
        result, output = self.fly_by_the_clock(self.image("fast-by-the-wall", [("kPeriodNs = 12000000", "kPeriodNs = 6000000")]))
        self.assertIsNotNone(self.criterion(result, "control_period"), output)
        self.assertIn("the protocol requires 12 ms", self.criterion(result, "control_period")["explanation"], output)

    def test_a_crash_loop_fails_by_the_clock_too(self):
        crash = [("    wake_ns = ", "    if (tick_count > 700) (void)REGISTER(0x60000000);\n    wake_ns = ")]
        result, output = self.fly_by_the_clock(self.image("loop-by-the-wall", crash))
        self.assertIn("no fault asked for", self.criterion(result, "survival")["explanation"], output)
        self.assertGreaterEqual(result["restarts"], 2)


class WrongChips(Flights):
    # --- the baud rate ---

    def test_a_wrong_baud_rate_never_starts_and_says_both_rates(self):
        client = self.image("slow-line", [("kLineBaud = 921600", "kLineBaud = 460800")])
        for flags in ([], ["--distributed=socket"]):
            _, result, output = self.fly(client, *flags, more=SOON)
            self.assertEqual(result["verdict"], "fail", output)
            # 42 MHz / 91
            for words in ("never started", "USART2", "461538", "921600"):
                self.assertIn(words, result["reason"])
        folder, result, output = self.fly(client, more="link: {baud: 460800}\n")
        self.assertIn("USART3 runs at 461538 baud", self.events(folder, "line_trouble"), "the reference line keeps its rate")
        self.assertGreater(result["metrics"]["link.to_plant.frames_accepted_count"], 0, output)

    def test_within_the_receivers_tolerance_nothing_is_damaged(self):
        for divider in (45, 47):  # 1.3 % fast, 3.0 % slow; 44 is 3.6 % fast
            client = self.image(f"divider-{divider}", [("(kApb1Hz + kLineBaud / 2) / kLineBaud", str(divider))])
            folder, result, output = self.fly(client)
            self.assertEqual((result["verdict"], self.events(folder, "line_trouble")), ("pass", ""), output)

    def test_beyond_it_bytes_are_damaged_both_ways(self):
        # Only what the board receives: its main line's receiver is right, its reference line's is not.
        client = self.image("reference-line", [("USART_BRR(USART3) = (kApb1Hz + kLineBaud / 2) / kLineBaud", "USART_BRR(USART3) = 42")])
        folder, result, output = self.fly(client)
        self.assertIn("USART3 runs at 1000000 baud", self.events(folder, "line_trouble"))
        # And both ways: nothing of what it sends is accepted.
        _, result, output = self.fly(self.image("main-line", [("USART_BRR(USART2) = (kApb1Hz + kLineBaud / 2) / kLineBaud", "USART_BRR(USART2) = 42")]), more=SOON)
        self.assertIn("never started", result["reason"])
        self.assertEqual(result["metrics"]["link.to_plant.frames_accepted_count"], 0)

    def test_a_usart_without_a_rate_sends_nothing(self):
        _, result, _ = self.fly(self.image("no-rate", [("USART_BRR(USART2) = (kApb1Hz + kLineBaud / 2) / kLineBaud", "USART_BRR(USART2) = 0")]), more=SOON)
        # It waits for ever for its transmitter, which is told as the hang that it is.
        self.assertRegex(result["reason"], r"USART2 \(main line\) .*no baud rate \(BRR is 0\)")

    def test_oversampling_by_8_is_known(self):
        over8 = [("(kApb1Hz + kLineBaud / 2) / kLineBaud", "0x56"), ("BIT(13) |", "BIT(15) | BIT(13) |")]
        _, result, output = self.fly(self.image("over8", over8))
        self.assertEqual(result["verdict"], "pass", output)

    # --- the crystal ---

    def test_another_crystal_is_another_clock(self):
        _, result, output = self.fly(f"qemu:{IMAGES / 'minimal_c.elf'},hse=25000000")
        # 25 MHz / 8
        self.assertEqual(result["verdict"], "fail")
        self.assertIn("RCC_PLLCFGR: the input of the PLL's VCO is 3.1 MHz, and 1 to 2 MHz are allowed", result["reason"], output)

    # --- the chip's limits (RM0090) ---

    def test_clocks_that_no_chip_has_fail(self):
        pll = "7u << 24 | BIT(22) | 0u << 16 | 336u << 6 | 8u;"
        select = "RCC_CFGR = 5u << 10 | 4u << 13 | 2u;"
        selected = f"{select} while ((RCC_CFGR & (3u << 2)) != 2u << 2) {{}}"
        for name, old, new, words in (
                ("wait-states", "| 5u; /* caches", "| 0u; /* caches", "FLASH_ACR: 0 wait states at 168 MHz, which needs 5"),
                ("one-too-few", "| 5u; /* caches", "| 4u; /* caches", "FLASH_ACR: 4 wait states at 168 MHz, which needs 5"),
                ("vco", pll, "7u << 24 | BIT(22) | 1u << 16 | 432u << 6 | 4u;", "RCC_PLLCFGR: the PLL's VCO runs at 864 MHz, and 100 to 432 MHz are allowed"),
                ("core", pll, "7u << 24 | BIT(22) | 0u << 16 | 432u << 6 | 8u;", "RCC_CFGR: the core runs at 216 MHz, and at most 168 MHz are allowed"),
                ("wait-states-taken-away", select, f"{selected} FLASH_ACR = 0;", "FLASH_ACR: 0 wait states at 168 MHz, which needs 5"),
                ("scale-taken-away", select, f"{selected} REGISTER(0x40023840) |= BIT(28); REGISTER(0x40007000) = 0;",
                 "PWR_CR: the core runs at 168 MHz with the regulator at scale 2, which allows 144 MHz"),
                ("bus", select, "RCC_CFGR = 4u << 10 | 4u << 13 | 2u;", "RCC_CFGR: APB1 runs at 84 MHz, and at most 42 MHz are allowed")):
            client = self.image(f"limit-{name}", [(old, new)])
            for flags in ([], ["--mode", "realtime"]) if name == "vco" else ([],):
                _, result, output = self.fly(client, *flags, duration_s=1)
                self.assertEqual(result["verdict"], "fail", output)
                # On a busy machine, another criterion may fail before in real time.
                self.assertIn(words, result["reason"] if not flags else json.dumps(result), output)

    def test_without_a_crystal_ours_flies_by_the_internal_oscillator(self):
        folder, result, output = self.fly(f"qemu:{IMAGES / 'executive-paper.elf'},hse=0")
        self.assertEqual(result["verdict"], "pass", output)
        self.assertIn("without crystal", (folder / "flight/firmware.log").read_text())

    # --- the wiring ---

    def test_exchanged_usarts_are_told(self):
        swapped = [("#define USART2 0x40004400", "#define USART2 0x40004800"), ("#define USART3 0x40004800", "#define USART3 0x40004400"),
                   ("[16 + 38] = USART2_IRQHandler", "[16 + 38] = USART3_IRQHandler"), ("[16 + 39] = USART3_IRQHandler", "[16 + 39] = USART2_IRQHandler")]
        client = self.image("exchanged", swapped)
        for flags in ([], ["--distributed=socket"], ["--mode", "realtime"]):
            # A busy machine needs longer in real time.
            _, result, output = self.fly(client, *flags, more="" if "realtime" in flags else SOON)
            self.assertIn("never started", result["reason"])
            self.assertIn("the client talks on the reference line", result["reason"], output)
            self.assertIn("exchanged", result["reason"])
        _, result, output = self.fly(client + ",main=usart3,reference=usart2")
        self.assertEqual(result["verdict"], "pass", output)


if __name__ == "__main__":
    unittest.main(verbosity=2)
