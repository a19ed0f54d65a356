"""`tiltproof fuzz` against a firmware with one defect of each kind (careless_client.c)."""
import json
import pathlib
import re
import signal
import subprocess
import sys
import unittest

from command_line import PROGRAM, CommandLineTest

CLIENT = f"library:{pathlib.Path(sys.argv[2]).resolve() / 'libcareless_client.so'}"


class FuzzTest(CommandLineTest):
    # The defects are found within 160 inputs. The others show that the same defect is no second finding.
    def fuzz(self, build, *more, out="out", runs=1500):
        client = () if "--client" in more else ("--client", CLIENT)
        return self.tiltproof("fuzz", *client, "--firmware", build, "--runs", runs, "--out", out, *more, timeout=300)

    def summary(self, out="out"):
        return json.loads((self.folder / out / "fuzz.json").read_text())

    def assert_found(self, build, kind):
        code, out, err = self.fuzz(build)
        self.assertEqual(code, 1, out + err)
        findings = self.summary()["findings"]
        # Overwritten memory behind a buffer may also have other consequences, and these are findings of their own.
        self.assertEqual(len(findings), 1 if kind != "crash" else len(findings), findings)
        finding = findings[0]
        self.assertEqual(finding["kind"], kind)
        self.assertTrue(finding["minimised"] and finding["confirmed"], finding)
        self.assertEqual(finding["inputs"], 1)
        code, flown, err = self.tiltproof("run", finding["file"], "--client", CLIENT, "--no-report")
        self.assertEqual(code, 1, flown + err)
        # It is the very flight of the search: what a crash says has times in it, and is cut to the terminal.
        text = (self.folder / finding["file"]).read_text()
        self.assertIn("start_s: 0.012\n", text)
        # Below its comments it is what the writer of scenarios makes of this flight.
        resolved = self.folder / "results/latest" / finding["name"] / "scenario.resolved.yaml"
        self.assertEqual("".join(line for line in text.splitlines(True) if not line.startswith("#")), resolved.read_text())
        # Its flags may be those of the frames before and behind it.
        self.assertNotRegex(text, "no_opening_flag|aborted")
        if kind in ("command", "restart"):
            self.assertIn(finding["reason"].split(" (")[0], flown)
        # The same scenario is green where the defect is not.
        code, flown, err = self.tiltproof("run", finding["file"], "--client", CLIENT, "--firmware", "careful", "--no-report")
        self.assertEqual(code, 0, flown + err)
        return finding

    def test_a_length_that_nobody_checks_is_a_crash(self):
        finding = self.assert_found("careless", "crash")
        # Nothing but the bytes up to the guard behind the buffer, and one to have it checked.
        self.assertLessEqual(finding["bytes"], 2 * 88 + 2)
        self.assertGreater(finding["bytes"], 80)

    def test_an_escape_that_is_never_forgotten_is_silence(self):
        finding = self.assert_found("deaf", "silence")
        self.assertLessEqual(finding["bytes"], 4)
        self.assertRegex(finding["reason"], r"\(it last asked at \d\.\d+ s, last commanded at \d\.\d+ s\)")
        self.assertIn("#    1: dangling_escape of ", (self.folder / finding["file"]).read_text())

    def test_a_command_that_is_no_number_is_found(self):
        self.assertRegex(self.assert_found("absurd", "command")["reason"], r"\(the first at 0\.\d+ s: the server refused a command: \w+ = .*, plausible is")

    def test_a_process_that_ends_itself_by_a_signal_is_a_crash(self):
        for build, cause in [("raises", r"raised SIGKILL in its process \(kill\) in tiltproof_client_receive"),
                             ("killed", r"again and again: the process was killed by signal 9 \(Killed\) in tiltproof_client_receive"),
                             ("terminated", r"again and again: a signal that asks the process to end")]:
            with self.subTest(build):
                code, out, err = self.fuzz(build, out=build, runs=1500)
                self.assertEqual(code, 1, out + err)
                (finding,) = self.summary(build)["findings"]
                self.assertEqual((finding["kind"], finding["confirmed"], finding["inputs"]), ("crash", True, 1))
                self.assertRegex(finding["reason"], cause)
                self.assertTrue(self.summary(build)["complete"])

    def test_a_reboot_is_found(self):
        finding = self.assert_found("restless", "restart")
        self.assertRegex(finding["reason"], r"restarted at 0\.\d+ s \(it sent `start` again\), which no fault asked for")

    def test_what_it_executes_leads_the_search(self):
        # With other seeds it takes up to 45 000 inputs.
        seed, runs = ("--seed", 12), 6000
        code, out, err = self.fuzz("secret", *seed, "--client", CLIENT.replace("careless_client", "careless_blind_client"), out="blind", runs=runs)
        self.assertEqual((code, self.summary("blind")["coverage"], self.summary("blind")["findings"]), (0, False, []), out + err)
        code, out, err = self.fuzz("secret", *seed, runs=runs)
        self.assertEqual((code, self.summary()["coverage"]), (1, True), out + err)
        (finding,) = self.summary()["findings"]
        self.assertEqual(finding["kind"], "crash")

    def test_a_damaged_stack_guard_is_named(self):
        code, out, err = self.fuzz("smashed", runs=1000)
        self.assertEqual(code, 1, out + err)
        (finding,) = self.summary()["findings"]
        self.assertEqual(finding["kind"], "crash")
        self.assertRegex(finding["reason"], r"damaged a stack guard .*stack smashing detected.* in tiltproof_client_\w+ at libcareless_client\.so\+0x\w+")

    def test_a_heap_that_the_harness_finds_damaged_is_a_crash(self):
        code, out, err = self.fuzz("overrun", runs=1000)
        self.assertEqual(code, 1, out + err)
        (finding,) = [one for one in self.summary()["findings"] if "noticed outside its code" in one["reason"]]
        self.assertEqual(finding["kind"], "crash")
        self.assertTrue(finding["minimised"] and finding["confirmed"], finding)
        self.assertEqual(finding["inputs"], 1)
        text = pathlib.Path(self.folder / finding["file"]).read_text()
        self.assertIn("may pass while the defect is there", text)
        self.assertNotIn("passes afterwards", text)
        # It went on after that.
        self.assertGreater(finding["flights"], 1)
        self.assertTrue(self.summary()["complete"])

    def test_two_crashes_are_told_apart_by_their_places(self):
        code, out, err = self.fuzz("twofold")
        self.assertEqual(code, 1, out + err)
        findings = self.summary()["findings"]
        self.assertEqual([(one["kind"], one["confirmed"], one["inputs"]) for one in findings], 2 * [("crash", True, 1)])
        places = [re.search(r"Segmentation fault at libcareless_client\.so\+(0x\w+)", one["reason"])[1] for one in findings]
        self.assertNotEqual(*places)
        # The same flight says the same in another process.
        code, flown, err = self.tiltproof("run", findings[0]["file"], "--client", CLIENT, "--no-report")
        self.assertEqual(code, 1, flown + err)
        self.assertIn(places[0], (self.folder / "results/latest/results.json").read_text())

    def test_a_crash_when_it_is_destroyed_is_found(self):
        code, out, err = self.fuzz("leaves", runs=1000)
        self.assertEqual(code, 1, out + err)
        (finding,) = self.summary()["findings"]
        self.assertRegex(finding["reason"], r"^after the flight: the firmware crashed in tiltproof_client_destroy: Aborted at libcareless_client\.so\+0x")
        self.assertEqual((finding["confirmed"], finding["inputs"]), (True, 1))
        self.assertNotIn("warning", err)
        self.assertIn("says this as a warning", (self.folder / finding["file"]).read_text())
        code, flown, err = self.tiltproof("run", finding["file"], "--client", CLIENT, "--no-report")
        self.assertEqual(code, 0, flown + err)
        self.assertRegex(err, r"warning: after the flight, which counts as it was, the firmware crashed in tiltproof_client_destroy: Aborted at libcareless_client\.so\+0x")

    def test_a_careful_firmware_is_left_alone(self):
        code, out, err = self.fuzz("careful", runs=3000)
        self.assertEqual(code, 0, out + err)
        self.assertEqual(self.summary()["executions"], 3000)
        self.assertEqual(list((self.folder / "out" / "findings").iterdir()), [])

    def test_a_firmware_may_boot_for_longer_than_a_flight_lasts(self):
        code, out, err = self.fuzz("slow", runs=500)
        self.assertEqual(code, 0, out + err)
        self.assertEqual(self.summary()["executions"], 500)

    def test_the_same_seed_finds_the_same_with_any_number_of_jobs(self):
        def all_of(out, *more):
            self.fuzz("careless", "--seed", 5, *more, out=out, runs=1000)
            summary = self.summary(out)
            return ([(one["name"], one["executions"], one["flights"], one["bytes"]) for one in summary["findings"]], summary["executions"],
                    summary["features"], [re.sub(rf"\b{out}/", "", (self.folder / one["file"]).read_text()) for one in summary["findings"]])
        first = all_of("a")
        self.assertEqual(first, all_of("b", "-j", 2))
        self.assertNotEqual(first[1], (self.fuzz("careless", "--seed", 6, out="c", runs=1000), self.summary("c")["executions"])[1])

    def test_it_says_what_the_firmware_cannot_do_by_itself(self):
        code, out, err = self.fuzz("broken")
        self.assertEqual(code, 3, out + err)
        self.assertIn("fails without hostile bytes", err)
        self.assertIn("Aborted", err)

    def test_an_interrupt_leaves_what_was_found(self):
        with subprocess.Popen([PROGRAM, "fuzz", "--client", CLIENT, "--firmware", "deaf", "--time", "600", "--out", "out"], cwd=self.folder,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
            self.assertIn(b"silence", process.stdout.readline())
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130)
        (finding,) = self.summary()["findings"]
        self.assertFalse(self.summary()["complete"])
        self.assertTrue((self.folder / finding["file"]).is_file())

    def test_what_cannot_be_written_is_printed(self):
        self.fuzz("deaf", runs=1000)
        (finding,) = self.summary()["findings"]
        # A folder has the name of its file.
        (self.folder / "other" / "findings" / pathlib.Path(finding["file"]).name).mkdir(parents=True)
        code, out, err = self.fuzz("deaf", out="other", runs=1000)
        self.assertEqual(code, 3, out + err)
        self.assertIn("not everything could be written: ", err)
        self.assertRegex(out, rf"{finding['name']} after \d+ inputs: talks-again")
        self.assertRegex(out, rf"(?m)^  it could not be written to other/findings/{finding['name']}\.yaml\n  on to_client, (instead of|before|after) the frame of each period: [0-9a-f]{{2,}}$")
        self.assertEqual(self.summary("other")["executions"], self.summary()["executions"])

    def test_a_hang_that_costs_no_time_does_not_end_the_search(self):
        code, out, err = self.fuzz("hasty")
        self.assertEqual(code, 1, out + err)
        (finding,) = self.summary()["findings"]
        self.assertIn("lets no time pass", finding["reason"])
        self.assertGreater(finding["flights"], 4)
        self.assertTrue(self.summary()["complete"] and finding["confirmed"])
        # It is made as small as anything else.
        self.assertEqual(finding["inputs"], 1)
        self.assertLessEqual(finding["bytes"], 9)

    def test_making_findings_small_has_an_end(self):
        # Each flight that hangs takes five seconds.
        code, out, err = self.tiltproof("fuzz", "--client", CLIENT, "--firmware", "loop", "--time", 1, "--out", "out", timeout=120)
        self.assertEqual(code, 1, out + err)
        (finding,) = self.summary()["findings"]
        self.assertEqual((finding["kind"], finding["minimised"]), ("hang", False))
        self.assertIn("(not made as small as it could be)", out)

    def test_a_corpus_is_flown_first(self):
        self.fuzz("careful", "--seed", 2, runs=6000)
        before, files = self.summary(), sorted((self.folder / "out" / "corpus").iterdir())
        code, out, err = self.fuzz("careful", "--seed", 2, runs=1)
        after = self.summary()
        self.assertGreaterEqual(after["features"], before["features"], out + err)
        # One more input at most is new, and what others reach, too, is not begun from.
        self.assertLessEqual(len(sorted((self.folder / "out" / "corpus").iterdir())), len(files) + 1)
        self.assertLess(after["corpus"], len(files))
        self.assertGreater(after["executions"], 1)
        # The campaign does not read files that are no sequence of a campaign.
        for name in (".hidden", "17.part"):
            (self.folder / "out" / "corpus" / name).write_text("nothing")
        code, out, err = self.fuzz("careful", runs=1)
        self.assertNotIn("no sequence", err)
        self.assertNotIn("warning", err)
        # Whose it is, is said.
        code, out, err = self.fuzz("secret", runs=1)
        self.assertIn("warning: --out out: its corpus, and perhaps findings, are of --client library:", err)
        self.assertIn("--firmware careful", err)

    def test_what_was_found_before_is_flown_first(self):
        self.fuzz("twofold")
        names = sorted(one["name"] for one in self.summary()["findings"])
        self.assertEqual(len(names), 2)
        texts = {path: path.read_text() for path in (self.folder / "out" / "findings").iterdir()}
        # One input finds neither.
        code, out, err = self.fuzz("twofold", runs=1)
        self.assertEqual((code, sorted(one["name"] for one in self.summary()["findings"])), (1, names), out + err)
        self.assertEqual(texts, {path: path.read_text() for path in (self.folder / "out" / "findings").iterdir()})
        self.assertNotIn("breaks nothing now", err)
        # A black box flies them, too.
        blind = CLIENT.replace("careless_client", "careless_blind_client")
        code, out, err = self.fuzz("twofold", "--client", blind, runs=1)
        self.assertEqual((code, len(self.summary()["findings"])), (1, 2), out + err)
        # The campaign reports which findings are fixed.
        code, out, err = self.fuzz("careful", runs=1)
        self.assertEqual((code, self.summary()["findings"]), (0, []), out + err)
        for name in names:
            self.assertIn(f"{name} of before breaks nothing now: out/findings/{name}.yaml", err)

    def test_a_finding_that_cannot_be_read_is_not_passed_over(self):
        findings = self.folder / "out" / "findings"
        findings.mkdir(parents=True)
        (findings / "notes.txt").write_text("of the user")
        (findings / "crash-00000000.yaml").write_text("name: x\nfaults: [\n")
        code, out, err = self.fuzz("careful", runs=1)
        self.assertEqual(code, 2, out + err)
        self.assertRegex(err, r"out/findings/crash-00000000\.yaml: no finding of `tiltproof fuzz`: .*; fix or remove it")

    def test_what_was_made_small_stays_small(self):
        self.fuzz("deaf", runs=1000)
        (small,) = self.summary()["findings"]
        path = self.folder / small["file"]
        text = path.read_text()
        # Another command finds it in many frames, and has no time to make it small.
        with subprocess.Popen([PROGRAM, "fuzz", "--client", CLIENT, "--firmware", "deaf", "--seed", "2", "--time", "600", "--out", "out"],
                              cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
            self.assertIn(b"silence", process.stdout.readline())
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)
        (finding,) = self.summary()["findings"]
        self.assertEqual((finding["inputs"], finding["bytes"]), (small["inputs"], small["bytes"]))
        frames = re.search(r'frames: ".*"', text)[0]
        self.assertIn(frames, path.read_text())
        # A smaller one that breaks nothing is none.
        path.write_text(text.replace(frames, 'frames: "7e"'))
        self.fuzz("deaf", runs=3000)
        self.assertIn(frames, path.read_text())

    def test_one_command_at_a_time_writes_a_folder(self):
        with subprocess.Popen([PROGRAM, "fuzz", "--client", CLIENT, "--firmware", "deaf", "--time", "600", "--out", "out"], cwd=self.folder,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
            self.assertIn(b"silence", process.stdout.readline())
            code, out, err = self.fuzz("deaf", runs=1)
            self.assertEqual(code, 2, out + err)
            self.assertIn("--out out: another `tiltproof fuzz` writes there", err)
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)
        self.assertEqual(self.fuzz("deaf", runs=1)[0] in (0, 1), True)

    def test_mistakes_are_told(self):
        (self.folder / "taken").write_text("")
        for arguments, what in ((("--out", "taken"), "--out taken: cannot make the folder"), (("--out", ""), "--out: the name of the folder is empty"), (("--protocol", "papr"), "--protocol papr: no such protocol"),
                                (("--client", "a=host"), "fuzz has one client"), (("--firmware", "papr"), "--firmware papr: no such build"),
                                (("--time", "5", "--runs", "5"), "--runs"), (("--client", "process:true", "-j", "2"), "-j 2")):
            code, out, err = self.tiltproof("fuzz", *arguments)
            self.assertEqual(code, 2, out + err)
            self.assertIn(what, err)
        (self.folder / "out" / "corpus").mkdir(parents=True)
        (self.folder / "out" / "corpus" / "mine").write_text("to_client instead\n7\n")
        code, out, err = self.fuzz("careful")
        self.assertEqual(code, 2, out + err)
        self.assertIn("corpus/mine: no sequence of a corpus", err)

    def test_lines_of_json(self):
        code, out, err = self.fuzz("deaf", "--format", "jsonl")
        self.assertEqual(code, 1, out + err)
        lines = [json.loads(line) for line in out.splitlines()]
        self.assertEqual(lines[0]["kind"], "silence")
        self.assertEqual(lines[-1]["seed"], 1)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0]])
