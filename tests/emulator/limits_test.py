#!/usr/bin/env python3
"""Images that no harness should endure - each instant of theirs costs ages of processor time, or they reset again and again - fail,
and soon. Images that use what the emulated board lacks are told so when they fail. Each is firmware/examples/minimal_c with one mistake.

Usage: limits_test.py TILTPROOF SOURCE-FOLDER
"""
import json
import pathlib
import resource
import subprocess
import sys
import tempfile
import unittest

import minimal_image

TILTPROOF, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:3])
del sys.argv[1:3]

SCENARIO = """\
name: flight
duration_s: {duration_s}
start_within_s: 0.5
reference: {{type: hover, at_m: [0, 0, 2]}}
criteria:
  - {{name: near, stl: "always(position_error_m <= 1)"}}
"""
GRANT = "    wake_ns = tiltproof_client_grant"
STARTED = "  StartUsartsAndTicks();\n  while"
MAIN = "int main(void) {\n"
# RAM behind all variables, which no start-up clears.
MARK = "REGISTER(0x2001F000)"


def in_flight(code):
    """From 0.7 s after power-on, in the main loop."""
    return (GRANT, f"    if (tick_count > 700) {{ {code} }}\n{GRANT}")


class Limits(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls._folder.name)

    @classmethod
    def tearDownClass(cls):
        cls._folder.cleanup()

    def fly(self, replacements, *flags, duration_s=30):
        """The result, what the terminal says, the flight's folder, and the processor time that all of it has cost."""
        name = f"{self.id().split('.')[-1]}{len(list(self.root.iterdir()))}"
        elf = minimal_image.build(SOURCE, self.root / name, replacements)
        file, out = self.root / f"{name}.yaml", self.root / f"{name}-out"
        file.write_text(SCENARIO.format(duration_s=duration_s))

        def used_s():
            usage = resource.getrusage(resource.RUSAGE_CHILDREN)
            return usage.ru_utime + usage.ru_stime

        before_s = used_s()
        done = subprocess.run([str(TILTPROOF), "run", file, "--client", f"qemu:{elf}", "--out", out, "--no-progress", *flags],
                              capture_output=True, text=True, timeout=300)
        cost_s = used_s() - before_s
        self.assertIn(done.returncode, (0, 1, 4), done.stdout + done.stderr)  # 4: too busy to judge, in real time
        [result] = json.loads((out / "latest/results.json").read_text())["scenarios"]
        print(f"\n    {cost_s:.1f} s: {result['reason']}", file=sys.stderr)
        return result, done.stdout, out / "latest/flight", cost_s

    # --- processor time ---

    def costs_too_much(self, replacements, place, *flags):
        result, output, folder, cost_s = self.fly(replacements, *flags)
        self.assertEqual((result["verdict"], result["end_reason"]), ("fail", "firmware_hung"), output)
        # A fast machine flies two seconds of it within the limit, and then the firmware hangs.
        since = r"since t = -?\d+\.\d+ s"
        self.assertRegex(result["reason"], rf"the firmware (lets hardly any time pass: \d\.\d+ s, {since}, have cost 1\d\.\d s of processor time \(limit: 10 s for each second\)"
                                           rf"|hangs: for 2 s, {since}, it has neither slept nor sent a byte); it is in {place} \(stm32f4\.c:\d+\)")
        self.assertLess(cost_s, 40)  # of 30 simulated seconds; the limit is 10 s of one
        self.assertIn("PC 0x", (folder / "firmware.log").read_text())

    def test_sleep_with_a_pending_interrupt_that_is_off(self):
        self.costs_too_much([in_flight('__asm volatile("cpsid i"); for (;;) __asm volatile("wfi" ::: "memory");')], "main")

    def test_an_interrupt_that_nobody_clears(self):
        self.costs_too_much([in_flight("USART_CR1(USART2) |= BIT(7);"),
                             ("void USART2_IRQHandler(void) { ", "void USART2_IRQHandler(void) { if (USART_CR1(USART2) & BIT(7)) return; ")], ".*")

    def test_a_tick_of_every_instant(self):
        self.costs_too_much([in_flight("SYST_RVR = 1; SYST_CVR = 0; for (;;) {}")], "SysTick_Handler", "--distributed=socket")

    # --- resets ---

    def test_resets_at_boot(self):
        result, output, folder, cost_s = self.fly([(MAIN, MAIN + "  Reset();\n")])
        self.assertEqual(result["verdict"], "fail", output)
        self.assertRegex(result["reason"], r"the firmware resets again and again: 101 times within 0\.\d+ s, since 0\.000 s after power-on "
                                           r"\(limit: 100 times within 10 s\); the last time it was reset by the firmware itself: in Reset \(stm32f4\.c:\d+\)")
        self.assertLess(cost_s, 10)
        self.assertLess(sum(file.stat().st_size for file in folder.parent.glob("**/*")), 2 << 20)

    def test_resets_at_boot_in_real_time(self):
        result, output, folder, _ = self.fly([(MAIN, MAIN + "  Reset();\n")], "--mode", "realtime", duration_s=1)
        self.assertEqual(result["verdict"], "fail", output)
        self.assertRegex(result["reason"], r"the firmware resets again and again: 101 times within \d+\.\d+ s, since \d\.\d+ s after power-on")
        self.assertLess((folder.parent / "events.jsonl").stat().st_size, 100_000)

    def test_4000_resets_before_the_start(self):
        count = f"  if ({MARK} != 0x55) {{ {MARK} = 0x55; REGISTER(0x2001F004) = 0; }}\n  if (++REGISTER(0x2001F004) < 4000) Reset();\n"
        result, output, _, _ = self.fly([(MAIN, MAIN + count)], duration_s=1)
        self.assertEqual(result["verdict"], "fail", output)
        self.assertIn("the firmware resets again and again: 101 times", result["reason"])

    def test_resets_after_a_crash_in_flight(self):
        crash = in_flight(f"{MARK} = 0x55; (void)REGISTER(0x60000000);")
        once, again = (self.fly([crash, (MAIN, MAIN + f"  if ({MARK} == 0x55) Reset();\n")]) for _ in range(2))
        result, output, _, cost_s = once
        self.assertEqual((result["verdict"], result["end_reason"]), ("fail", "firmware_crashed"), output)
        for words in ("restarted at 0.", "bus fault: precise data access to 0x60000000 (no memory) by main", "then firmware crashed",
                      "the firmware resets again and again: 101 times"):
            self.assertIn(words, result["reason"])
        self.assertLess(cost_s, 10)
        # Virtual time alone decides.
        self.assertEqual(result["reason"], again[0]["reason"])

    def test_a_watchdog_that_bites_now_and_then_is_no_such_loop(self):
        watchdog = (STARTED, STARTED.replace("\n  while", "\n  REGISTER(0x40003000) = 0xCCCC;\n  while"))  # 512 ms
        result, output, _, _ = self.fly([watchdog], duration_s=12)
        self.assertEqual((result["verdict"], result["end_reason"]), ("fail", "completed"), output)
        self.assertGreater(result["restarts"], 20)

    # --- what the board lacks ---

    def test_a_block_that_the_board_lacks_is_named_when_the_flight_fails(self):
        line = (SOURCE / "firmware/examples/minimal_c/stm32f4.c").read_text().split("  while (tick_count == 0)")[0].count("\n")
        use = "  REGISTER(0x40002850) = 7; if (REGISTER(0x40002850) != 7) for (;;) __asm volatile(\"wfi\");"
        result, output, folder, _ = self.fly([("  StartUsartsAndTicks();\n  while", f"  StartUsartsAndTicks();{use}\n  while")], duration_s=1)
        self.assertEqual(result["unmodelled_blocks"], ["RTC"])
        self.assertIn("the firmware uses RTC, which the emulated board does not model", " ".join(output.split()))
        log = (folder / "firmware.log").read_text()
        self.assertRegex(log, rf"0\.00\d+ the firmware uses RTC, which the emulated board does not model: "
                              rf"first written at 0x40002850 \(RTC \+ 0x50\) by main \(stm32f4\.c:{line}\)\n")
        self.assertEqual(log.count("RTC"), 2)  # in one line, with its register
        self.assertEqual(json.loads((folder / "verdict.json").read_text())["unmodelled_blocks"], ["RTC"])

    def test_a_flight_that_passes_names_none_on_the_terminal(self):
        use = "  (void)REGISTER(0x40002850); REGISTER(0x40006400) = 1; (void)REGISTER(0x40006404);"
        for flags in ([], ["--mode", "realtime"]):
            result, output, folder, _ = self.fly([("  StartUsartsAndTicks();\n  while", f"  StartUsartsAndTicks();{use}\n  while")], *flags, duration_s=1)
            self.assertEqual(result["unmodelled_blocks"], ["RTC", "CAN1"], output)
            self.assertRegex((folder / "firmware.log").read_text(),
                             r"CAN1, which the emulated board does not model: first written at 0x40006400 \(CAN1 \+ 0x0\) by \w+ \(")
            self.assertEqual("model" in output, result["verdict"] != "pass")  # in real time, this machine may be too busy

    def test_where_nothing_is(self):
        use = "  REGISTER(0x40008000) = 1;"
        result, output, folder, _ = self.fly([("  StartUsartsAndTicks();\n  while", f"  StartUsartsAndTicks();{use}\n  while")], duration_s=1)
        self.assertEqual((result["verdict"], result["unmodelled_blocks"]), ("fail", ["0x40008000"]), output)
        self.assertIn("bus fault: precise data access to 0x40008000", result["reason"])

    # --- in a campaign ---

    def test_fuzzing_finds_an_input_that_makes_it_reset_for_ever(self):
        # Three flags in a row are what no server sends.
        trigger = ("  const uint8_t byte = (uint8_t)USART_DR(usart);\n", "  const uint8_t byte = (uint8_t)USART_DR(usart);\n"
                   "  static unsigned flags;\n  if (usart == USART2) flags = byte == 0x7E ? flags + 1 : 0;\n"
                   f"  if (flags > 2) {{ {MARK} = 0x55; REGISTER(0xE000ED0C) = 0x05FA0004; }}\n")
        elf = minimal_image.build(SOURCE, self.root / "fuzzed", [trigger, (MAIN, MAIN + f"  if ({MARK} == 0x55) Reset();\n")])
        out = self.root / "fuzz"
        done = subprocess.run([str(TILTPROOF), "fuzz", "--client", f"qemu:{elf}", "--runs", "300", "--seed", "1", "--out", out, "--no-progress"],
                              capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        [finding] = json.loads((out / "fuzz.json").read_text())["findings"]
        self.assertEqual((finding["kind"], finding["confirmed"]), ("crash", True), finding)
        self.assertIn("the firmware resets again and again", finding["reason"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
