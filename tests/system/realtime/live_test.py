#!/usr/bin/env python3
"""The live page of a flight in real time: what a run and a monitor hear on the bus, and what the buttons do.
Usage: live_test.py TILTPROOF"""
import csv
import json
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

PROGRAM = pathlib.Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "harness"))
from flight import wait_until, write_hover
from live_viewer import DeafViewer, LiveCommand, Viewer


class LiveTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-live-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def start(self, *arguments):
        command = LiveCommand(PROGRAM, self.folder, *arguments)
        self.addCleanup(command.end)
        return command.wait_page()

    def fly(self, scenario, *more):
        return self.start("run", scenario, "--mode", "realtime", "--live", "0", *more)

    def latest(self):
        return (self.folder / "results" / "latest").resolve()

    def flight(self):
        return json.loads((self.latest() / "results.json").read_text())["scenarios"][0]

    def bus(self):
        def known():
            try:
                return json.loads((self.latest() / "run.json").read_text())["flights"][0].get("bus")
            except (OSError, ValueError):
                return None
        return wait_until(known, 60, "the flight is on the bus")

    def test_viewers_and_a_monitor_see_the_flight(self):
        run = self.fly(write_hover(self.folder, duration_s=8))
        deaf = [DeafViewer(run.port) for _ in range(2)]
        viewers = [Viewer(run.port) for _ in range(2)]
        bus = self.bus()
        monitor = self.start("node", "monitor", "--domain", bus["domain"], "--tag", bus["tag"], "--http", "0")
        viewers.append(Viewer(monitor.port))
        for button in ("start", "abort", "inject"):
            self.assertEqual(monitor.press(button)[0], 403)
        code = run.wait()
        for viewer in deaf:
            viewer.socket.close()
        flight = self.flight()
        self.assertIn(code, (0, 1, 4), run.errors)  # 1 and 4: this machine was too busy
        for viewer in viewers:
            viewer.wait_for(lambda v: v.of("finished"), "the flight ends")
            self.assertEqual(viewer.of("finished")[0]["verdict"], flight["verdict"])
            head = viewer.of("flight")[0]
            self.assertEqual(head["name"], "hover")
            rows = viewer.rows()
            times = [row[0] for row in rows]
            self.assertEqual(times, sorted(set(times)))
            # A row in 48 ms; a machine that is too busy ends the flight, and an onlooker may miss rows.
            flown_s = flight["metrics"]["survival.time_s"]
            self.assertGreater(len(rows), (flown_s - times[0]) / 0.048 * 0.5)
            self.assertGreater(times[-1], flown_s - 1)
            z = head["row"].index("z_m")
            for row in rows:
                self.assertLess(abs(row[z] - 2), 2.5)
        monitor.process.send_signal(signal.SIGINT)
        self.assertEqual(monitor.wait(30), 0, monitor.errors)
        viewers[-1].thread.join(20)
        self.assertEqual(viewers[-1].of("status")[-1]["phase"], "ended")

    def test_a_monitor_follows_a_run_from_flight_to_flight(self):
        for name in ("first", "second"):
            write_hover(self.folder, name, duration_s=6)
        missing = subprocess.run([PROGRAM, "node", "monitor", "--run", "results/latest"], cwd=self.folder, capture_output=True, text=True, check=False)
        self.assertEqual(missing.returncode, 2, missing.stderr)
        self.assertIn("--run results/latest", missing.stderr)
        run = LiveCommand(PROGRAM, self.folder, "run", "first.yaml", "second.yaml", "--mode", "realtime")
        self.addCleanup(run.end)
        wait_until((self.folder / "results/latest/run.json").exists, 60, "the run has begun")
        monitor = self.start("node", "monitor", "--http", "0", "--run", "results/latest")
        viewer = Viewer(monitor.port)
        self.assertIn(run.wait(), (0, 1, 4), run.errors)
        verdicts = {flight["name"]: flight["verdict"] for flight in json.loads((self.latest() / "results.json").read_text())["scenarios"]}
        viewer.wait_for(lambda v: len(v.of("finished")) == 2, "both flights end")
        self.assertEqual({entry["name"]: entry["verdict"] for entry in viewer.of("finished")}, verdicts)
        self.assertEqual([head["name"] for head in viewer.of("flight")], ["first", "second"])
        self.assertGreater(len(viewer.rows()), 20)
        monitor.process.send_signal(signal.SIGINT)
        self.assertEqual(monitor.wait(30), 0, monitor.errors)
        # The terminal, too: plant, events, scores of both.
        self.assertEqual(monitor.output.count("score  "), 2, monitor.output)

    def test_a_monitor_that_hears_nothing_says_where_it_listens(self):
        monitor = self.start("node", "monitor", "--domain", "78", "--tag", "mine", "--http", "0")
        text = Viewer(monitor.port).wait_for(lambda v: v.of("status"), "it waits").of("status")[0]["text"]
        for part in ("domain 78", "tag 'mine'", "--run results/latest"):
            self.assertIn(part, text)
            self.assertIn(part, wait_until(lambda: "Listening" in monitor.errors and monitor.errors, 20, "it says so"))

    def test_start_and_abort(self):
        run = self.fly(write_hover(self.folder, duration_s=60), "--live-wait")
        viewer = Viewer(run.port).wait_for(lambda v: v.of("status"), "it waits")
        self.assertEqual(viewer.of("status")[0]["phase"], "waiting")
        for token in ("", "0" * len(run.token), run.token[:-1], run.token + "0"):
            for button in ("start", "abort", "inject"):
                self.assertEqual(run.press(button, token=token)[0], 403)
        self.assertFalse(viewer.of("flight"))
        self.assertEqual(run.press("start")[0], 200)
        viewer.wait_for(lambda v: len(v.rows()) > 5, "it flies")
        self.assertEqual(run.press("abort")[0], 200)
        self.assertEqual(run.wait(60), 130, run.errors)
        self.assertLess(self.flight()["metrics"]["survival.time_s"], 50)

    def test_injects_a_fault(self):
        run = self.fly(write_hover(self.folder, duration_s=14))
        viewer = Viewer(run.port)
        refused = {
            "frame.dorp": ("{type: frame.dorp, target: to_client, duration_s: 1, parameters: {probability: 0.5}}", "frame.drop"),
            "a parameter": ("{type: frame.drop, target: to_client, duration_s: 1, parameters: {probability: 7}}", "probability"),
            "a window": ("{type: frame.drop, target: to_client, start_s: 1, parameters: {probability: 0.5}}", "duration_s"),
            "no end": ("{type: frame.drop, target: to_client, duration_s: 0, parameters: {probability: 0.5}}", "duration_s"),
            "a signal": ("{type: sensor.bias, duration_s: 1, parameters: {signal: q_m, offset: 1}}", "q_m"),
            "no fault": ("nonsense", "expected a fault"),
            "no text": ("", "the file is empty"),
            "no YAML": ("{type: [", "fault:1:"),
            "of a board": ("{type: device.reset, parameters: {boot_ms: 5}}", "device.reset cannot be injected"),
            "too long": ("{type: frame.drop, target: to_client} #" + "x" * 2000, "1023 bytes"),
        }
        viewer.wait_for(lambda v: v.rows() and v.rows()[-1][0] > 1, "it flies")
        for name, (text, says) in refused.items():
            status, answer = run.press("inject", text)
            self.assertEqual(status, 400, f"{name}: {answer}")
            self.assertIn(says, answer, name)
        self.assertEqual(run.press("inject", "{}", token="0" * 32)[0], 403)
        wanted = {"drop": "{id: drop, type: frame.drop, target: to_client, duration_s: 1, parameters: {probability: 0.2}}",
                  "injected-": "{type: sensor.bias, duration_s: 2, parameters: {signal: z_m, offset: 0.2}}"}
        begun = {}
        for text in wanted.values():
            status, answer = run.press("inject", text)
            self.assertEqual(status, 200, answer)
            fault = json.loads(answer)
            begun[fault["id"]] = fault
        status, answer = run.press("inject", wanted["drop"])
        self.assertEqual((status, "drop" in answer), (400, True), answer)  # the id is taken
        self.assertEqual(len(begun), 2)
        viewer.wait_for(lambda v: len(v.of("injected")) == 2, "the page tells")
        self.assertIn(run.wait(), (0, 1, 4), run.errors)
        flight = self.flight()
        counts = {fault["id"]: fault["activations"] for fault in flight["faults"]}
        self.assertEqual(set(counts), set(begun))
        for fault, count in counts.items():
            self.assertGreater(count, 5, fault)
        folder = self.latest() / "hover"
        # Recorded with its time, which is a control step, where it acted, and as what happened.
        resolved = (folder / "scenario.resolved.yaml").read_text()
        with open(folder / "trace.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        activations = [json.loads(line) for line in (folder / "faults.jsonl").read_text().splitlines()]
        for fault in begun.values():
            self.assertRegex(resolved, rf"(?s)id: \"{fault['id']}\".*?start_s: {fault['begin_s']:g}\b.*?end_s: {fault['end_s']:g}\b")
            periods = fault["begin_s"] / 0.012
            self.assertAlmostEqual(periods, round(periods), places=6)
            active = [float(row["t_s"]) for row in rows if float(row[f"active_{fault['id']}"]) == 1]
            self.assertAlmostEqual(active[0], fault["begin_s"], places=6)
            # A machine that is too busy ends the flight before.
            self.assertAlmostEqual(active[-1], min(fault["end_s"] - 0.012, float(rows[-1]["t_s"])), delta=0.0121)
            times = [line["time_s"] for line in activations if line["fault"] == fault["id"] and "time_s" in line]
            self.assertGreaterEqual(min(times), fault["begin_s"] - 1e-6)
            self.assertLess(max(times), fault["end_s"])
        # The bias is what the firmware was told.
        bias = next(fault for fault in begun.values() if fault["type"] == "sensor.bias")
        told = [float(row["sensed_z_m"]) - float(row["z_m"]) for row in rows if bias["begin_s"] + 0.05 < float(row["t_s"]) < bias["end_s"] - 0.05]
        self.assertGreater(sorted(told)[len(told) // 2], 0.1)
        injected = [json.loads(line) for line in (self.latest() / "events.jsonl").read_text().splitlines()]
        self.assertEqual(len([event for event in injected if event["kind"] == "fault_injected"]), 2)
        # The files give the same verdict again, and the scenario flies again with its faults.
        score = subprocess.run([PROGRAM, "score", self.latest()], capture_output=True, text=True, check=False)
        self.assertIn(flight["verdict"], (score.stdout + score.stderr).lower())
        again = subprocess.run([PROGRAM, "run", folder / "scenario.resolved.yaml", "--out", self.folder / "again"], capture_output=True, text=True, check=False)
        self.assertIn(again.returncode, (0, 1), again.stderr)
        replayed = json.loads((self.folder / "again/latest/results.json").read_text())["scenarios"][0]
        self.assertEqual({fault["id"] for fault in replayed["faults"]}, set(begun))
        for fault in replayed["faults"]:
            self.assertGreater(fault["activations"], 5)

    def test_a_fault_is_recorded_as_it_acts_when_its_node_hears_of_it_too_late(self):
        scenario = write_hover(self.folder, duration_s=6)
        scenario.write_text(scenario.read_text() + """faults:
  - {id: pause, type: node.pause, start_s: 3, end_s: 3.12, parameters: {node: link}}
""")
        run = self.fly(scenario)
        viewer = Viewer(run.port).wait_for(lambda v: v.rows() and v.rows()[-1][0] > 2.6, "it flies")
        # One after the other, so that the pause catches one on its way.
        begun = []
        while viewer.rows()[-1][0] < 3.3 and len(begun) < 100 and not viewer.of("over"):
            status, answer = run.press("inject", "{type: frame.delay, target: to_client, duration_s: 0.1, parameters: {mean_ms: 0.5}}")
            self.assertEqual(status, 200, answer)
            begun.append(json.loads(answer))
        self.assertIn(run.wait(), (0, 1, 4), run.errors)
        folder = self.latest() / "hover"
        events = [json.loads(line) for line in (self.latest() / "events.jsonl").read_text().splitlines()]
        injected = [event for event in events if event["kind"] == "fault_injected"]
        self.assertTrue([event for event in injected if "too late" in event["text"]], injected)
        resolved = (folder / "scenario.resolved.yaml").read_text()
        activations = [json.loads(line) for line in (folder / "faults.jsonl").read_text().splitlines()]
        dump = subprocess.run([PROGRAM, "link-dump", folder / "link.bin"], capture_output=True, text=True, check=True).stdout
        sent = [float(time) for time in re.findall(r"^\s*(-?[0-9.]+)\s+to_client\s+sent", dump, re.MULTILINE)]
        self.assertGreater(len(sent), 200)
        self.assertEqual([event["time_s"] for event in injected], sorted(fault["begin_s"] for fault in begun))
        for fault in begun:
            begin, end = fault["begin_s"], fault["end_s"]
            self.assertRegex(resolved, rf"(?s)id: \"{fault['id']}\".*?start_s: {begin:g}\b.*?end_s: {end:g}\b")
            # All that was sent in its window, and nothing else.
            acted = [line["time_s"] for line in activations if line["fault"] == fault["id"] and "time_s" in line]
            self.assertEqual(len(acted), len([time for time in sent if begin <= time < end]), fault)
            for time in acted:
                self.assertTrue(begin <= time < end, (time, fault))


if __name__ == "__main__":
    unittest.main()
