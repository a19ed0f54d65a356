#!/usr/bin/env python3
"""The command campaign: its database against Python's SQLite, its end by signals and limits, and its runs flown again.

Usage: campaign_test.py TILTPROOF SOURCE_DIR
"""
import json
import os
import re
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
import unittest

from command_line import PROGRAM, CommandLineTest

HOVER = """\
name: NAME
duration_s: 1.2
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.1)"}
  - {name: upright, stl: "always(tilt_rad <= 0.3)"}
"""

FILE = """\
campaign: NAME
scenarios: [hover.yaml]
runs_count: RUNS
seed: 5
draw:
  types: ["actuator.*", "plant.*", frame.drop]
MORE"""

BABBLE = """\
campaign: night
scenarios: [hover.yaml]
runs_count: 10
seed: 5
draw:
  types: [frame.babble]
  faults_count: {min: 1, max: 1}
  parameters: {frame.babble: {rate_hz: {log_uniform: [1000, 10000]}}}
  start_s: {choice: [0]}
  length_s: {choice: [40]}
"""


WHOLE = []  # flown once for all tests


class CampaignTest(CommandLineTest):
    def setUp(self):
        super().setUp()
        self.scenario("hover", HOVER)

    def campaign(self, *arguments, code, **more):
        """`code` None: whether a flight failed does not matter."""
        found, out, err = self.tiltproof("campaign", *arguments, **more)
        self.assertIn(found, (0, 1) if code is None else (code,), out + err)
        return out, err

    def file(self, runs, more=""):
        (self.folder / "night.yaml").write_text(FILE.replace("NAME", "night").replace("RUNS", str(runs)).replace("MORE", more))
        return "night.yaml"

    def rows(self, folder):
        """All that was stored, without the times of this machine."""
        with sqlite3.connect(self.folder / folder / "campaign.sqlite") as database:
            return {
                table: database.execute(f"SELECT {columns} FROM {table} ORDER BY {order}").fetchall()
                for table, columns, order in [
                    ("run", "number, seed, firmware, verdict, end, criterion, time_s, margin, trace_hash", "number"),
                    ("fault", "run, id, type, place, severity, start_s, end_s, activations", "run, id"),
                    ("criterion", "run, name, verdict, margin", "run, name"),
                ]
            }

    def whole(self):
        """The rows, and the summary, of a campaign of 300 runs that nothing disturbs; the file of it is written."""
        self.file(300)
        if not WHOLE:
            self.campaign("night.yaml", "-j", "2", "--out", "whole", "--no-report", code=1)
            WHOLE.append((self.rows("whole"), (self.folder / "whole/campaign.json").read_bytes()))
        return WHOLE[0]

    def begin(self, *arguments, **more):
        return subprocess.Popen([PROGRAM, "campaign", *arguments], cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **more)

    def wait_for_runs(self, folder, process):
        """Until some runs are stored."""
        while process.poll() is None:
            time.sleep(0.02)
            if (self.folder / folder / "campaign.sqlite").exists() and self.count(folder) > 0:
                return

    def count(self, folder):
        try:
            with sqlite3.connect(f"file:{self.folder / folder / 'campaign.sqlite'}?mode=ro", uri=True) as database:
                return database.execute("SELECT count(*) FROM run").fetchone()[0]
        except sqlite3.OperationalError:  # it is being made
            return 0

    def test_the_same_runs_with_any_number_of_jobs_and_in_shards(self):
        out, _ = self.campaign(self.file(60), "-j", "1", "--out", "one", "--no-report", code=1)
        self.campaign("night.yaml", "-j", "3", "--out", "three", "--no-report", code=1)
        one = self.rows("one")
        self.assertEqual([row[0] for row in one["run"]], list(range(60)))
        self.assertEqual(self.rows("three"), one)
        self.assertEqual((self.folder / "one/campaign.json").read_bytes(), (self.folder / "three/campaign.json").read_bytes())
        failed = sum(row[3] != "pass" for row in one["run"])
        self.assertRegex(out, rf"campaign night: 60 runs, {60 - failed} survived .*, {failed} failed in \d+ way")
        parts = {table: [] for table in one}
        for part in (1, 2, 3):
            self.campaign("night.yaml", "--shard", f"{part}/3", "--out", f"part{part}", "--no-report", code=1)
            for table, rows in self.rows(f"part{part}").items():
                parts[table] += rows
        self.assertEqual(parts, one)

    def test_scenarios_alone_draw_every_type(self):
        self.campaign("hover.yaml", "--runs", "150", "--out", "all", "-j", "2", "--no-report", code=1)
        rows = self.rows("all")
        types = {row[2] for row in rows["fault"]}
        self.assertGreater(len(types), 50)
        self.assertFalse([name for name in types if name.startswith(("node.", "harness.", "dds."))])
        self.assertTrue(all(1 <= sum(fault[0] == run[0] for fault in rows["fault"]) <= 3 for run in rows["run"]))

    def test_a_campaign_of_any_files_goes_on(self):
        """Its name comes from those of the files and folders, which may be anything."""
        self.scenario("second", HOVER, folder="my flights (2)")
        self.campaign("my flights (2)", "hover.yaml", "--runs", "2", "--out", "many", "--no-report", code=None)
        self.campaign("status", "many", code=0)

    def test_killed_campaigns_lose_and_double_nothing(self):
        whole, summary = self.whole()
        with self.begin("night.yaml", "-j", "2", "--out", "killed", "--no-report") as process:
            self.wait_for_runs("killed", process)
            process.kill()
        kills = 1
        while kills < 4:
            before = self.count("killed")
            with self.begin("--resume", "killed", "-j", "2", "--no-report") as process:
                time.sleep(0.3 * kills)
                process.kill()
            self.assertGreaterEqual(self.count("killed"), before)
            kills += 1
        self.campaign("--resume", "killed", "-j", "2", "--no-report", code=1)
        self.assertEqual(self.rows("killed"), whole)
        self.assertEqual((self.folder / "killed/campaign.json").read_bytes(), summary)

    def test_an_interrupt_ends_it_and_it_goes_on(self):
        whole, _ = self.whole()
        with self.begin("night.yaml", "-j", "2", "--out", "cut", "--no-report") as process:
            self.wait_for_runs("cut", process)
            process.send_signal(signal.SIGINT)
            err = process.stderr.read().decode()
        if process.returncode != 1:  # it was not over by then
            self.assertEqual(process.returncode, 130, err)
            self.assertRegex(err, r"interrupted after \d+ of 300 runs; go on with `.* campaign --resume cut`")
            out, _ = self.campaign("status", "cut", code=0)
            self.assertRegex(out, r"campaign night: \d+ of 300 runs, \d+ failed in \d+ way")
        self.campaign("--resume", "cut", "-j", "2", "--no-report", code=1)
        self.assertEqual(self.rows("cut"), whole)
        out, _ = self.campaign("status", "cut", code=0)
        self.assertRegex(out, r"300 of 300 runs")

    def test_a_full_disk_is_said_and_it_goes_on(self):
        whole, _ = self.whole()

        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

        with self.begin("night.yaml", "-j", "2", "--out", "full", "--no-report", preexec_fn=limit) as process:
            err = process.stderr.read().decode()
        self.assertEqual(process.returncode, 3, err)
        self.assertRegex(err, r"campaign\.sqlite.*; what was stored before is kept\. Make room, and go on with `.* campaign --resume full`")
        self.assertLess(self.count("full"), 300)
        self.campaign("--resume", "full", "-j", "2", "--no-report", code=1)
        self.assertEqual(self.rows("full"), whole)

    def test_it_stops_after_so_many_failures(self):
        file = self.file(200, "stop: {failures_count: 3}\n")
        self.campaign(file, "-j", "1", "--out", "one", "--no-report", code=1)
        self.campaign(file, "-j", "3", "--out", "three", "--no-report", code=1)
        rows = self.rows("one")["run"]
        self.assertEqual(sum(row[3] != "pass" for row in rows), 3)
        self.assertNotEqual(rows[-1][3], "pass")
        self.assertEqual(self.rows("three"), self.rows("one"))
        self.assertIn("it was ended by its `stop`", self.campaign("status", "one", code=0)[0])

    def test_mild_faults_are_survived(self):
        (self.folder / "mild.yaml").write_text(
            "campaign: mild\nscenarios: [hover.yaml]\nruns_count: 20\ndraw:\n  types: [sensor.bias]\n"
            "  parameters: {sensor.bias: {offset: {uniform: [-1e-6, 1e-6]}}}\n")
        out, _ = self.campaign("mild.yaml", "--out", "mild", code=0)
        self.assertIn("20 runs, 20 survived (100.0 %), 0 failed", out)
        self.assertFalse([row for row in self.rows("mild")["fault"] if abs(row[4]) > 1e-6])

    def test_builds_fly_the_same_draws(self):
        self.campaign(self.file(40, "firmware: [paper, tolerant]\n"), "-j", "2", "--out", "both", "--no-report", code=1)
        rows = self.rows("both")
        faults = {number: [row[1:7] for row in rows["fault"] if row[0] == number] for number in range(40)}
        for number in range(0, 40, 2):
            self.assertEqual(faults[number], faults[number + 1])
            paper, tolerant = rows["run"][number], rows["run"][number + 1]
            self.assertEqual((paper[2], tolerant[2], paper[1]), ("paper", "tolerant", tolerant[1]))

    def test_failures_are_kept_and_any_run_is_flown_again(self):
        self.campaign(self.file(30), "--out", "kept", code=1)
        rows = self.rows("kept")
        failed = next(row for row in rows["run"] if row[3] != "pass")
        folders = list((self.folder / "kept/failures").iterdir())
        self.assertTrue(folders)
        for folder in folders:
            code, out, err = self.tiltproof("run", folder / "scenario.yaml", "--out", "again", "--no-report")
            self.assertEqual(code, 1, out + err)
            [flight] = [path for path in folder.iterdir() if path.name.startswith("run-") and path.is_dir()]
            self.assertEqual(self.tiltproof("replay", flight)[0], 0)
        out, _ = self.campaign("show", "kept", failed[0], code=1)
        self.assertIn(f"the same flight as in the database: trace hash {failed[8]}", out)
        self.assertTrue((self.folder / f"kept/runs/{failed[0]}/report.html").exists())
        passed = next(row for row in rows["run"] if row[3] == "pass")
        self.campaign("show", "kept", passed[0], "--no-report", code=0)
        _, err = self.campaign("show", "kept", 30, code=2)
        self.assertIn("there is no run 30: the 30 runs count from 0", err)
        self.assertIn("RUN: Value -1 not in range", self.campaign("show", "kept", -1, code=2)[1])

    def test_what_an_interrupted_command_has_half_kept_is_flown_again(self):
        self.campaign(self.file(60), "--out", "kept", "-j", "2", code=1)
        flights = sorted(path for path in (self.folder / "kept/failures").glob("*/run-*") if path.is_dir())
        names = {path: sorted(file.name for file in path.iterdir()) for path in flights}
        pages = [path.parent / "report.html" for path in flights]
        self.assertGreater(len(flights), 2)
        # As a full disk leaves them: an error in place of a flight, a flight without its page, none.
        shutil.rmtree(flights[0])
        flights[0].mkdir()
        (flights[0] / "verdict.json").write_text((flights[1] / "verdict.json").read_text().replace('"fail"', '"error"', 1))
        pages[1].unlink()
        shutil.rmtree(flights[2])
        (self.folder / "kept/campaign.json").unlink()
        self.assertIn("its failures are not gathered yet", self.campaign("status", "kept", code=0)[0])
        self.campaign("--resume", "kept", code=1)
        self.assertEqual({path: sorted(file.name for file in path.iterdir()) for path in flights}, names)
        self.assertTrue(all(page.exists() for page in pages))
        self.assertNotIn("go on", self.campaign("status", "kept", code=0)[0])
        # The flights of a campaign are not those of another one.
        (self.folder / "kept/campaign.sqlite").unlink()
        self.assertIn("holds the failures of a campaign whose database is gone", self.campaign("night.yaml", "--out", "kept", code=2)[1])

    def test_another_client_confirms_what_was_found(self):
        client = f"library:{PROGRAM.parent}/lib/libtiltproof_firmware.so"  # the same firmware
        out, _ = self.campaign(self.file(120), "-j", "2", "--confirm", client, "--out", "sure", "--no-report", code=1)
        found = json.loads((self.folder / "sure/campaign.json").read_text())["confirmed"]
        with sqlite3.connect(self.folder / "sure/campaign.sqlite") as database:
            failures = database.execute("SELECT signature, run FROM failure ORDER BY run").fetchall()
            passes = database.execute("SELECT number FROM run WHERE verdict = 'pass' ORDER BY margin, number LIMIT 100").fetchall()
        first = {run for i, (signature, run) in enumerate(failures) if [s for s, _ in failures[:i]].count(signature) < 3}
        expected = sorted(first | {run for run, in passes})
        self.assertEqual([row["run"] for row in found[0]["rows"]], expected)
        self.assertEqual((found[0]["client"], found[0]["differ"], found[0]["same"]), (client, 0, len(expected)))
        self.assertIn(f"confirmed by {client}: {len(expected)} of {len(expected)} flights have the same verdict", out)
        # Nothing is flown twice: a row that is there stays, and its difference is told.
        number = expected[0]
        with sqlite3.connect(self.folder / "sure/campaign.sqlite") as database:
            database.execute(f"UPDATE confirmations SET time_s = 0.5, criterion = (SELECT id FROM text WHERE value = 'upright') WHERE run = {number}")
        out, _ = self.campaign("--resume", "sure", "--confirm", client, "--no-report", code=1)
        self.assertIn(f"{len(expected) - 1} of {len(expected)} flights", out)
        self.assertRegex(out, rf"run {number}: .* -> \w+ upright at 0.500 s")
        self.assertIn("knows no virtual time", self.campaign("night.yaml", "--out", "no", "--confirm", "process:true {port}", code=2)[1])
        self.assertFalse((self.folder / "no/campaign.sqlite").exists())

    def test_mistakes_say_what_to_do(self):
        def mistake(*arguments, code=2):
            return self.campaign(*arguments, code=code)[1]

        self.assertIn("name a campaign file, scenarios, or a campaign to go on with", mistake())
        self.assertRegex(mistake(self.file(10, "draft: 1\n")), r"night\.yaml:7:1: unknown key 'draft'")
        file = self.folder / self.file(10)
        text = file.read_text()
        for old, new, message in (("campaign: night\n", "", r"night\.yaml:\d+:\d+: missing key 'campaign'"),
                                  ("frame.drop]", '"wires.*"]', r"night\.yaml:6:36: types: 'wires\.\*' matches no fault type; did you mean 'wire\.\*'\?"),
                                  ("draw:\n", "draw:\n  recover_s: 10\n  start_s: {choice: [1]}\n", r"draw\.recover_s: 10 leaves no time for faults in hover, which lasts 1\.2 s")):
            self.assertEqual(text.count(old), 1)
            file.write_text(text.replace(old, new))
            self.assertRegex(mistake("night.yaml", "--out", "no"), message)
        self.assertIn("takes one campaign file, or scenarios", mistake(self.file(10), "hover.yaml"))
        self.assertIn("must be K/N", mistake("night.yaml", "--shard", "3/2"))
        self.assertIn("only with --executor slurm", mistake("night.yaml", "--task-runs", "5", "--out", "tasks"))
        self.assertIn("leave out --shard", mistake("night.yaml", "--executor", "slurm", "--shard", "1/2", "--out", "tasks"))
        self.assertIn("there is no campaign in this folder", mistake("--resume", "nowhere"))
        self.assertIn("there is no campaign in this folder", mistake("status", "nowhere"))
        self.assertIn("did you mean 'tolerant'?", mistake("night.yaml", "--firmware", "tolerent"))
        self.assertIn("--firmware: names no build", mistake("night.yaml", "--firmware", "", "--out", "none"))
        self.assertFalse((self.folder / "none").exists())
        self.campaign("night.yaml", "--out", "there", "--no-report", code=0)
        self.assertIn("there holds a campaign already: go on with it (--resume there)", mistake("night.yaml", "--out", "there"))
        self.assertIn("knows no virtual time", mistake("night.yaml", "--client", "process:true {port}"))
        code, _, err = self.tiltproof("run", "night.yaml")
        self.assertEqual(code, 2)
        self.assertIn("night.yaml:1:1: this is a campaign file, not a scenario: fly it with `tiltproof campaign`", err)
        self.scenario("hover", HOVER.replace("0.1)", "-1)"))
        self.assertIn("hover: fail without any drawn fault: near", mistake("night.yaml", "--out", "broken", code=1))
        self.assertFalse((self.folder / "broken").exists())

    def test_what_is_not_judged_is_no_survivor(self):
        """Noise on the reference line is survived in a hover, until more waits there than a line holds."""
        self.scenario("hover", HOVER.replace("1.2", "40"))
        (self.folder / "night.yaml").write_text(BABBLE)
        out, err = self.campaign("night.yaml", "-j", "2", "--out", "night", "--no-report", code=1)
        with sqlite3.connect(self.folder / "night/campaign.sqlite") as database:
            runs = dict(database.execute("SELECT verdict, count(*) FROM run GROUP BY verdict"))
            overfull = [number for (number,) in database.execute("SELECT number FROM run WHERE end = 'line_overfull' ORDER BY number")]
        self.assertEqual(sorted(runs), ["error", "fail", "pass"])
        self.assertEqual(len(overfull), runs["error"])
        self.assertIn(f"10 runs, {runs['pass']} survived ({100 * runs['pass'] / (runs['pass'] + runs['fail']):.1f} %), {runs['fail']} failed in ", out)
        self.assertIn(f", {runs['error']} not judged; night/campaign.sqlite", out)
        self.assertIn(f"not judged, because drawn faults overfill a line: run {', '.join(map(str, overfull))}", err)
        summary = json.loads((self.folder / "night/campaign.json").read_text())
        self.assertEqual((summary["passed"], summary["failed"], summary["errors"]), (runs["pass"], runs["fail"], runs["error"]))
        # Nothing else was flown: the firmware is not to blame, and nothing is known of it.
        out, _ = self.campaign("night.yaml", "--runs", "1", "--seed", "2", "--out", "unknown", "--no-report", code=4)
        self.assertIn("1 run, 0 survived (0.0 %), 0 failed in 0 ways, 1 not judged; ", out)

    def test_progress(self):
        _, text = self.at_a_terminal("campaign", self.file(60), "--out", "seen", "--no-report", streams=("stderr",))
        self.assertRegex(re.sub(r"\033\[[0-9;]*[A-Za-z]", "", text), r"\d+ of 60 runs, \d+ runs/s, \d+ failures?, \d+ signatures?")
        _, err = self.campaign("night.yaml", "--out", "silent", "--no-report", "--no-progress", code=1)
        self.assertNotIn("runs/s", err)


if __name__ == "__main__":
    os.environ.pop("NO_COLOR", None)
    unittest.main(argv=sys.argv[:1])
