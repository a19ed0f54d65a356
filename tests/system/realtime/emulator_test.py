#!/usr/bin/env python3
"""Firmware images on an emulated board in real time: flights, faults on the device, and everything that may be wrong.
Usage: emulator_test.py TILTPROOF IMAGES_FOLDER"""
import os
import pathlib
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest

from flight import Flight, become_subreaper, read, wait_until, write_hover

PROGRAM, IMAGES = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(2))
IMAGE = IMAGES / "executive-tolerant.elf"
NOT_RUN = 77

# A flight that the machine itself disturbed says nothing: it is flown again.
ATTEMPTS_COUNT = 3

ENDLESS_LOOP, UNDEFINED = b"\xfe\xe7", b"\xff\xde"  # b .; udf
FAULTS = """\
name: faults
duration_s: 5
firmware: tolerant
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: reset, type: device.reset, start_s: 1, parameters: {boot_ms: 10}}
  - {id: stall, type: device.stall, start_s: 2.5, end_s: 2.53}
  - {id: flip, type: device.bit_flip, start_s: 4, parameters: {region: tiltproof_run_statistics, bit_count: 2}}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
"""

# A program that resets the board, as a debug probe's command does.
RESET = """\
import json, socket, sys
with socket.socket(socket.AF_UNIX) as control:
    control.settimeout(10)
    control.connect(sys.argv[1])
    lines = control.makefile("rw")
    lines.readline()
    for command in ("qmp_capabilities", "system_reset"):
        print(json.dumps({"execute": command}), file=lines, flush=True)
    while json.loads(lines.readline()).get("event") != "RESET":
        pass
"""


def write_image(path, loop):
    """An executable of a vector table and an instruction. Faults have no handlers: they lock the processor up."""
    flash, reset = 0x08000000, 0x08000041
    vectors = struct.pack("<16I", 0x20020000, reset, *[0] * 14)
    header = b"\x7fELF\x01\x01\x01" + bytes(9) + struct.pack("<HHIIIIIHHHHHH", 2, 40, 1, reset, 52, 0, 0x05000000, 52, 32, 1, 40, 0, 0)
    segment = struct.pack("<8I", 1, 84, flash, flash, len(vectors + loop), len(vectors + loop), 5, 4)
    path.write_bytes(header + segment + vectors + loop)
    return path


class EmulatorTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-emulator-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.attempt = 0

    def start(self, client, scenario=None, duration_s=3, *flags, **options):
        self.attempt += 1
        folder = self.folder / str(self.attempt)
        folder.mkdir()
        path = write_hover(folder, duration_s=duration_s)
        if scenario:
            path.write_text(scenario)
        flight = Flight(PROGRAM, folder, path, "--client", client, *flags, **options)
        self.addCleanup(flight.end)
        return flight

    def fly(self, client, scenario=None, **options):
        """To its end; again while the machine was too busy to judge."""
        for _ in range(ATTEMPTS_COUNT):
            flight = self.start(client, scenario, **options)
            code = flight.wait(40)
            if code != 4:
                break
        if code == 4:
            self.assertIn("too busy to judge", flight.text())
            print(f"{self.id().split('.')[-1]}: this machine was too busy, {ATTEMPTS_COUNT} times over", file=sys.stderr, flush=True)
        return flight, code

    def check(self, flight):
        flight.check_results(self)
        flight.check_nothing_left(self)

    def emulators(self, flight):
        return [pid for pid, command in flight.processes().items() if "qemu-system-arm" in command[0] and "-kernel" in command]

    def emulator(self, flight):
        """Once it is there: the plant may have its port before the board has its emulator."""
        def there():
            self.assertIsNone(flight.process.poll(), flight.text())
            return self.emulators(flight)
        return wait_until(there, 20, lambda: f"no emulator: {flight.text()}")[0]

    def log(self, flight):
        return read(next(flight.run_folder.glob("*/firmware.log"))).decode()

    def trouble(self, flight, verdict, reason):
        self.assertEqual(flight.wait(30), {"error": 3, "fail": 1}[verdict], flight.text())
        self.assertEqual(flight.result()["verdict"], verdict, flight.text())
        self.assertRegex(flight.result()["reason"], reason)
        self.check(flight)

    # flights

    def test_hover(self):
        flight, code = self.fly("qemu")
        self.assertRegex(self.log(flight), r"(?m)^-?0\.\d+ +0\.\d+ tiltproof executive, firmware paper, dialect paper$")
        self.check(flight)
        if code == 4:
            return
        self.assertEqual(code, 0, flight.text())
        metrics = flight.result()["metrics"]
        # The board's own clock makes the period, where this machine took no tick from it.
        period, = (one["explanation"] for one in flight.result()["criteria"] if one["name"] == "control_period")
        self.assertAlmostEqual(float(re.match(r"asks every ([0-9.]+) ms", period)[1]), 12.0, delta=0.12)
        self.assertEqual(metrics["link.reference.frames_rejected_count"], 0)
        # Read from the board's memory.
        self.assertEqual(metrics["firmware.failsafe_entered_count"], 0)
        self.assertEqual(set(flight.column("hover", "supervisor_state")) - {"nan", ""}, {"0"})
        print(f"hover: {flight.events('client_round_trip')[0]['text']}", file=sys.stderr, flush=True)

    def test_image_of_the_users_and_other_usarts(self):
        # The same firmware's console in place of its main line: it never says anything that is a message.
        flight = self.start(f"qemu:{IMAGE},main=usart1,console=usart2", duration_s=1)
        self.assertEqual(flight.wait(30), 1, flight.text())
        self.assertIn("never started", flight.result()["reason"])
        self.check(flight)

    def test_faults_on_the_device(self):
        flight, code = self.fly("qemu", FAULTS)
        self.check(flight)
        if code == 4:
            return
        self.assertEqual(code, 0, flight.text())
        result = flight.result()
        self.assertEqual({fault["id"]: fault["activations"] for fault in result["faults"]}, {"reset": 1, "stall": 1, "flip": 2})
        self.assertEqual(result["metrics"]["firmware.restarts_count"], 1)
        self.assertEqual(len(re.findall("tiltproof executive", self.log(flight))), 2)
        times = {kind: [event["time_s"] for event in flight.events(kind)]
                 for kind in ("device_reset", "device_stopped", "device_runs", "bit_flipped")}
        for kind, expected in (("device_reset", [1]), ("device_stopped", [2.5]), ("device_runs", [2.53]), ("bit_flipped", [4, 4])):
            self.assertEqual(len(times[kind]), len(expected), flight.events())
            for time_s, expected_s in zip(times[kind], expected):
                self.assertAlmostEqual(time_s, expected_s, delta=0.1)
        for event in flight.events("bit_flipped"):
            before, after = (int(word, 16) for word in re.findall("0x..(?= |$)", event["text"]))
            self.assertEqual((before ^ after).bit_count(), 1, event)

    def test_two_at_once(self):
        one, other = (self.start("qemu", duration_s=2) for _ in range(2))
        for flight in (one, other):
            self.assertIn(flight.wait(40), (0, 4), flight.text())
        for flight in (one, other):
            self.check(flight)

    def test_emulator_of_the_users_behind_sockets(self):
        for _ in range(ATTEMPTS_COUNT):
            sockets = [self.folder / name for name in ("main", "reference")]
            for path in sockets:
                path.unlink(missing_ok=True)
            with open(self.folder / "console", "wb") as console:
                # The image starts when both are taken.
                emulator = subprocess.Popen(
                    ["qemu-system-arm", "-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-nodefaults",
                     "-serial", "stdio", "-chardev", f"socket,id=main,path={sockets[0]},server=on,wait=off", "-serial", "chardev:main",
                     "-chardev", f"socket,id=reference,path={sockets[1]},server=on,wait=on", "-serial", "chardev:reference",
                     "-plugin", f"{PROGRAM.parent / 'lib/tiltproof_lockstep.so'},realtime=on",
                     "-kernel", IMAGES / "executive-paper.elf"], stdin=subprocess.DEVNULL, stdout=console, stderr=console)
            self.addCleanup(emulator.wait)
            self.addCleanup(emulator.kill)
            wait_until(lambda: all(path.exists() for path in sockets), 10, "QEMU made no sockets")
            flight = self.start("serial:" + ",".join(f"unix:{path}" for path in sockets))
            code = flight.wait(40)
            self.check(flight)
            emulator.kill()
            if code != 4:
                break
        self.assertIn(b"first valid reply", read(self.folder / "console"))
        if code == 4:
            self.assertIn("too busy to judge", flight.text())
        else:
            self.assertEqual(code, 0, flight.text())
            self.assertGreater(flight.result()["metrics"]["link.reference.frames_sent_count"], 200)

    def test_emulator_as_a_board_that_is_reset_before_each_flight(self):
        # It runs already when the first flight begins, as a board does.
        names = ("main", "reference", "qmp")
        main, reference, control = (self.folder / name for name in names)
        (self.folder / "reset.py").write_text(RESET)
        with open(self.folder / "console", "wb") as console:
            emulator = subprocess.Popen(
                ["qemu-system-arm", "-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-nodefaults", "-serial", "stdio",
                 *(word for path in (main, reference) for word in ("-chardev", f"socket,id={path.name},path={path},server=on,wait=off",
                                                                   "-serial", f"chardev:{path.name}")),
                 "-qmp", f"unix:{control},server=on,wait=off", "-plugin", f"{PROGRAM.parent / 'lib/tiltproof_lockstep.so'},realtime=on",
                 "-kernel", IMAGES / "executive-paper.elf"], stdin=subprocess.DEVNULL, stdout=console, stderr=console)
        self.addCleanup(emulator.wait)
        self.addCleanup(emulator.kill)
        wait_until(lambda: b"tiltproof executive" in read(self.folder / "console"), 20, "the board does not boot")
        for attempt in range(1, ATTEMPTS_COUNT + 1):
            began = len(read(self.folder / "console"))
            flight = self.start(f"serial:unix:{main},unix:{reference},reset={sys.executable} {self.folder / 'reset.py'} {control}", None, 2, "--repeat", "2")
            code = flight.wait(60)
            self.check(flight)
            console = read(self.folder / "console")
            self.assertEqual(console.count(b"restarted by the reset button"), 2 * attempt)
            # A firmware feeds its watchdog eight times before it bites: then the emulator had no processor, which a harness cannot see
            # when the host of a virtual machine took it.
            bitten = b"restarted by the watchdog" in console[began:]
            if code != 4 and not (code == 1 and bitten):
                break
        self.assertNotIn("switch it on", flight.text())
        if code == 4:
            self.assertIn("too busy to judge", flight.text())
        elif not bitten:
            self.assertEqual(code, 0, f"{flight.text()}{console.decode(errors='replace')}")
            self.assertEqual([result["verdict"] for result in flight.run_results()], ["pass", "pass"])

    def processors(self, pid):
        return {read(f"/proc/{pid}/task/{task}/status").split(b"Cpus_allowed_list:\t")[1].split(b"\n")[0].decode()
                for task in os.listdir(f"/proc/{pid}/task")}

    def test_emulator_keeps_to_one_processor_while_its_firmware_sleeps(self):
        if len(os.sched_getaffinity(0)) < 2:
            self.skipTest("this machine has but one")
        flight = self.start("qemu", duration_s=10)
        flight.wait_flying()
        emulator = self.emulator(flight)
        wait_until(lambda: len(one := self.processors(emulator)) == 1 and one.pop().isdigit(), 5, lambda: self.processors(emulator))
        flight.end()
        # One that never sleeps would have its devices wait.
        flight = self.start(f"qemu:{write_image(self.folder / 'busy.elf', ENDLESS_LOOP)}", duration_s=10)
        flight.wait_flying()
        emulator = self.emulator(flight)
        wait_until(lambda: not any(one.isdigit() for one in self.processors(emulator)), 8, lambda: self.processors(emulator))

    # what may go wrong

    def test_emulator_that_is_killed(self):
        flight = self.start("qemu", duration_s=10)
        emulator = self.emulator(flight)
        flight.wait_flying()
        os.kill(emulator, signal.SIGKILL)
        # Nothing that the firmware has done.
        self.trouble(flight, "error", r"the emulator killed by signal 9 \(Killed\)")

    def test_standstill_of_the_emulator_blames_no_firmware(self):
        # Longer than the firmware's watchdog waits (100 ms), and than a vehicle flies without it.
        flight = self.start("qemu", duration_s=4)
        emulator = self.emulator(flight)
        flight.wait_flying()
        self.assertIsNotNone(flight.wait_fly_for(1.0), flight.text())
        os.kill(emulator, signal.SIGSTOP)
        time.sleep(0.6)
        os.kill(emulator, signal.SIGCONT)
        self.assertEqual(flight.wait(40), 4, flight.text())
        self.assertEqual(flight.result()["verdict"], "inconclusive")
        self.assertIn("too busy to judge", flight.text())
        self.check(flight)

    def test_emulator_goes_with_its_node_and_its_run(self):
        flight = self.start("qemu", duration_s=10)
        self.emulator(flight)
        os.kill(flight.wait_flying()["client"], signal.SIGKILL)
        self.assertEqual(flight.wait(20), 1, flight.text())
        self.check(flight)
        flight = self.start("qemu", duration_s=10)
        self.emulator(flight)
        flight.wait_flying()
        flight.process.kill()
        flight.wait(5)
        flight.check_nothing_left(self)

    def test_firmware_that_locks_up(self):
        flight = self.start(f"qemu:{write_image(self.folder / 'lockup.elf', UNDEFINED)}")
        self.trouble(flight, "fail", r"the firmware crashed at [0-9.]+ s after power-on: the processor locked up at 0x[0-9a-f]{8}.*: usage fault: undefined instruction")
        self.assertRegex(self.log(flight), r"R00=[0-9a-f]{8} R01=")
        self.assertIn("Lockup: can't escalate 3 to HardFault", self.log(flight))

    def test_firmware_that_says_nothing(self):
        flight = self.start(f"qemu:{write_image(self.folder / 'silent.elf', ENDLESS_LOOP)}", duration_s=1)
        self.assertEqual(flight.wait(30), 1, flight.text())
        self.assertIn("never started", flight.result()["reason"])
        self.check(flight)

    def refused(self, code, text, client, scenario=None, **options):
        flight = self.start(client, scenario, **options)
        self.assertEqual(flight.wait(30), code, flight.text())
        self.assertRegex(flight.text(), text)
        flight.check_nothing_left(self)

    def test_images_that_are_none(self):
        self.refused(2, "nowhere.elf", f"qemu:{self.folder}/nowhere.elf")
        (self.folder / "text.elf").write_text("no image\n")
        self.refused(2, r"text\.elf: not an ELF file", f"qemu:{self.folder}/text.elf")
        self.refused(2, "an ELF file for another processor", f"qemu:{PROGRAM}")

    def test_region_that_the_image_does_not_have(self):
        self.refused(2, r"no memory region or variable 'tiltproof_run_statistic'; did you mean 'tiltproof_run_statistics'\?", "qemu",
                     FAULTS.replace("tiltproof_run_statistics", "tiltproof_run_statistic"))

    def test_emulator_that_is_not_there_or_knows_no_such_board(self):
        path = self.folder / "bin"
        path.mkdir()
        for program in ("sh",):
            (path / program).symlink_to(shutil.which(program))
        self.refused(3, "there is no qemu-system-arm", "qemu", environment={"PATH": str(path)})
        (path / "qemu-system-arm").write_text("#!/bin/sh\necho 'QEMU emulator version 8.2.0'\n")
        (path / "qemu-system-arm").chmod(0o755)
        self.refused(3, "the emulated board needs QEMU 7.2, whose chip the plug-in completes, and this is 8.2.0", "qemu",
                     environment={"PATH": str(path)})
        (path / "qemu-system-arm").write_text("#!/bin/sh\n[ $1 = --version ] && echo 'QEMU emulator version 7.2.0' && exit\n"
                                              "echo 'qemu-system-arm: unsupported machine type' >&2\nexit 1\n")
        (path / "qemu-system-arm").chmod(0o755)
        self.refused(3, "the emulator exited with code 1: qemu-system-arm: unsupported machine type", "qemu",
                     environment={"PATH": str(path)})

    def test_sockets_that_nobody_listens_at(self):
        missing = self.folder / "missing"
        self.refused(2, "no such socket; no process listens there: start the emulator first", f"serial:unix:{missing}")
        left = self.folder / "left"
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(left))
        self.refused(3, "no process listens there", f"serial:unix:{left}")


if __name__ == "__main__":
    if shutil.which("qemu-system-arm") is None or not IMAGE.exists():
        print("no qemu-system-arm, or no images for it", file=sys.stderr)
        sys.exit(NOT_RUN)
    become_subreaper()
    unittest.main(verbosity=2)
