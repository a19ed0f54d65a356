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
        """Those that the test's programs are: their commands by number."""
        found = {}
        for process in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                if str(self.folder) in os.readlink(process / "cwd") and int(process.name) != os.getpid():
                    found[int(process.name)] = (process / "cmdline").read_text()
            except OSError:
                pass
        return found

    def await_none(self):
        for _ in range(100):
            if not self.processes():
                return
            time.sleep(0.1)
        self.assertEqual(self.processes(), {})

    def fly_until(self, path, client, name):
        """Flies until a program flies with it that has a word with this end in its command. Returns tiltproof and its number."""
        running = subprocess.Popen([PROGRAM, "run", path, "--no-report", "--client", client], cwd=self.folder, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(running.stderr.close)
        self.addCleanup(running.kill)
        for _ in range(200):
            for number, command in self.processes().items():
                words = command.split("\0")
                if "run" not in words and not words[0].endswith("/sh") and any(word.endswith(name) for word in words):
                    return running, number
            time.sleep(0.05)
        self.fail("its program never flew")

    def killed(self, path, client, name):
        """Flies, and kills tiltproof (SIGKILL) when that program flies with it: nothing is left."""
        running, _ = self.fly_until(path, client, name)
        running.send_signal(signal.SIGKILL)
        running.wait()
        self.await_none()
