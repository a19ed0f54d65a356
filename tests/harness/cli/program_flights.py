"""Flights of programs in a folder of their own, and a look at what is left of their processes."""
import os
import pathlib
import signal
import subprocess
import time

from command_line import PROGRAM, CommandLineTest


class ProgramFlights(CommandLineTest):
    def flown(self, *paths, client, flags=()):
        """Exit code, what was printed, results by name."""
        code, out, err = self.tiltproof("run", *paths, "--client", client, "--no-report", *flags)
        return code, out + err, {entry["name"]: entry for entry in self.results()["scenarios"]}

    def processes(self):
        """Those that the test's programs are."""
        found = []
        for process in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                if str(self.folder) in os.readlink(process / "cwd") and int(process.name) != os.getpid():
                    found.append((process / "cmdline").read_text())
            except OSError:
                pass
        return found

    def await_none(self):
        for _ in range(100):
            if not self.processes():
                return
            time.sleep(0.1)
        self.assertEqual(self.processes(), [])

    def killed(self, path, client, name):
        """Flies, and kills tiltproof (SIGKILL) when a process with this name in its command flies with it: nothing is left."""
        with subprocess.Popen([PROGRAM, "run", path, "--no-report", "--client", client], cwd=self.folder, stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL) as running:
            for _ in range(200):
                if any(name in command for command in self.processes()):
                    break
                time.sleep(0.05)
            else:
                self.fail("its program never flew")
            running.send_signal(signal.SIGKILL)
        self.await_none()
