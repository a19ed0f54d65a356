#!/usr/bin/env python3
"""The tables of what each build survives. Usage: survival_test.py TILTPROOF SOURCE_DIR"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

PROGRAM, SOURCE = (pathlib.Path(a).resolve() for a in sys.argv[1:3])
TABLES = SOURCE / "scenarios/envelope/tables.py"


def short_flights(folder):
    """A copy of the envelopes and of what they need, with flights of 1 s in place of 20. Returns its tables.py."""
    for part in ("scenarios/envelope", "plant/models"):
        shutil.copytree(SOURCE / part, folder / part)
    for name in ("spiral", "spiral-other-vehicle"):
        file = folder / f"scenarios/envelope/{name}.yaml"
        text = file.read_text()
        for long, short in (("duration_s: 20", "duration_s: 1"), ("start_s: 10, end_s: 15", "start_s: 0.3, end_s: 0.6")):
            assert text.count(long) == 1, (file, long)
            text = text.replace(long, short)
        file.write_text(text)
    return folder / "scenarios/envelope/tables.py"


def row(fault, client, survives, fails, place=("target", "both"), **more):
    return {"type": fault, place[0]: place[1], "client": client, "parameter": "p", "survives": survives, "fails": fails, "unit": "s", "harmless": 0,
            "mildest": 0, "severest": 10, "scale": "linear", "runs": 1, "levels": [], "pockets": [], "survived_share": 0.5, "seeds": 20, **more}


class SurvivalTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-survival-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.readme = self.folder / "README.md"
        self.readme.write_text("before\n<!-- survival: scenarios/envelope/tables.py writes what is below -->\nold\n<!-- survival: end -->\nafter\n")

        self.limits = self.folder / "limits.json"
        self.limits.write_text(json.dumps([{"why": "made up", "rows": ["*"]}]))
        self.catalogue = self.folder / "faults.md"
        self.catalogue.write_text("# Faults\n")

    def tables(self, *arguments, script=TABLES):
        done = subprocess.run([sys.executable, "-B", script, "--out", self.folder, "--page", self.folder / "page.md", "--readme", self.readme,
                               "--limits", self.limits, "--catalogue", self.catalogue, *map(str, arguments)],
                              capture_output=True, text=True, timeout=240, check=False)
        return done.returncode, done.stdout + done.stderr

    def write(self, rows, other=None, part="", not_applicable=()):
        for name, own in (("spiral", rows), ("spiral-other-vehicle", other or rows)):
            file = self.folder / f"{name}{part}" / "envelope.json"
            file.parent.mkdir(exist_ok=True)
            file.write_text(json.dumps({"clients": ["paper", "tolerant"], "repeats": 5, "tolerance": 0.01, "complete": True, "rows": own,
                                        "not_applicable": [{"type": fault, "place": "", "client": "paper", "reason": why} for fault, why in not_applicable]}))

    def page_rows(self, page=None):
        """Of each row: the type with its mark, where, unit, twice (paper, tolerant, ratio, less at), why."""
        lines = (page or self.folder / "page.md").read_text().splitlines()
        return [[text.strip() for text in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines if line.startswith("| `")]

    def ratios(self):
        lines = [line.split(" | ") for line in (self.folder / "page.md").read_text().splitlines() if line.startswith("| `")]
        return {(line[0].strip("| `"), line[1]): line[5] for line in lines}

    def test_ratios_are_of_distances_from_harmless(self):
        infinite = {"harmless": 1e6, "mildest": 1e6, "severest": 0, "scale": "logarithmic"}
        self.write([row("a.linear", "paper", 2, 2.1), row("a.linear", "tolerant", 5, 5.1),
                    row("a.factor", "paper", 0.9, 0.8, harmless=1, mildest=1, severest=0), row("a.factor", "tolerant", 0.7, 0.6, harmless=1, mildest=1, severest=0),
                    row("a.never", "paper", None, 0.1), row("a.never", "tolerant", 3, 4),
                    row("a.neither", "paper", None, 0.1), row("a.neither", "tolerant", None, 0.1),
                    row("b.always", "paper", 4, 5), row("b.always", "tolerant", 10, None),
                    row("b.limit", "paper", 8, 7, **infinite), row("b.limit", "tolerant", 2, 1, **infinite),
                    row("b.bias", "paper", -1, -2, ("signal", "x_m"), side="negative"), row("b.bias", "tolerant", -1.5, -2, ("signal", "x_m"), side="negative")])
        code, out = self.tables()
        self.assertEqual(code, 0, out)
        self.assertEqual(self.ratios(), {("a.linear", "both"): "2.5", ("a.factor", "both"): "3", ("a.never", "both"): "∞", ("a.neither", "both"): "1",
                                         ("b.always", "both"): "2.5", ("b.limit", "both"): "4", ("b.bias", "x_m-"): "1.5"})
        self.assertIn("5 of 7 types survived at least twice as severely; by layer: a 3 of 4, b 2 of 3", out)
        text = self.readme.read_text()
        self.assertRegex(text, r"(?s)^before\n<!-- survival: .*\n\| a \| 4 \| 4 \| 3 of 4 \| 3 of 4 \|\n.*<!-- survival: end -->\nafter\n$")
        self.assertNotIn("old", text)
        self.tables()
        self.assertEqual(self.readme.read_text(), text, "again is the same")

    def test_worse_is_told(self):
        better = [row("a.x", "paper", 1, 1.1), row("a.x", "tolerant", 0.995, 1.1)]
        worse = [row("a.x", "paper", 1, 1.1), row("a.x", "tolerant", 0.97, 1.0)]
        self.write(better)
        self.assertEqual(self.tables()[0], 0)
        self.write(better, worse)
        code, out = self.tables()
        self.assertEqual(code, 1)
        self.assertIn("worse: a.x both: 1 (50 %) and 0.97 (50 %), 0.97 times as far", out)
        for file in (self.readme, self.folder / "page.md"):
            self.assertIn("Known vehicle, no noise: none.", " ".join(file.read_text().split()))
            self.assertIn("\n| a |  | `a.x both` |\n", file.read_text())

    def test_pockets_and_what_is_exact(self):
        """Both directions of a severity; a level that only the first one survives is named, also beyond the limit of the second."""
        survived, failed = (lambda *levels: [[level, True] for level in levels]), (lambda *levels: [[level, False] for level in levels])
        self.write([row("a.up", "paper", 1, 2, levels=survived(0, 1) + failed(2, 3) + survived(6, 7), pockets=[[2, 3]], seeds=1),
                    row("a.up", "tolerant", 3, 4, levels=survived(0, 3) + failed(4, 6.5, 8), seeds=1),
                    row("a.down", "paper", -1, -2, levels=survived(0, -1) + failed(-2), severest=-10),
                    row("a.down", "tolerant", -3, -4, levels=survived(0, -3) + failed(-4), severest=-10),
                    row("a.everything", "paper", 10, None), row("a.everything", "tolerant", 10, None, seeds=1)])
        code, out = self.tables()
        self.assertEqual(code, 1)
        self.assertIn("worse: a.up both: at 6 to 7", out)
        self.assertEqual([line[3:7] for line in self.page_rows()], [["1\\*° (50 %)", "3° (50 %)", "3", "6 to 7"], ["-1 (50 %)", "-3 (50 %)", "3", ""],
                                                                    ["all", "all°", "1", ""]])

    def test_a_row_that_could_be_better_needs_a_reason(self):
        same = [row("a.x", "paper", 1, 1.1), row("a.x", "tolerant", 1, 1.1)]
        twice = [row("a.x", "paper", 1, 1.1), row("a.x", "tolerant", 2, 2.1)]
        everything = [row("a.x", "paper", 8, 9), row("a.x", "tolerant", 10, None)]
        self.limits.write_text(json.dumps([{"why": "physics", "rows": ["a.y *"]}]))
        for exact, other, code in ((same, same, 1), (twice, same, 1), (same, twice, 1), (twice, twice, 0), (everything, everything, 0), (everything, same, 1)):
            (self.folder / "page.md").unlink(missing_ok=True)
            self.write(exact, other)
            found, out = self.tables()
            self.assertEqual((found, "no reason in limits.json: a.x both" in out), (code, code == 1), out)
            self.assertIn("no row needs the reason of: a.y *", out)
        self.limits.write_text(json.dumps([{"why": "physics", "rows": ["b.*", "a.[xy] both"]}, {"why": "too late", "rows": ["a.*"]}]))
        self.assertEqual(self.tables()[0], 0)
        self.assertEqual(self.page_rows()[0][-1], "physics")
        self.write(twice)
        self.assertEqual(self.tables()[0], 0)
        self.assertEqual(self.page_rows()[0][-1], "", "there is nothing to explain")

    def test_the_page_has_every_type(self):
        self.catalogue.write_text("# Faults\n\n## a.x\n\n## a.wind\n\n## b.chip\n\n## b.node\n\n## b.forgotten\n\n## Not a type\n")
        self.write([row("a.x", "paper", 1, 1.1), row("a.x", "tolerant", 3, 3.1)],
                   not_applicable=[("b.node", "needs nodes"), ("b.chip", "needs a board"), ("a.wind", "needs drag")])
        self.write([row("a.wind", "paper", 1, 1.1), row("a.wind", "tolerant", 3, 3.1)], part="-drag", not_applicable=[("b.chip", "needs a board")])
        self.write([row("b.byte", "paper", 1, 1.1), row("b.byte", "tolerant", 3, 3.1)], part="-board", not_applicable=[("b.chip", "no number")])
        code, out = self.tables()
        self.assertEqual(code, 1)
        self.assertEqual(re.findall("not on the page: (.*)", out), ["b.forgotten"])
        self.assertEqual([[line[0], *line[3:6], line[-1]] for line in self.page_rows()],
                         [["`a.x`", "1 (50 %)", "3 (50 %)", "3", ""], ["`a.wind`‡", "1 (50 %)", "3 (50 %)", "3", ""], ["`b.chip`", "n/a", "n/a", "-", "no number"],
                          ["`b.node`", "n/a", "n/a", "-", "needs nodes"], ["`b.byte`†", "1 (50 %)", "3 (50 %)", "3", ""]])
        self.assertIn("| b | 3 | 1 | 1 of 1 | 1 of 1 |", self.readme.read_text())

    def test_what_is_not_flown_anew_stays(self):
        other = [row("a.z", "paper", 1, 1.1, ("signal", "x_m"), side="negative"), row("a.z", "tolerant", None, 1.1, ("signal", "x_m"), side="negative")]
        self.write([row("a.x", "paper", 1, 1.1), row("a.x", "tolerant", 3, 3.1), *other], not_applicable=[("b.node", "needs nodes")])
        self.assertEqual(self.tables()[0], 1, "a.z is worse")
        before = self.page_rows()
        shutil.rmtree(self.folder / "spiral-other-vehicle")
        self.write([row("a.x", "paper", 1, 1.1), row("a.x", "tolerant", 4, 4.1)])
        shutil.rmtree(self.folder / "spiral-other-vehicle")
        code, out = self.tables()
        self.assertEqual(code, 1)
        self.assertIn("worse: a.z x_m-: 1 (50 %) and none, 0 times as far", out)
        after = self.page_rows()
        self.assertEqual(after[1:], before[1:])
        self.assertEqual(after[0][3:10], ["1 (50 %)", "4 (50 %)", "4", "", "1 (50 %)", "3 (50 %)", "3"], "the half that was not flown stays, too")

    def test_levels_without_a_scan_are_marked_by_half(self):
        page = self.folder / "page.md"
        self.write([row("a.x", "paper", 1, 1.1), row("a.x", "tolerant", 3, 3.1)])
        self.tables()
        self.assertNotIn("§", page.read_text())
        page.write_text(page.read_text().replace("| 1 (50 %) | 3 (50 %) | 3 |", "| 1§ | all§ | 5 |"))
        shutil.rmtree(self.folder / "spiral-other-vehicle")
        self.assertEqual(self.tables()[0], 0)
        self.assertEqual(self.page_rows()[0][3:10], ["1 (50 %)", "3 (50 %)", "3", "", "1§", "all§", "5"])
        self.assertIn("§: found by bisection", page.read_text())
        self.assertIn("| a | 1 | 1 | 1 of 1 | - |", self.readme.read_text(), "they do not count")

    def test_the_shipped_page(self):
        rows = self.page_rows(SOURCE / "docs/survival.md")
        known = re.findall(r"(?m)^## ([a-z_.]+)$", subprocess.run([PROGRAM, "faults"], capture_output=True, text=True, check=True).stdout)
        self.assertEqual(list(dict.fromkeys(line[0].split("`")[1] for line in rows)), known)
        for line in rows:
            for tolerant, value in (line[4:6], line[8:10]):
                if tolerant == "-":
                    continue  # the page says that this half was not flown
                if value == "-" or (float(value.replace("∞", "inf")) < 2 and not tolerant.startswith("all")):
                    self.assertNotEqual(line[-1], "", line)

        # The short table counts types that were scanned.
        table = re.findall(r"(?m)^\| (\w+) \| \d+ \| \d+ \| (\S.*) \| (\S.*) \|$", (SOURCE / "docs/survival.md").read_text())
        self.assertGreater(len(table), 10)
        for layer, *counts in table:
            for count, at in zip(counts, (3, 7)):
                scanned = {line[0] for line in rows if line[0].startswith(f"`{layer}.") and line[at + 2] != "-" and "§" not in line[at] + line[at + 1]}
                self.assertEqual(0 if count == "-" else int(count.split()[-1]), len(scanned), layer)

    def test_the_vehicle_with_drag_is_the_same_but_for_its_drag(self):
        # The envelope of the winds: one line more in the vehicle, one more or another one in the scenario.
        script = short_flights(self.folder / "short")
        self.tables("--fly", PROGRAM, "-j", "2", "--types", "plant.gust,plant.mass", "--repeats", "1", "--tolerance", "0.5", script=script)
        self.assertEqual(sorted(line[0] for line in self.page_rows()), ["`plant.gust`‡", "`plant.mass`", "`plant.mass`"])
        for name, model in (("spiral", "plant/models/tiltrotor.sdf"), ("spiral-other-vehicle", "scenarios/envelope/other-vehicle.sdf")):
            folder = self.folder / f"{name}-drag"
            lines = (SOURCE / model).read_text().splitlines()
            [(index, more)] = [(i, line) for i, line in enumerate((folder / "vehicle.sdf").read_text().splitlines()) if line not in lines]
            self.assertIn("<tiltproof:drag ", more)
            drag = (folder / "vehicle.sdf").read_text().splitlines()
            self.assertEqual(drag[:index] + drag[index + 1:], lines)
            self.assertIn(more.strip(), (SOURCE / "plant/models/tiltrotor_drag.sdf").read_text())
            scenario = (script.parent / f"{name}.yaml").read_text().splitlines()
            changed = [line for line in (folder / f"{name}-drag.yaml").read_text().splitlines() if line not in scenario]
            self.assertEqual(changed, [f"name: envelope-{name}-drag", "model: vehicle.sdf"])

    def test_one_command_flies_and_writes_and_goes_on(self):
        script = short_flights(self.folder / "short")
        arguments = ("--fly", PROGRAM, "-j", "2", "--types", "actuator.loss_of_effectiveness", "--repeats", "1", "--tolerance", "0.5")
        code, out = self.tables(*arguments, script=script)
        self.assertIn(code, (0, 1), out)
        self.assertEqual([place for _, place in self.ratios()], ["f_r", "tau_r"])
        for name in ("spiral", "spiral-other-vehicle"):
            self.assertTrue(json.loads((self.folder / name / "envelope.json").read_text())["complete"])
        page = (self.folder / "page.md").read_text()
        self.assertEqual(set(re.findall(r"(\d+) flights?, in ", self.tables(*arguments, script=script)[1])), {"0"}, "all rows are there")
        self.assertEqual((self.folder / "page.md").read_text(), page)

    def test_random_levels_below_the_limits(self):
        script = short_flights(self.folder / "short")
        self.tables("--fly", PROGRAM, "-j", "2", "--types", "actuator.loss_of_effectiveness", "--repeats", "1", "--tolerance", "0.1", script=script)
        file = self.folder / "spiral/envelope.json"

        def spot_check():
            done = subprocess.run([sys.executable, "-B", script.parent / "spot_check.py", PROGRAM, script.parent / "spiral.yaml", file, "--rows", "4", "-j", "2"],
                                  capture_output=True, text=True, timeout=240, check=False)
            return done.returncode, done.stdout + done.stderr

        code, out = spot_check()
        self.assertEqual((code, "0 of 4 rows fail below their limit, in 40 flights" in out), (0, True), out)
        envelope = json.loads(file.read_text())
        envelope["rows"] = [{**row, "survives": row["severest"], "fails": None} for row in envelope["rows"] if row.get("actuator") == "f_r"]
        file.write_text(json.dumps(envelope))
        code, out = spot_check()
        self.assertEqual((code, "2 of 2 rows fail below their limit" in out), (1, True), out)

    def test_further_seeds_find_where_the_second_firmware_is_worse(self):
        # With noise on z_m of 1 km `paper` is lost and `tolerant` is not, so as the second one it is worse there only.
        script = short_flights(self.folder / "short")
        file = self.folder / "spiral/envelope.json"
        further = file.with_name("further.json")

        def fly(first, second):
            rows = [row("sensor.noise", client, 1000, None, ("signal", "z_m"), parameter="std", severest=1000, levels=[[0.001, True], [1000, True]])
                    for client in (first, second)]
            self.write([*rows, *({**one, "signal": "x_m", "seeds": 1} for one in rows)])
            file.write_text(json.dumps({**json.loads(file.read_text()), "clients": [first, second]}))
            done = subprocess.run([sys.executable, "-B", script.parent / "further_seeds.py", PROGRAM, script.parent / "spiral.yaml", file, "-j", "2"],
                                  capture_output=True, text=True, timeout=240, check=False)
            return done.returncode, done.stdout + done.stderr

        code, out = fly("paper", "tolerant")
        self.assertEqual((code, out), (0, "0 of 1 rows have a level that paper survives and tolerant does not\n"))
        further.unlink()
        code, out = fly("tolerant", "paper")
        self.assertEqual(code, 1, out)
        self.assertRegex(out, r"^sensor\.noise z_m: tolerant survives, and paper fails \d+ at 1000\n1 of 1 rows")
        self.assertEqual(json.loads(further.read_text())["rows"], {"sensor.noise z_m": {"less_at": [1000]}})

        # Rows that have been flown do not fly again; the page has them.
        further.write_text(further.read_text().replace("1000", "0.001"))
        code, out = fly("paper", "tolerant")
        self.assertEqual((code, out), (1, "1 of 1 rows have a level that paper survives and tolerant does not\n"))
        shutil.rmtree(self.folder / "spiral-other-vehicle")
        code, out = self.tables()
        self.assertEqual(code, 1, out)
        self.assertIn("worse: sensor.noise z_m: at 0.001", out)
        self.assertEqual([line[6] for line in self.page_rows() if line[1] == "z_m"], ["0.001"])

    def test_each_type_is_written_before_the_next_one_flies(self):
        script = short_flights(self.folder / "short")
        page = self.folder / "page.md"
        # Writes the calls and the rows on the page at that time, and ends in the second type.
        program = self.folder / "program.py"
        program.write_text(f"""#!{sys.executable}
