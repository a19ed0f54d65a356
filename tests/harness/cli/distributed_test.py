"""Lockstep with every part in a process of its own: the same hash as in one process, over DDS and over sockets.

Usage: distributed_test.py PROGRAM SOURCE_DIR
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM, SOURCE = sys.argv[1:3]

SCENARIO = """\
name: {name}
firmware: {firmware}
seed: 5
duration_s: 2
step_s: 0.004
link: {{baud: 921600, adapter_latency_ms: 1}}
reference: {{type: spiral}}
faults:
  - {{id: bits, type: wire.bit_error, target: both, start_s: 0.5, parameters: {{ber: 0.0002}}}}
  - {{id: late, type: frame.delay, target: to_plant, start_s: 0.5, parameters: {{mean_ms: 1, jitter_ms: 0.5, distribution: normal}}}}
  - {{id: skewed, type: sensor.bias, start_s: 1, parameters: {{signal: x_m, offset: 0.05}}}}
  - {{id: weak, type: actuator.loss_of_effectiveness, start_s: 1, parameters: {{actuator: f_r, factor: 0.98}}}}
  - {{id: lost, type: frame.drop, target: reference, start_s: 1, parameters: {{probability: 0.3}}}}
criteria:
  - {{name: near, stl: "always(position_error_m <= 5)"}}
"""


def children(pid):
    tasks = pathlib.Path(f"/proc/{pid}/task")
    found = []
    for task in tasks.iterdir() if tasks.exists() else []:
        try:
            for child in (task / "children").read_text().split():
                found += [int(child), *children(int(child))]
        except OSError:
            pass
    return found


def command_line(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")
    except OSError:
        return []


class Distributed(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        for firmware in ("paper", "tolerant"):
            (self.root / f"{firmware}.yaml").write_text(SCENARIO.format(name=firmware, firmware=firmware))

    def tearDown(self):
        self.folder.cleanup()

    def run_suite(self, *flags, path=None):
        out = self.root / "-".join(["out", *[f.strip("-").replace("=", "") for f in flags]])
        done = subprocess.run([PROGRAM, "run", path or self.root, "--out", out, *flags], capture_output=True, text=True,
                              timeout=120)
        self.assertIn(done.returncode, (0, 1), done.stderr + done.stdout)
        results = json.loads((out / "latest" / "results.json").read_text())
        return {s["name"]: s for s in results["scenarios"]}, out / "latest"

    def test_same_hash_in_one_process_and_in_four(self):
        together, one = self.run_suite()
        self.assertEqual(set(together), {"paper", "tolerant"})
        for flag in ("--distributed", "--distributed=socket"):
            apart, four = self.run_suite(flag)
            self.check_bus(four, over_dds=flag != "--distributed=socket")
            for name, scenario in together.items():
                self.assertEqual(apart[name]["trace_hash"], scenario["trace_hash"], (flag, name))
                self.assertEqual(apart[name]["verdict"], scenario["verdict"])
                self.assertEqual(apart[name]["faults"], scenario["faults"])
                self.assertEqual((four / name / "link.bin").read_bytes(), (one / name / "link.bin").read_bytes())

    def test_dds_may_be_named(self):
        (self.root / "tolerant.yaml").unlink()
        self.check_bus(self.run_suite("--set", "duration_s=1.2", "--distributed=dds")[1], over_dds=True)

    def check_bus(self, run, over_dds):
        """A flight over DDS says where it was, in run.json and in its first event; over sockets there is no bus."""
        events = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
        for flight in json.loads((run / "run.json").read_text())["flights"]:
            self.assertEqual("bus" in flight, over_dds)
            if not over_dds:
                continue
            bus = flight["bus"]
            first = next(event for event in events if event["scenario"] == flight["name"])
            self.assertEqual(first["kind"], "bus")
            self.assertIn(f"domain {bus['domain']}, tag {bus['tag']}, run id {bus['run_id']};", first["text"])

    def test_shipped_wire_scenarios_over_sockets(self):
        wire = pathlib.Path(SOURCE) / "scenarios/wire"
        # Their faults begin at 10 s, and one of them ends at 12.1 s. The criteria look further, but the hashes are compared here.
        flags = ("-k", "survive and not tolerant and (delay or reorder or stuck or babble or unsolicited)", "--set", "duration_s=13")
        together, _ = self.run_suite(*flags, path=wire)
        apart, _ = self.run_suite(*flags, "--distributed=socket", path=wire)
        self.assertGreater(len(together), 2)
        self.assertEqual({n: s["trace_hash"] for n, s in together.items()},
                         {n: s["trace_hash"] for n, s in apart.items()})

    def start(self, part, transport, duration_s):
        """A run, the process of this part, and its results' folder."""
        (self.root / "long.yaml").write_text(
            SCENARIO.format(name="long", firmware="tolerant").replace("duration_s: 2", f"duration_s: {duration_s}"))
        out = self.root / f"{part}-{transport}"
        run = subprocess.Popen([PROGRAM, "run", self.root / "long.yaml", "--out", out, f"--distributed={transport}"],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        end = time.monotonic() + 30
        victim = None
        while victim is None and time.monotonic() < end:
            for pid in children(run.pid):
                if command_line(pid)[1:3] == ["node", part]:
                    victim = pid
        self.assertIsNotNone(victim, f"no {part} process appeared")
        return run, victim, out

    def test_a_flight_waits_for_a_process_that_is_stopped_and_says_so(self):
        for part, transport, duration_s in (("client", "socket", 6), ("plant", "dds", 4)):
            run, stopped, _ = self.start(part, transport, duration_s)
            os.kill(stopped, signal.SIGSTOP)
            self.assertIn(f"process {stopped} is stopped", run.stderr.readline())
            os.kill(stopped, signal.SIGCONT)
            output, errors = run.communicate(timeout=60)
            self.assertEqual((run.returncode, errors), (0, ""), output)

    def killed(self, part, transport):
        run, victim, out = self.start(part, transport, 3600)
        nodes = children(run.pid)
        os.kill(victim, signal.SIGKILL)
        output, errors = run.communicate(timeout=60)
        scenario = json.loads((out / "latest" / "results.json").read_text())["scenarios"][0]
        for pid in nodes:
            self.assertNotIn("node", command_line(pid)[1:2], "a process is left")
        return scenario, run.returncode, output + errors

    def test_killed_process_is_named_and_blamed_rightly(self):
        for transport in ("dds", "socket"):
            for part in ("plant", "link"):
                scenario, code, output = self.killed(part, transport)
                self.assertEqual((scenario["verdict"], code), ("error", 3), output)
        scenario, code, output = self.killed("client", "socket")
        self.assertEqual(scenario["verdict"], "fail", output)
        self.assertEqual(code, 1)

    def test_real_time_options_are_refused(self):
        for flags, reason in ((["--distributed", "--mode", "realtime"], "lockstep"), (["--attach"], "--mode realtime"),
                              (["--client", "process:true"], "--mode realtime"),
                              (["--client", "process:true", "--distributed"], "--mode realtime")):
            done = subprocess.run([PROGRAM, "run", self.root, *flags], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 2, flags)
            self.assertIn(reason, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
