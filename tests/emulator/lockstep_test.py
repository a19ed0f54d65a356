#!/usr/bin/env python3
"""The emulated board in lockstep, as a user flies it: the same flight to the bit, the host's trajectory, device faults at their virtual times, and firmware
that misbehaves in every way known to us.

Usage: lockstep_test.py TILTPROOF FOLDER-OF-IMAGES SOURCE-FOLDER
"""
import csv
import json
import os
import pathlib
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

TILTPROOF, IMAGES, SOURCE = (pathlib.Path(argument) for argument in sys.argv[1:4])
del sys.argv[1:4]

SCENARIO = """\
name: {name}
firmware: {firmware}
duration_s: {duration_s}
expect: {expect}
reference: {{type: {reference}}}
faults: [{faults}]
criteria:
  - {{name: near, stl: "always(position_error_m <= 1)"}}
"""
HOVER = "hover, at_m: [0, 0, 2]"
FLASH, RAM = 0x08000000, 0x20000000


def image(code, reset=FLASH + 65):
    """An ELF file for the board: a vector table, all of whose handlers are `reset`, and Thumb code behind it."""
    content = struct.pack("<16I", RAM + 0x10000, *[reset] * 15) + b"".join(struct.pack("<H", half) for half in code)
    header = struct.pack("<16sHHIIIIIHHHHHH", b"\x7fELF\x01\x01\x01", 2, 40, 1, reset, 52, 0, 0, 52, 32, 1, 40, 0, 0)
    segment = struct.pack("<8I", 1, 84, FLASH, FLASH, len(content), len(content), 5, 4)
    return header + segment + content


# Endless loops. The emulator looks at its count of instructions after each block of code, so that a loop of many instructions costs it much
# less than one of a single instruction.
TIGHT_LOOP = [0xE7FE]  # b .
LONG_LOOP = [0xBF00] * 400 + [0xE000 | -402 & 0x7FF]  # nop, 400 times; b to the first


