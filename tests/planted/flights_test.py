#!/usr/bin/env python3
"""Planted defects in flight: each witness, as a scenario, breaks its client and not the correct one; and `tiltproof fuzz`
finds some of them, with a fixed seed and a fixed number of inputs, as scenarios that tell the two clients apart.

Usage: flights_test.py TILTPROOF FOLDER-OF-LIBRARIES [FOLDER-OF-IMAGES TEST...]
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
TILTPROOF, LIBRARIES, *IMAGES = (pathlib.Path(argument) for argument in sys.argv[1:4])
del sys.argv[1:4]

SCENARIO = """\
name: {name}
held: true
duration_s: 0.9
reference: {{type: hover, at_m: [0, 0, 1]}}
faults:
  - {{id: witness, type: frame.script, target: to_client, parameters: {{frames: "{words}"}}}}
criteria:
  - {{name: talks-again, metric: timing.silent_at_end_ms, max: 300}}
  - {{name: sends-only-messages, metric: protocol.malformed_sent_count, max: 0}}
  - {{name: answers-whole-replies, metric: protocol.replies_ignored_count, max: 0}}
  - {{name: commands-once-a-reply, metric: protocol.commands_without_reply_count, max: 0}}
"""


class Flights(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def verdicts(self, client, *scenarios):
        done = subprocess.run([TILTPROOF, "run", *scenarios, "--client", client, "--out", self.root / "out", "--no-report",
                               "--no-progress"], capture_output=True, text=True, timeout=300)
        self.assertIn(done.returncode, (0, 1), done.stdout + done.stderr)
        results = json.loads((self.root / "out/latest/results.json").read_text())["scenarios"]
        return {result["name"]: result["verdict"] for result in results}

    def tell_apart(self, client_of):
        """`client_of` says what --client is for a defect."""
        files = {}
        for witness in sorted((HERE / "witness").glob("*.hex")):
            words = [line for line in witness.read_text().splitlines() if not line.startswith("#")]
            files[witness.stem] = self.root / f"{witness.stem}.yaml"
            files[witness.stem].write_text(SCENARIO.format(name=witness.stem, words=" ".join(words)))
        self.assertEqual(len(files), 12)
        self.assertEqual(self.verdicts(client_of("correct"), *files.values()), dict.fromkeys(files, "pass"))
        for name, file in files.items():
            with self.subTest(name):
                self.assertEqual(self.verdicts(client_of(name), file), {name: "fail"})

    def test_witnesses_break_libraries(self):
        self.tell_apart(lambda name: f"library:{LIBRARIES}/planted_{name}.so")

    @unittest.skipIf(not IMAGES, "no cross compiler, or no emulator")
    def test_witnesses_break_images(self):
        self.tell_apart(lambda name: f"qemu:{IMAGES[0]}/planted_{name}.elf")

    def fuzz(self, name, runs, client=f"library:{LIBRARIES}/planted_{{}}_coverage.so"):
        out = self.root / name
        done = subprocess.run([TILTPROOF, "fuzz", "--client", client.format(name), "--runs", str(runs), "--seed", "1", "--out", out,
                               "--no-progress"], capture_output=True, text=True, timeout=300)
        return done, json.loads((out / "fuzz.json").read_text())

    def test_fuzz_finds_them(self):
        for name, kind, runs in [("length_unchecked", "crash", 300), ("escape_at_end", "crash", 300), ("flag_in_escape", "crash", 300),
                                 ("off_by_one", "crash", 1500), ("signed_length", "crash", 300), ("integer_overflow", "crash", 300),
                                 ("missing_reset", "silence", 3000), ("state_kept", "command", 3000), ("reply_skipped", "ignored", 1000),
                                 ("old_answered", "stale", 1000)]:
            with self.subTest(name):
                done, summary = self.fuzz(name, runs)
                self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
                found = [finding for finding in summary["findings"] if finding["kind"] == kind and finding["confirmed"]]
                self.assertTrue(found, summary)
                scenario = pathlib.Path(found[0]["file"])
                self.assertEqual(list(self.verdicts(f"library:{LIBRARIES}/planted_{name}.so", scenario).values()), ["fail"])
                self.assertEqual(list(self.verdicts(f"library:{LIBRARIES}/planted_correct.so", scenario).values()), ["pass"])

    @unittest.skipIf(not IMAGES, "no cross compiler, or no emulator")
    def test_fuzz_sees_an_image_hang_again(self):
        # The hang is found within some dozens of inputs.
        done, summary = self.fuzz("endless_loop", 200, f"qemu:{IMAGES[0]}/planted_{{}}.elf")
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        hang = next(finding for finding in summary["findings"] if finding["kind"] == "hang")
        self.assertTrue(hang["confirmed"], hang)
        self.assertIn("it is in ", hang["reason"])

    def test_fuzz_finds_nothing_in_the_correct_client(self):
        done, summary = self.fuzz("correct", 10000)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual(summary["findings"], [])
        self.assertTrue(9000 <= summary["executions"] <= 10000, summary)


if __name__ == "__main__":
    unittest.main()
