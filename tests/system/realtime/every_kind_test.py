#!/usr/bin/env python3
"""One flight in real time with a fault of each kind, each on its own node, and with each way to say when one acts. Every fault acts.
Usage: every_kind_test.py TILTPROOF PTY_FIRMWARE FIRMWARE_LIBRARY MINIMAL_LIBRARY"""
import json
import pathlib
import shutil
import sys
import tempfile
import unittest

from flight import Flight, become_subreaper, read

PROGRAM, *_ = (pathlib.Path(sys.argv.pop(1)).resolve() for _ in range(4))

# {id: (the node that it acts on, the rest of its line in the scenario)}
FAULTS = {
    "bits": ("link", "type: wire.bit_error, target: to_client, start_s: 1, end_s: 1.5, parameters: {ber: 0.001}"),
    "bytes": ("link", "type: wire.byte_drop, target: to_plant, start_s: 1.5, end_s: 2, parameters: {probability: 0.005}"),
    "frames": ("link", "type: frame.drop, target: to_client, start_s: 2, end_s: 2.5, parameters: {probability: 0.2}"),
    "silence": ("link", "type: link.silence, target: to_client, start_s: 2.6, end_s: 2.66"),
    "sensor": ("plant", "type: sensor.bias, start_s: 3, end_s: 3.5, parameters: {signal: x_m, offset: 0.05}"),
    "actuator": ("plant", "type: actuator.loss_of_effectiveness, start_s: 3.5, end_s: 4, parameters: {actuator: f_r, factor: 0.98}"),
    "push": ("plant", "type: plant.force, start_s: 4, end_s: 4.2, parameters: {force_n: 0.5, direction: [0, 1, 0]}"),
    "clock": ("client", "type: clock.drift, start_s: 1, end_s: 7, parameters: {node: client, ppm: 100}"),
    "pause": ("client", "type: node.pause, start_s: 5, end_s: 5.03, parameters: {node: client}"),
    "bus": ("base_station", "type: dds.loss, parameters: {node: base_station, probability: 0.05}"),
    # When they act. Conditions and predecessors are known in time to the plant's node alone.
    "when-high": ("plant", "type: sensor.bias, start_s: 5.5, end_s: 6.5, when: \"z_m > 1\", parameters: {signal: z_m, offset: 0.05}"),
    "aftermath": ("plant", "type: sensor.bias, end_s: 7, after: {fault: sensor, delay_s: 2.5}, parameters: {signal: y_m, offset: 0.03}"),
    "loose-plug": ("link", "type: link.disconnect, start_s: 6, end_s: 7.5, period_s: 0.5, duty: 0.06"),
}
SCENARIO = """\
name: every-kind
firmware: tolerant
duration_s: 8
reference: {type: hover, at_m: [0, 0, 2]}
faults:
FAULTS
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
  - {name: upright, stl: "always(tilt_rad <= 0.6)"}
"""


ATTEMPTS_COUNT = 3  # of a flight that the machine was too busy to judge


class EveryKindTest(unittest.TestCase):
    def fly(self):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-kinds-"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        lines = "\n".join(f"  - {{id: {fault}, {line}}}" for fault, (_, line) in FAULTS.items())
        (folder / "every-kind.yaml").write_text(SCENARIO.replace("FAULTS", lines))
        flight = Flight(PROGRAM, folder, "every-kind.yaml")
        self.addCleanup(flight.end)
        flight.wait(120)
        flight.check_results(self)
        flight.check_nothing_left(self)
        return flight

    def test_each_fault_acts(self):
        for _ in range(ATTEMPTS_COUNT):
            flight = self.fly()
            result = flight.result()
            records = [json.loads(line) for line in read(flight.run_folder / "every-kind/faults.jsonl").splitlines()]
            acted = {record["fault"]: record["type"] for record in reversed(records)}
            # Each fault that acted is of its type, in whatever a busy machine has flown.
            for fault, type_ in acted.items():
                self.assertIn(f"type: {type_},", FAULTS[fault][1])
            if result["green"]:
                self.assertEqual(acted.keys(), FAULTS.keys())
                self.check_times(records)
                return
            self.assertIn("too busy to judge", result["reason"], flight.text())
        print("not judged: this machine was too busy for every flight", file=sys.stderr)

    def check_times(self, records):
        first = {record["fault"]: record["time_s"] for record in reversed(records)}
        # A condition, a fault that follows another, and a periodic one: not before they may.
        self.assertGreaterEqual(first["when-high"], 5.5)
        self.assertAlmostEqual(first["aftermath"], first["sensor"] + 2.5, delta=0.1)
        plug = [record["time_s"] for record in records if record["fault"] == "loose-plug"]
        # The time of a frame that is cut is its begin, also when the plug comes off in the middle of it: a reply takes 0.8 ms, and 1.6 ms when
        # every byte is escaped.
        begin_s = 6 - 0.002
        self.assertTrue(all(begin_s <= time_s <= 7.6 and (time_s - begin_s) % 0.5 <= 0.1 for time_s in plug), plug)


if __name__ == "__main__":
    become_subreaper()
    unittest.main(verbosity=2)