class Lockstep(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self._folder.name)
        self.runs = 0

    def tearDown(self):
        self._folder.cleanup()

    def scenario(self, name="flight", firmware="paper", duration_s=3, reference=HOVER, faults="", expect="pass"):
        file = self.root / f"{name}.yaml"
        file.write_text(SCENARIO.format(name=name, firmware=firmware, duration_s=duration_s, reference=reference, faults=faults, expect=expect))
        return file

    def run_tiltproof(self, *arguments, environment=None):
        return subprocess.run([str(TILTPROOF), *map(str, arguments)], capture_output=True, text=True, timeout=120, env=environment)

    def fly(self, *arguments, code=0):
        self.runs += 1
        out = self.root / f"out{self.runs}"
        done = self.run_tiltproof("run", *arguments, "--out", out, "--no-progress")
        self.assertIn(done.returncode, code if isinstance(code, tuple) else (code,), done.stdout + done.stderr)
        results = json.loads((out / "latest/results.json").read_text())
        return out / "latest", results["scenarios"]

    def events(self, folder, kind, name=None):
        """`name`: of the flight, where the run has several."""
        lines = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
        return [(line["time_s"], line["text"]) for line in lines if line["kind"] == kind and name in (None, line["scenario"])]

    def rows(self, folder, name="flight"):
        with open(folder / name / "trace.csv", newline="") as file:
            return list(csv.DictReader(file))

    def write_image(self, name, code, **options):
        file = self.root / name
        file.write_bytes(image(code, **options))
        return f"qemu:{file}"

    # --- the same flight ---

    def test_flights_are_equal_to_the_bit_alone_in_parallel_and_distributed(self):
        # Noise on the line, a reset and a flipped bit: all of it at its time, every time.
        faults = ("{id: noise, type: wire.bit_error, target: both, parameters: {ber: 0.0005}}, "
                  "{id: reset, type: device.reset, start_s: 1.5, parameters: {boot_ms: 30}}, "
                  "{id: flip, type: device.bit_flip, start_s: 0.5, end_s: 2.5, parameters: {region: ram, bit_count: 3}}")
        a, b = (self.scenario(name, "tolerant", faults=faults) for name in ("a", "b"))
        hashes = set()
        for scenarios, flags in (([a], []), ([a, b], ["-j", "2"]), ([b], ["--distributed=socket"])):
            # A seed that flips bits of which this image needs none.
            _, results = self.fly(*scenarios, "--client", "qemu", "--seed", "2", *flags)
            self.assertEqual(len(results), len(scenarios))
            hashes |= {result["trace_hash"] for result in results}
            for result in results:
                self.assertEqual([fault["activations"] for fault in result["faults"]][1:], [1, 3])
        self.assertEqual(len(hashes), 1, hashes)

    def test_flight_is_the_same_on_a_loaded_machine_and_can_be_replayed(self):
        file = self.scenario(duration_s=1)
        folder, [quiet] = self.fly(file, "--client", "qemu")
        load = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(3)]
        try:
            _, [loaded] = self.fly(file, "--client", "qemu")
            replayed = self.run_tiltproof("replay", folder)
        finally:
            for process in load:
                process.kill()
                process.wait()
        self.assertEqual(quiet["trace_hash"], loaded["trace_hash"])
        self.assertEqual((replayed.returncode, "1 of 1 equal" in replayed.stdout), (0, True), replayed.stdout)

    def test_spiral_is_within_a_millimetre_of_the_hosts(self):
        # Its first 20 s. equality_test.py compares longer flights with faults, to the bit.
        shipped = (SOURCE / "scenarios/paper/spiral-velocity.yaml").read_text()
        self.assertIn("duration_s: 60\n", shipped)
        spiral = self.root / "spiral-velocity.yaml"
        spiral.write_text(shipped.replace("duration_s: 60\n", "duration_s: 20\n").replace("always[10,60]", "always[10,20]"))
        host, _ = self.fly(spiral)
        emulated, _ = self.fly(spiral, "--client", "qemu")
        compared = self.run_tiltproof("compare", host, emulated, "--tolerance", "0.001")
        self.assertEqual(compared.returncode, 0, compared.stdout)
        rows = list(zip(self.rows(host, "paper-spiral-velocity"), self.rows(emulated, "paper-spiral-velocity")))
        self.assertEqual(len(rows), 1668)
        for column in ("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"):
            self.assertLessEqual(max(abs(float(a[column]) - float(b[column])) for a, b in rows), 1e-3, column)

    def test_an_independent_image_flies(self):
        folder, [result] = self.fly(self.scenario(duration_s=2), "--client", f"qemu:{IMAGES / 'minimal_c.elf'}")
        self.assertEqual(result["verdict"], "pass")
        # It has no `tiltproof_status`: what it cannot say is absent.
        self.assertNotIn("firmware.failsafe_entered_count", result["metrics"])
        self.assertEqual(result["metrics"]["firmware.receive_overruns_count"], 0)

    def test_an_ideal_line_loses_no_byte(self):
        file = self.scenario()
        file.write_text(file.read_text() + "link: {ideal: true}\n")
        _, [result] = self.fly(file, "--client", "qemu")
        self.assertEqual((result["verdict"], result["metrics"]["firmware.receive_overruns_count"]), ("pass", 0))

    # --- device faults ---

    def test_more_bytes_at_once_than_one_message_to_the_emulator_holds(self):
        # One reply becomes 130 000 bytes, which an ideal line delivers at one instant. Its watchdog resets the firmware that reads them all.
        faults = ", ".join(f"{{id: d{i}, type: wire.byte_duplicate, target: to_client, start_s: 0.5, end_s: 0.512, parameters: {{probability: 1}}}}"
                           for i in range(11))
        file = self.scenario(firmware="tolerant", faults=faults, duration_s=1, expect="fail")
        file.write_text(file.read_text() + "link: {ideal: true}\n")
        _, [flight] = self.fly(file, "--client", "qemu")
        self.assertEqual([fault["activations"] for fault in flight["faults"]], [1] * 11)

    def test_reset_comes_at_its_time_and_lasts_its_boot(self):
        file = self.scenario(faults="{id: r, type: device.reset, start_s: 1.0001, parameters: {boot_ms: 20}}")
        folder, [result] = self.fly(file, "--client", "qemu")
        self.assertEqual(self.events(folder, "device_reset"), [(1.0001, "reset by pin")])
        [(runs_s, _)] = self.events(folder, "device_runs")
        self.assertAlmostEqual(runs_s, 1.0201, delta=1e-6)
        self.assertEqual(result["metrics"]["firmware.restarts_count"], 1)

    def test_a_hang_is_ended_by_the_firmwares_watchdog(self):
        file = self.scenario(faults="{id: h, type: device.hang, start_s: 1}")
        folder, [result] = self.fly(file, "--client", "qemu")
        [(reset_s, text)] = self.events(folder, "device_reset")
        self.assertRegex(text, r"^reset by watchdog: in \w+ \(\w+\.(cpp|h):\d+\)$")
        # Some 100 ms after it was last fed: at most one period before the hang.
        self.assertTrue(1.05 < reset_s < 1.15, reset_s)
        self.assertIn("watchdog", (folder / "flight/firmware.log").read_text())
        self.assertEqual(result["metrics"]["firmware.restarts_count"], 1)

    def test_a_stalled_processor_overruns(self):
        # Within a reference, 32 bytes or more from the grid point 1.2 s on.
        file = self.scenario(faults="{id: s, type: device.stall, start_s: 1.2001, end_s: 1.2009}")
        folder, [result] = self.fly(file, "--client", "qemu")
        lost = self.events(folder, "uart_overrun")
        self.assertTrue(lost, "no overrun")
        self.assertTrue(all(1.2 < at < 1.201 for at, _ in lost), lost)
        self.assertGreater(result["metrics"]["firmware.receive_overruns_count"], 10)

    def test_a_stall_comes_back_in_every_period(self):
        # More often than any list of faults would say it.
        file = self.scenario(duration_s=4, faults="{id: s, type: device.stall, start_s: 1, end_s: 3.5, period_s: 0.002, duty: 0.1}")
        folder, [result] = self.fly(file, "--client", "qemu")
        self.assertEqual(result["faults"][0]["activations"], 1250)
        for kind, phase_s in (("device_stopped", 0), ("device_runs", 0.0002)):
            times = [at for at, _ in self.events(folder, kind)][:1250]
            self.assertGreater(len(times), 900, kind)
            for i, at in enumerate(times):
                self.assertAlmostEqual(at, 1 + 0.002 * i + phase_s, delta=1e-7)

    def requests(self, folder):
        """When the client began to send each of its requests, after t = 0: link.bin as docs/wire.md describes it."""
        content, at, begins = (folder / "flight/link.bin").read_bytes(), 8, []
        while at < len(content):
            begin_ns, _, direction, side, size = struct.unpack_from("<qBBBH", content, at)
            at += 13 + size
            if (direction, side) == (0, 0) and size == self.REQUEST_BYTES and begin_ns > 0:
                begins.append(begin_ns * 1e-9)
        return begins

    REQUEST_BYTES = 8

    def test_other_work_delays_the_task_and_no_interrupt(self):
        window = "start_s: 1, end_s: 2"
        folder, _ = self.fly(self.scenario(), "--client", "qemu")
        due = self.requests(folder)
        work = self.scenario(faults=f"{{id: w, type: device.task_delay, {window}, parameters: {{delay_ms: 4, every_ms: 100}}}}")
        folder, [result] = self.fly(work, "--client", "qemu")
        sent = self.requests(folder)
        self.assertEqual(result["faults"][0]["activations"], 10)
        self.assertEqual([round(at, 6) for at, _ in self.events(folder, "task_delayed")], [round(1 + i / 10, 6) for i in range(10)])
        self.assertEqual(len(sent), len(due))
        late = 0
        for a, b in zip(due, sent):
            since = (a - 1) % 0.1
            held = 1 <= a < 2 and since < 0.004
            late += held
            self.assertAlmostEqual(b, a - since + 0.004 if held else a, delta=5e-5)
        self.assertGreater(late, 2)
        # Its receivers are served. A processor that stands still at the same times loses bytes.
        self.assertEqual(result["metrics"]["firmware.receive_overruns_count"], 0)
        stall = self.scenario(faults=f"{{id: s, type: device.stall, {window}, period_s: 0.1, duty: 0.04}}")
        _, [result] = self.fly(stall, "--client", "qemu")
        self.assertGreater(result["metrics"]["firmware.receive_overruns_count"], 0)

    def test_other_work_without_end_ends_by_the_watchdog_that_the_task_feeds(self):
        file = self.scenario(faults="{id: w, type: device.task_delay, start_s: 1, end_s: 1.5, parameters: {delay_ms: 10, every_ms: 10}}", expect="fail")
        folder, _ = self.fly(file, "--client", "qemu")
        self.assertEqual(len(self.events(folder, "task_delayed")), 50)
        resets = self.events(folder, "device_reset")
        self.assertTrue(resets and "watchdog" in resets[0][1], resets)
        self.assertTrue(1.05 < resets[0][0] < 1.15, resets)

    def test_a_flight_with_other_work_is_the_same_in_one_process_and_in_several(self):
        file = self.scenario(faults="{id: w, type: device.task_delay, start_s: 0.5, parameters: {delay_ms: 3, every_ms: 17}}", duration_s=2)
        hashes = {self.fly(file, "--client", "qemu", *flags)[1][0]["trace_hash"] for flags in ([], [], ["--distributed=socket"])}
        self.assertEqual(len(hashes), 1, hashes)

    def test_a_fast_crystal_shortens_the_period(self):
        file = self.scenario(duration_s=4, faults="{id: d, type: clock.drift, start_s: 0, parameters: {ppm: 5000}}")
        _, [result] = self.fly(file, "--client", "qemu")
        _, [exact] = self.fly(self.scenario(duration_s=4), "--client", "qemu")
        ratio = exact["metrics"]["timing.request_period_mean_ms"] / result["metrics"]["timing.request_period_mean_ms"]
        self.assertAlmostEqual(ratio, 1.005, delta=2e-5)

    def test_errors_at_the_receiver_are_seen_by_the_firmware(self):
        window = "start_s: 1, end_s: 2, parameters: {probability: 0.002}"
        files = [self.scenario(fault, "tolerant", faults=f"{{id: e, type: uart.{fault}, {window}}}") for fault in ("framing_error", "noise_error", "overrun")]
        _, results = self.fly(*files, "--client", "qemu")
        self.assertEqual(len(results), 3)
        for result in results:
            self.assertGreater(result["faults"][0]["activations"], 0, result["name"])
            self.assertEqual(result["verdict"], "pass", result["name"])

    def test_flipped_bits_are_where_the_region_is(self):
        file = self.scenario(faults="{id: f, type: device.bit_flip, start_s: 1, parameters: {region: stack, bit_count: 8}}", expect="fail")
        # The flips may be fatal: that is the firmware's business, not this test's.
        folder, _ = self.fly(file, "--client", "qemu", code=(0, 1))
        flips = self.events(folder, "bit_flipped")
        self.assertEqual(len(flips), 8)
        for at, text in flips:
            self.assertEqual(at, 1.0)
            before, after = (int(value, 16) for value in text.split(": ")[1].split(" -> "))
            self.assertEqual(bin(before ^ after).count("1"), 1)

    def test_what_cannot_be_raised_is_refused_with_its_place(self):
        for fault, client in (("clock.jump, parameters: {jump_ms: 5}", "qemu"), ("uart.framing_error", "host"), ("device.stall", "host")):
            window = "start_s: 1, end_s: 2" + (", parameters: {probability: 0.1}" if fault.startswith("uart") else "")
            file = self.scenario(faults=f"{{id: x, type: {fault}, {window}}}")
            done = self.run_tiltproof("run", file, "--client", client, "--out", self.root / "out")
            self.assertEqual(done.returncode, 2, fault)
            self.assertIn(f"{file}:6:", done.stderr)
        for parameters, words in (("region: flight_aplication", "flight_application"), ("region: flight_application, bit_count: 64", ""),
                                  ("region: tiltproof_status, bit_count: 64", ""), ("region: no_such_thing", "no memory region")):
            file = self.scenario(faults=f"{{id: f, type: device.bit_flip, start_s: 1, parameters: {{{parameters}}}}}")
            done = self.run_tiltproof("run", file, "--client", "qemu", "--out", self.root / "out", "--dry-run")
            self.assertEqual(done.returncode, 2 if words else 0, done.stderr)
            if words:
                self.assertIn(f"{file}:6:", done.stderr)
                self.assertIn(words, done.stderr)
        drift = "{{id: {}, type: clock.drift, start_s: {}, end_s: 3, parameters: {{ppm: 100}}}}"
        file = self.scenario(faults=", ".join(drift.format(name, start) for name, start in (("a", 1), ("b", 2))))
        self.assertEqual(self.run_tiltproof("run", file, "--client", "qemu", "--dry-run").returncode, 2)

    def test_faults_may_meet(self):
        hang, reset, stall = "{{id: h, type: device.hang, start_s: {}}}", "{{id: r, type: device.reset, start_s: {}, parameters: {{boot_ms: 20}}}}", "{{id: s, type: device.stall, start_s: {}, end_s: {}}}"
        # Times in s: the resets that are due, and the processor running again. The watchdog resets after some 100 ms.
        cases = (([hang.format(1), reset.format(1.05)], [1.05], 1.07),
                 ([hang.format(1), stall.format(1.02, 1.04)], [1.1], 1.1),
                 ([stall.format(1, 1.05), reset.format(1.02)], [1.02], 1.05),
                 ([reset.format(1), reset.format(1.01).replace("id: r", "id: r2")], [1, 1.01], 1.03),
                 ([stall.format(1, 1.02), stall.format(1.02, 1.04).replace("id: s", "id: s2")], [], 1.04))
        files = [self.scenario(f"meeting-{i}", faults=", ".join(faults)) for i, (faults, _, _) in enumerate(cases)]
        folder, results = self.fly(*files, "--client", "qemu")
        flown = {result["name"]: result for result in results}
        for file, (faults, resets, runs) in zip(files, cases):
            result = flown[file.stem]
            found = self.events(folder, "device_reset", file.stem)
            self.assertEqual(len(found), len(resets), (faults, found))
            for (at, text), due in zip(found, resets):
                self.assertAlmostEqual(at, due, delta=0.03 if "watchdog" in text else 1e-7)
            ends = self.events(folder, "device_runs", file.stem)
            self.assertEqual(len(ends), 1, (faults, ends))
            self.assertAlmostEqual(ends[0][0], runs, delta=0.03 if hang.format(1) in faults else 1e-6)
            self.assertEqual(result["verdict"], "pass")

    def test_a_sleeping_processor_sleeps_on_after_a_stall(self):
        # Shorter than a tick, between two of them.
        stalls = ", ".join(f"{{id: s{i}, type: device.stall, start_s: {1 + i / 4}032, end_s: {1 + i / 4}033}}" for i in range(4))
        _, [result] = self.fly(self.scenario(faults=stalls), "--client", "qemu")
        self.assertAlmostEqual(result["metrics"]["timing.request_period_max_ms"], 12, delta=0.001)

    def test_a_firmware_that_resets_itself_does_so_at_the_same_time_on_any_machine(self):
        # Its data scrambled, it runs into its fault handler, which resets: with this seed, at 1.008 s.
        file = self.scenario(faults="{id: f, type: device.bit_flip, start_s: 1, parameters: {region: data, bit_count: 64}}", duration_s=1.5)

        def flights():
            self.runs += 1
            out = self.root / f"out{self.runs}"
            self.run_tiltproof("run", file, "--client", "qemu", "--seed", 4, "--out", out, "--no-progress")
            results = json.loads((out / "latest/results.json").read_text())["scenarios"]
            return [result["trace_hash"] for result in results], self.events(out / "latest", "device_reset")

        quiet = flights()
        self.assertTrue(any("firmware itself" in text for _, text in quiet[1]), quiet)
        load = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(3)]
        try:
            for _ in range(2):
                self.assertEqual(flights(), quiet)
        finally:
            for process in load:
                process.kill()
                process.wait()

    # --- firmware that misbehaves ---

    def test_a_firmware_that_locks_up_is_a_crash_with_its_registers(self):
        client = self.write_image("lockup.elf", [0xDEFF])  # udf, also in the handler of every fault
        folder, [result] = self.fly(self.scenario(), "--client", client, code=1)
        self.assertEqual(result["verdict"], "fail")
        self.assertIn("the processor locked up", json.dumps(result))
        self.assertRegex((folder / "flight/firmware.log").read_text(), r"R00=[0-9a-f]{8}")

    def test_a_firmware_in_an_endless_loop_is_hung_within_seconds(self):
        client = self.write_image("loop.elf", LONG_LOOP)
        began = time.monotonic()
        folder, [result] = self.fly(self.scenario(duration_s=3600), "--client", client, code=1)
        self.assertLess(time.monotonic() - began, 60)
        self.assertIn("the firmware hangs: for 10 s", json.dumps(result))
        self.assertRegex((folder / "flight/firmware.log").read_text(), r"R15=08000[0-3][0-9a-f]{2}")

    def test_a_firmware_may_be_busy_before_its_start(self):
        client = self.write_image("loop.elf", TIGHT_LOOP)
        file = self.scenario(duration_s=3600)
        file.write_text(file.read_text() + "start_within_s: 3\n")
        folder, [result] = self.fly(file, "--client", client, code=1)
        self.assertIn("the firmware hangs: for 3 s", json.dumps(result))
        self.assertRegex((folder / "flight/firmware.log").read_text(), r"R15=08000040")

    def test_a_firmware_that_sleeps_for_ever_never_starts(self):
        client = self.write_image("sleep.elf", [0xBF30, 0xE7FD])  # wfi; b .-2
        _, [result] = self.fly(self.scenario(), "--client", client, code=1)
        self.assertIn("accepted no `start`", json.dumps(result))

    def test_files_that_are_no_image(self):
        for name, content in (("none.elf", None), ("text.elf", b"hello"), ("host.elf", pathlib.Path(sys.executable).read_bytes()[:4096])):
            file = self.root / name
            if content is not None:
                file.write_bytes(content)
            done = self.run_tiltproof("run", self.scenario(), "--client", f"qemu:{file}", "--out", self.root / "out")
            self.assertIn(done.returncode, (2, 3), done.stdout + done.stderr)
            self.assertIn(name, done.stdout + done.stderr)
        for client in ("qemu:", "qemu:x.elf,main=usart9", "qemu:x.elf,main=usart3", "qemu:x.elf,speed=1"):
            done = self.run_tiltproof("run", self.scenario(), "--client", client, "--out", self.root / "out")
            self.assertEqual(done.returncode, 2, client)
            self.assertIn("--client", done.stderr)

    # --- the emulator itself ---

    def start(self, *arguments, duration_s=3600):
        run = subprocess.Popen([str(TILTPROOF), "run", str(self.scenario(duration_s=duration_s)), "--client", "qemu", "--out", str(self.root / "out"),
                                "--no-progress", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        end = time.monotonic() + 60
        while time.monotonic() < end:
            # The self-test's emulators fly no image of ours.
            emulators = [pid for pid in self.descendants(run.pid) if b"executive-paper" in self.command_line(pid)]
            if emulators:
                return run, emulators[0]
            time.sleep(0.05)
        self.fail("the emulator did not start")

    def command_line(self, pid):
        try:
            line = pathlib.Path(f"/proc/{pid}/cmdline").read_bytes()
            return line if line.startswith(b"qemu-system-arm") else b""
        except OSError:
            return b""

    def descendants(self, pid):
        found = []
        for task in pathlib.Path(f"/proc/{pid}/task").glob("*/children"):
            try:
                for child in task.read_text().split():
                    found += [int(child), *self.descendants(int(child))]
            except OSError:
                pass
        return found

    def test_an_emulator_that_is_killed_is_trouble_of_the_harness(self):
        run, emulator = self.start()
        os.kill(emulator, signal.SIGKILL)
        output, _ = run.communicate(timeout=60)
        self.assertEqual(run.returncode, 3, output)
        self.assertIn("killed by signal 9", output)

    def test_a_flight_waits_for_an_emulator_that_is_stopped_and_says_so(self):
        run, emulator = self.start(duration_s=15)
        os.kill(emulator, signal.SIGSTOP)
        self.assertIn(f"process {emulator} is stopped", run.stderr.readline())
        os.kill(emulator, signal.SIGCONT)
        output, errors = run.communicate(timeout=60)
        self.assertEqual((run.returncode, errors), (0, ""), output)

    def test_nothing_is_left_behind(self):
        for end in (signal.SIGINT, signal.SIGKILL):
            run, emulator = self.start()
            run.send_signal(end)
            run.communicate(timeout=60)
            limit = time.monotonic() + 10
            while self.command_line(emulator) and time.monotonic() < limit:
                time.sleep(0.05)
            self.assertFalse(self.command_line(emulator), f"after {end.name}")

    def test_another_release_of_the_emulator_is_refused_with_the_way_out(self):
        fake = self.root / "bin/qemu-system-arm"
        fake.parent.mkdir()
        for script, words in (("echo QEMU emulator version 8.2.0", ["8.2.0", "7.2", "--client host"]), ("exit 0", ["names no version"])):
            fake.write_text(f"#!/bin/sh\n{script}\n")
            fake.chmod(0o755)
            done = self.run_tiltproof("run", self.scenario(), "--client", "qemu", "--out", self.root / "out",
                                      environment={**os.environ, "PATH": f"{fake.parent}:{os.environ['PATH']}"})
            self.assertEqual(done.returncode, 3, done.stderr)
            for word in words:
                self.assertIn(word, done.stderr)
        done = self.run_tiltproof("run", self.scenario(), "--client", "qemu", "--out", self.root / "out", environment={"PATH": "/nowhere"})
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("qemu-system-arm", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
