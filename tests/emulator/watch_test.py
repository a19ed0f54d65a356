#!/usr/bin/env python3
"""Variables of an emulated firmware as columns of the trace.

Usage: watch_test.py TILTPROOF SOURCE-FOLDER
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

TILTPROOF, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:3])
del sys.argv[1:3]
EXAMPLE = SOURCE / "firmware/examples/minimal_c"

SCENARIO = """\
name: flight
duration_s: 1.001
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
"""
# Into minimal_c's board: one variable of each kind.
PROBE = """
enum Mode { kIdle = 3, kFlying = 7 };
static struct {
  short half[2][3];
  signed char sign;
  double share;
  enum Mode mode;
  bool on;
} volatile probe = {.half = {{1, 2, 3}, {4, 5, -6}}, .sign = -5, .share = 0.25, .mode = kFlying, .on = true};
"""
TICKS = "static volatile uint32_t tick_count;"
VARIABLES = ["tick_count", "rings[1].written", "minimal_firmware.c:tuned", "stm32f4.c:probe.half[1][2]", "probe.sign", "probe.share", "probe.mode", "probe.on"]
CONSTANT = {"minimal_firmware_c_tuned": 1.5, "stm32f4_c_probe_half_1_2": -6, "probe_sign": -5, "probe_share": 0.25, "probe_mode": 7, "probe_on": 1}


class Watch(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls._folder.name)
        # It is used, or it would be left out.
        board = (EXAMPLE / "stm32f4.c").read_text().replace(TICKS, TICKS + PROBE).replace("  StartClockAndPins();", "  probe.sign = -5;\n  StartClockAndPins();")
        (cls.root / "stm32f4.c").write_text(board)
        (cls.root / "minimal_firmware.c").write_text((EXAMPLE / "minimal_firmware.c").read_text() + "\nfloat tuned = 1.5f;\n")
        cls.elf = cls.root / "image.elf"
        subprocess.run(["arm-none-eabi-gcc", "-std=c11", "-O2", "-g", "-ffp-contract=off", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-mthumb",
                        "-I", SOURCE, "--specs=nano.specs", "-nostartfiles", "-T", EXAMPLE / "stm32f4.ld", cls.root / "stm32f4.c",
                        cls.root / "minimal_firmware.c", "-o", cls.elf], check=True)

    @classmethod
    def tearDownClass(cls):
        cls._folder.cleanup()

    def run_tiltproof(self, *flags, client=None, more=""):
        scenario, out = self.root / "watch.yaml", self.root / "out"
        scenario.write_text(SCENARIO + more)
        done = subprocess.run([str(TILTPROOF), "run", str(scenario), "--client", client or f"qemu:{self.elf}", "--out", str(out), "--no-progress", *map(str, flags)],
                              capture_output=True, text=True, timeout=120)
        return done, out / "latest/flight"

    def rows(self, folder):
        with open(folder / "trace.csv", newline="") as file:
            return list(csv.DictReader(file))

    def test_the_state_of_the_shipped_image_is_that_of_the_library(self):
        silence = ('  - {name: says-so, stl: "eventually(supervisor_state >= 1)"}\nfirmware: tolerant\n'
                   "faults: [{id: silence, type: link.silence, target: to_client, start_s: 0.4, end_s: 0.6}]\n")
        states = []
        for client in ("host", "qemu"):
            done, folder = self.run_tiltproof(client=client, more=silence)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            states.append([row["supervisor_state"] for row in self.rows(folder)])
        # The image says its state for the first time when `start` has left, which is just after the first row.
        self.assertEqual(*(column[1:] for column in states))
        # An image without the variable has no such column, and no formula can name it.
        done, folder = self.run_tiltproof()
        self.assertNotIn("supervisor_state", self.rows(folder)[0])
        done, _ = self.run_tiltproof(more=silence)
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"watch.yaml:6:\d+: stl: 'supervisor_state': the image of qemu:.* has no variable tiltproof_status")

    def test_variables_are_columns_and_signals_of_formulas(self):
        formula = '  - {name: ticks, stl: "always(watch_tick_count >= 1 and watch_probe_sign < -4)"}\n'
        traces = []
        for flags in ([], ["--distributed=socket"]):
            done, folder = self.run_tiltproof(*flags, more=formula + f"watch: {json.dumps(VARIABLES)}\n")
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            rows = self.rows(folder)
            traces.append(rows)
            # A tick each millisecond; rows are 12 ms apart, and the last is at 1.001 s, 5 ms after the one before.
            ticks = [float(row["watch_tick_count"]) for row in rows]
            steps = [after - before for before, after in zip(ticks, ticks[1:])]
            self.assertTrue(all(11 <= step <= 13 for step in steps[:-1]), steps)
            self.assertTrue(4 <= steps[-1] <= 6, steps)
            for name, value in CONSTANT.items():
                self.assertEqual({float(row["watch_" + name]) for row in rows}, {value}, name)
            written = [float(row["watch_rings_1_written"]) for row in rows]
            self.assertEqual(written, sorted(written))
            self.assertGreater(written[-1], 1000)
        self.assertEqual(traces[0], traces[1])

    def test_watching_changes_nothing_else(self):
        plain = self.rows(self.run_tiltproof()[1])
        done, folder = self.run_tiltproof("--watch", "tick_count,probe.sign")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        watched = self.rows(folder)
        self.assertEqual({float(row.pop("watch_probe_sign")) for row in watched}, {-5})
        for row in watched:
            row.pop("watch_tick_count")
        self.assertEqual(watched, plain)
        again = subprocess.run([str(TILTPROOF), "replay", str(folder)], capture_output=True, text=True, timeout=120)
        self.assertEqual(again.returncode, 0, again.stdout + again.stderr)

    def refusal(self, name, *flags, client=None):
        done, _ = self.run_tiltproof(*flags, client=client, more=f"watch:\n  - {name}\n")
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertRegex(done.stderr, r"watch\.yaml:7:5: ")
        return done.stderr

    def test_what_cannot_be_watched_is_refused_with_its_place(self):
        self.assertIn("did you mean 'tick_count'?", self.refusal("tick_cuont"))
        self.assertIn("the client host has no image", self.refusal("tick_count", client="host"))
        self.assertIn("only in lockstep", self.refusal("tick_count", "--mode", "realtime"))
        self.assertIn("a structure: name a member, one of bytes, written, read", self.refusal('"rings[0]"'))
        self.assertIn("an array: name an element", self.refusal("rings"))
        self.assertIn("[2]: the array has 2 elements", self.refusal('"rings[2].read"'))
        self.assertIn("there is no member 'writen'; there are bytes, written, read", self.refusal('"rings[0].writen"'))
        stripped = self.root / "stripped.elf"
        subprocess.run(["arm-none-eabi-strip", "-o", stripped, self.elf], check=True)
        self.assertIn("compile it with -g", self.refusal("tick_count", client=f"qemu:{stripped}"))

    def test_the_flag_names_variables_for_every_scenario(self):
        for client, words in ((None, "--watch: .*did you mean 'tick_count'"), ("host", "--watch: 'tick_cuont': the client host has no image")):
            done, _ = self.run_tiltproof("--watch", "tick_cuont", client=client)
            self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
            self.assertRegex(done.stderr, words)

    def test_a_column_has_one_variable(self):
        done, _ = self.run_tiltproof(more="watch: [probe.sign, probe_sign]\n")
        self.assertEqual(done.returncode, 2)
        self.assertIn("watch.yaml:6:21: watch: the column watch_probe_sign of 'probe_sign' is that of 'probe.sign' already", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
