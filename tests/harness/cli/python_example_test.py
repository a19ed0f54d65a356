#!/usr/bin/env python3
"""firmware/examples/python against the shipped firmware: the frames that tiltproof knows, and the commands of a whole
flight, from what its sensors said. Usage: python_example_test.py TILTPROOF SOURCE_DIR"""
import csv
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = (pathlib.Path(a).resolve() for a in sys.argv[1:3])
del sys.argv[1:3]
sys.path.insert(0, str(SOURCE / "firmware/examples/python"))
import hover  # noqa: E402

SCENARIO = """\
name: pushed
duration_s: 6
initial: {position_m: [0.3, -0.2, 2]}
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 1)"}
"""
SENSORS = "x_m y_m z_m roll_rad pitch_rad yaw_rad alpha_r_rad alpha_l_rad vx_m_s vy_m_s vz_m_s wx_rad_s wy_rad_s wz_rad_s alpha_r_rad_s alpha_l_rad_s".split()


class PythonExampleTest(unittest.TestCase):
    def test_frames_are_those_of_the_program(self):
        for numbers in ((1.0,), (3.0, 10.25, 10.25, 0.5, -0.5), (2.000000238418579, 1.0e30, -0.0078125)):
            payload = struct.pack(f"<{len(numbers)}f", *numbers)
            done = subprocess.run([PROGRAM, "frame", "encode", payload.hex()], check=True, capture_output=True, text=True)
            paper = hover.paper(hover.TILTROTOR)
            self.assertEqual(paper.framing.frame(payload + paper.check(payload)).hex(), done.stdout.strip())

    def test_its_paper_is_that_of_the_program(self):
        done = subprocess.run([PROGRAM, "protocol", "check", "paper", "--format", "json"], check=True, capture_output=True, text=True)
        described = json.loads(done.stdout)
        own = hover.paper(hover.TILTROTOR)
        shown = ("name", "role", "from", "line", "id", "reply", "payload_bytes", "starts")
        for message, expected in zip(own.description["messages"], described["messages"], strict=True):
            self.assertEqual({key: message[key] for key in shown}, {key: expected[key] for key in shown})
            for field, other in zip(message["fields"], expected["fields"], strict=True):
                self.assertEqual({**field, "min": 0, "max": 0}, {**other, "min": 0, "max": 0})

    def test_commands_are_those_of_the_shipped_firmware(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            (folder / "pushed.yaml").write_text(SCENARIO)
            subprocess.run([PROGRAM, "run", "pushed.yaml", "--no-report"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
            subprocess.run([PROGRAM, "design-lqr", "tiltrotor", "--csv", "gain.csv"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
            controller = hover.Controller(folder / "gain.csv")
            with open(folder / "results/latest/pushed/trace.csv", encoding="ascii") as file:
                rows = list(csv.DictReader(file))
        for own, paper in zip(hover.TILTROTOR["inputs"], (10.2751, 10.2799, 0.0, 0.0)):
            own["hover"] = paper
        # A row has what the server sent last, and what the firmware then answered: a period earlier than the next row.
        compared = 0
        for before, row in zip(rows, rows[1:]):
            sensors = [float(row[f"sensed_{name}"]) for name in SENSORS]
            if any(map(math.isnan, sensors)):
                continue
            wanted = controller.step(sensors, (0, 0, 2, 0, 0, 0, 0))
            for name, value in zip(("f_r_n", "f_l_n", "tau_r_nm", "tau_l_nm"), wanted):
                self.assertAlmostEqual(float(row[f"commanded_{name}"]), value, delta=2e-3, msg=f"{name} at {row['t_s']} s")
            compared += 1
        self.assertGreater(compared, 400)


if __name__ == "__main__":
    unittest.main()