import pathlib, re, subprocess, sys
if sys.argv[1] == "envelope":
    page = pathlib.Path({str(page)!r})
    rows = re.findall("(?m)^. `([a-z_.]+)`", page.read_text()) if page.exists() else []
    types = sys.argv[sys.argv.index("--types") + 1]
    print("CALL", pathlib.Path(sys.argv[2]).stem, types, *rows, flush=True)
    if types == "plant.mass":
        sys.exit(130)
sys.exit(subprocess.run([{str(PROGRAM)!r}, *sys.argv[1:]]).returncode)
""")
        program.chmod(0o755)
        arguments = ("-j", "2", "--types", "plant.mass,actuator.loss_*", "--repeats", "1", "--tolerance", "0.5")
        code, out = self.tables("--fly", program, *arguments, script=script)
        self.assertEqual(code, 130, out)
        row = "actuator.loss_of_effectiveness"
        self.assertEqual(re.findall("(?m)^CALL (.*)", out), [f"spiral {row}", f"spiral-other-vehicle {row}", f"spiral plant.mass {row} {row}"])
        self.assertEqual({line[0] for line in self.page_rows()}, {f"`{row}`"})
        code, out = self.tables("--fly", PROGRAM, *arguments, script=script)
        self.assertIn(code, (0, 1), out)
        self.assertEqual({line[0] for line in self.page_rows()}, {f"`{row}`", "`plant.mass`"})
        for name in ("spiral", "spiral-other-vehicle"):
            self.assertTrue(json.loads((self.folder / name / "envelope.json").read_text())["complete"])

    def test_the_other_vehicle_is_the_shipped_one_but_for_what_it_says(self):
        def numbers(file):
            """Every number, by where it stands: its element with that one's place, or its attribute."""
            found = {}

            def walk(element, path):
                for index, child in enumerate(element):
                    walk(child, f"{path}/{child.tag.rpartition('}')[2]}{index}")
                for key, value in [("", element.text or ""), *element.attrib.items()]:
                    for i, number in enumerate(re.findall(r"(?<![\w.])-?\d[\d.e-]*", value)):
                        found[f"{path}@{key}{i}"] = float(number)

            walk(xml.etree.ElementTree.parse(file).getroot(), "")
            return found

        shipped, other = numbers(SOURCE / "plant/models/tiltrotor.sdf"), numbers(SOURCE / "scenarios/envelope/other-vehicle.sdf")
        self.assertEqual(shipped.keys(), other.keys())
        changed = 0
        for path, value in shipped.items():
            factor = 1.02 if "/mass" in path else 1.1 if re.search(r"/i[xyz]{2}\d", path) else 1.2 if "drag_ratio_m" in path else 1.0
            self.assertAlmostEqual(other[path], value * factor, delta=1e-9 * abs(value), msg=path)
            changed += factor != 1
        self.assertEqual(changed, 3 + 18 + 2)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
