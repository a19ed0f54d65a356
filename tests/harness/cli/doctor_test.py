#!/usr/bin/env python3
"""`tiltproof doctor` as a user runs it, on this machine and on made-up ones. Usage: doctor_test.py TILTPROOF"""
import fcntl
import json
import os
import pathlib
import pty
import resource
import shutil
import socket
import subprocess
import sys
import tempfile
import unittest

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
NOBODY = 65534


class DoctorTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-doctor-"))
        self.folder.chmod(0o755)
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        (self.folder / "dev").mkdir()

    def doctor(self, *arguments, before=None, program=(PROGRAM,), path=None):
        done = subprocess.run([*program, "doctor", "--root", self.folder, *arguments], capture_output=True, timeout=60, check=False,
                              preexec_fn=before, env={**os.environ, **({"PATH": str(path)} if path else {})})
        return done.returncode, done.stdout.decode(), done.stderr.decode()

    def checks(self, *arguments, **how):
        code, out, err = self.doctor("--format", "jsonl", *arguments, **how)
        self.assertEqual(err, "")
        lines = [json.loads(line) for line in out.splitlines()]
        for line in lines:
            self.assertEqual(list(line), ["check", "status", "text", "advice"])
            self.assertIn(line["status"], ("ok", "warn", "FAIL"))
        self.assertEqual(code, 3 if any(line["status"] == "FAIL" for line in lines) else 0)
        return {line["check"]: line for line in lines}

    def write(self, path, text=""):
        path = self.folder / path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def terminal(self):
        ends = pty.openpty()
        for end in ends:
            self.addCleanup(os.close, end)
        return os.ttyname(ends[1]), ends[1]

    def as_nobody(self, **limits):
        if os.geteuid() != 0:
            self.skipTest("needs root, to drop its rights")

        def before():
            for name, limit in limits.items():
                resource.setrlimit(getattr(resource, "RLIMIT_" + name.upper()), (limit, limit))
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)

        # Where the program was built need not be open to everybody.
        copy = self.folder / "tiltproof"
        shutil.copy(PROGRAM, copy)
        return {"before": before, "program": (copy,)}

    def test_one_line_a_check(self):
        code, out, err = self.doctor()
        self.assertEqual((code, err), (0, ""))
        for line in out.splitlines():
            self.assertRegex(line, r"^(ok|warn|FAIL) +[a-z].*: .")
        names = set(self.checks())
        self.assertLessEqual({"processors", "real-time priority", "locked memory", "frequency governor", "network interface lo",
                              "pseudo-terminals", "serial devices", "emulator", "firmware images", "socket of programs", "virtual clock", "python3"}, names)

    def test_serial_devices_are_listed_once_and_not_opened(self):
        self.write("dev/ttyUSB0")
        by_id = self.folder / "dev/serial/by-id"
        by_id.mkdir(parents=True)
        (by_id / "usb-FTDI").symlink_to("../../ttyUSB0")
        (by_id / "usb-gone").symlink_to("../../ttyUSB9")
        found = {name: check for name, check in self.checks().items() if "serial" in name}
        self.assertEqual(list(found), [f"serial device {self.folder}/dev/ttyUSB0"])
        [check] = found.values()
        self.assertEqual(check["status"], "ok")
        self.assertIn("by-id/usb-FTDI", check["text"])

    def test_a_device_without_permission_or_in_use_is_a_warning(self):
        device = self.write("dev/ttyACM0")
        name = f"serial device {device}"
        with open(device):
            check = self.checks()[name]
            self.assertEqual(check["status"], "warn")
            self.assertIn(f"{os.getpid()} (", check["text"])
        device.chmod(0o600)
        check = self.checks(**self.as_nobody())[name]
        self.assertEqual(check["status"], "warn")
        self.assertIn("usermod -aG dialout $USER", check["advice"])

    def test_latency_timer(self):
        self.write("dev/ttyUSB0")
        timer = self.write("sys/class/tty/ttyUSB0/device/latency_timer", "16\n")
        name = f"latency timer of {self.folder}/dev/ttyUSB0"
        check = self.checks()[name]
        self.assertEqual(check["status"], "warn")
        self.assertIn("16 ms", check["text"])
        self.assertIn(str(timer), check["advice"])
        self.assertIn('ATTR{latency_timer}="1"', check["advice"])
        timer.write_text("1\n")
        self.assertEqual(self.checks()[name]["status"], "ok")
        timer.write_text("rubbish\n")
        self.assertNotIn(name, self.checks())

    def test_governor(self):
        self.write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n")
        self.assertEqual(self.checks()["frequency governor"]["status"], "ok")
        self.write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n")
        check = self.checks()["frequency governor"]
        self.assertEqual(check["status"], "warn")
        self.assertIn("cpupower", check["advice"])

    def test_client_devices(self):
        first, descriptor = self.terminal()
        second, _ = self.terminal()
        checks = self.checks("--client", f"serial:{first},{second}")
        self.assertEqual(checks[f"client's {first}"]["status"], "ok")
        self.assertEqual(checks[f"client's {second}"]["status"], "ok")
        # One port cannot be both lines.
        code, out, _ = self.doctor("--client", f"serial:{first},{first}")
        self.assertEqual(code, 3)
        self.assertRegex(out, r"FAIL +client's .*busy")
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        check = self.checks("--client", f"serial:{first}")[f"client's {first}"]
        self.assertEqual(check["status"], "FAIL")
        self.assertIn(str(os.getpid()), check["text"])
        missing = self.folder / "dev/ttyUSB3"
        check = self.checks("--client", f"serial:{missing}")[f"client's {missing}"]
        self.assertEqual(check["status"], "FAIL")
        self.assertIn("no such device", check["text"])
        self.assertEqual(self.checks("--client", "serial:/dev/null")["client's /dev/null"]["status"], "FAIL")

    def test_client_sockets_are_looked_for_and_not_called(self):
        listener = socket.socket(socket.AF_UNIX)
        self.addCleanup(listener.close)
        path = self.folder / "uart"
        listener.bind(str(path))
        listener.listen(1)
        listener.setblocking(False)
        name = f"unix:{path}"
        self.assertEqual(self.checks("--client", f"serial:{name}")[f"client's {name}"]["status"], "ok")
        self.assertRaises(BlockingIOError, listener.accept)
        check = self.checks("--client", f"serial:{name}x")[f"client's {name}x"]
        self.assertEqual(check["status"], "FAIL")
        self.assertIn("start the emulator first", check["text"])

    def emulator(self, text):
        """The checks where qemu-system-arm, if `text` is not empty, is a program that prints it."""
        folder = self.folder / "bin"
        folder.mkdir(exist_ok=True)
        (folder / "qemu-system-arm").unlink(missing_ok=True)
        if text:
            (folder / "qemu-system-arm").write_text(f"#!/bin/sh\necho '{text}'\n")
            (folder / "qemu-system-arm").chmod(0o755)
        return self.checks(path=folder)

    def test_emulator(self):
        checks = self.emulator("")
        self.assertEqual(checks["emulator"]["status"], "warn")
        self.assertIn("apt-get install --no-install-recommends qemu-system-arm", checks["emulator"]["advice"])
        self.assertNotIn("emulator in lockstep", checks)
        checks = self.emulator("QEMU emulator version 9.1.0 (made up)")
        self.assertEqual(checks["emulator"]["status"], "warn")
        self.assertIn("9.1.0", checks["emulator"]["text"])
        self.assertIn("lockstep needs 7.2", checks["emulator"]["text"])
        self.assertNotIn("emulator in lockstep", checks)
        checks = self.emulator("QEMU emulator version 7.2.99 (made up)")
        self.assertEqual(checks["emulator"]["status"], "ok")
        # It is only said to be one.
        self.assertEqual(checks["emulator in lockstep"]["status"], "warn")

    def test_firmware_images(self):
        check = self.checks()["firmware images"]
        built = list((PROGRAM.parent / "firmware/stm32f4").glob("executive-*.elf"))
        self.assertEqual(check["status"], "ok" if built else "warn")
        self.assertIn(f"executive: {len(built)}," if built else "none in", check["text"])
        copy = self.folder / "elsewhere/tiltproof"
        copy.parent.mkdir()
        shutil.copy(PROGRAM, copy)
        check = self.checks(program=(copy,))["firmware images"]
        self.assertEqual(check["status"], "warn")
        self.assertIn("./setup --images", check["advice"])

    def test_interface(self):
        self.assertEqual(self.checks("--interface", "lo")["network interface lo"]["status"], "ok")
        check = self.checks("--interface", "nosuch0")["network interface nosuch0"]
        self.assertEqual(check["status"], "FAIL")
        self.assertIn("lo", check["advice"])

    def test_rights_of_an_ordinary_user(self):
        checks = self.checks(**self.as_nobody(rtprio=0, memlock=65536))
        self.assertEqual(checks["real-time priority"]["status"], "warn")
        self.assertIn("rtprio", checks["real-time priority"]["advice"])
        self.assertEqual(checks["locked memory"]["status"], "warn")
        self.assertIn("64 KiB", checks["locked memory"]["text"])

    def test_rights_of_a_user_with_limits_raised(self):
        how = self.as_nobody(rtprio=50, memlock=resource.RLIM_INFINITY)
        try:
            checks = self.checks(**how)
        except subprocess.SubprocessError:
            self.skipTest("limits may not be raised here")
        self.assertEqual(checks["real-time priority"]["status"], "ok")
        self.assertEqual(checks["locked memory"]["status"], "ok")

    def test_loopback_down(self):
        if os.geteuid() != 0 or subprocess.run(["unshare", "-n", "true"], capture_output=True, check=False).returncode != 0:
            self.skipTest("needs a network of its own")
        check = self.checks(program=("unshare", "-n", PROGRAM))["network interface lo"]
        self.assertEqual(check["status"], "FAIL")
        self.assertIn("sudo ip link set lo up", check["advice"])

    def test_usage(self):
        for arguments in (["--client", "host"], ["--client", "serial:"], ["--client", "serial:a,"], ["--client", "serial:a,b,c"],
                          ["--format", "xml"], ["more"]):
            code, out, err = self.doctor(*arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertNotEqual(err, "")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
