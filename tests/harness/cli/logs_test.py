#!/usr/bin/env python3
"""`run --trace` and `tiltproof export`, as a user meets them. Usage: logs_test.py TILTPROOF SOURCE_DIR

That exported MCAP files are what other programs expect is tested by their libraries: tests/harness/export/mcap."""
import csv
import json
import pathlib
import shutil
import sys
import unittest

from command_line import CommandLineTest
from report_test import LATE as FAULTS
from report_test import details

SOURCE = pathlib.Path(sys.argv[2]).resolve()

def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


class LogsTest(CommandLineTest):
    def run_both(self, *arguments):
        """The same flights with trace.csv and trace.packed. Returns both runs' folders."""
        runs = []
        for trace in ("csv", "packed"):
            out = self.folder / trace
            self.tiltproof("run", *arguments, "--trace", trace, "--out", out)
            runs.append((out / "latest").resolve())
        return runs

    # the packed trace

    def test_the_60_s_spiral_of_the_paper_takes_less_than_a_megabyte(self):
        self.run_both(SOURCE / "scenarios/paper/spiral-velocity.yaml")
        flight = "latest/paper-spiral-velocity"
        text = self.folder / "csv" / flight / "trace.csv"
        packed = self.folder / "packed" / flight / "trace.packed"
        self.assertGreater(text.stat().st_size, 4_000_000)
        self.assertLessEqual(packed.stat().st_size, 1_000_000)
        self.assertFalse((packed.parent / "trace.csv").exists())
        # To text again: the same bytes.
        code, out, err = self.tiltproof("export", packed.parent, "--to", "csv")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(pathlib.Path(out.strip()), packed.parent.resolve() / "csv")
        self.assertEqual((packed.parent / "csv/trace.csv").read_bytes(), text.read_bytes())

    def test_every_command_reads_both(self):
        text, packed = self.run_both(self.scenario("faults", FAULTS))
        hashes = [json.loads((run / "faults/verdict.json").read_text())["trace_hash"] for run in (text, packed)]
        self.assertEqual(hashes[0], hashes[1])
        self.assertEqual(json.loads((packed / "run.json").read_text())["trace"], "packed")
        code, out, err = self.tiltproof("compare", text, packed)
        self.assertEqual(code, 0, err)
        self.assertIn("IDENTICAL", out)
        code, out, err = self.tiltproof("compare", "--outcomes", text, packed)
        self.assertEqual(code, 0, err)
        for run in (text, packed):
            before = json.loads((run / "results.json").read_text())["scenarios"]
            self.assertEqual(self.tiltproof("score", run)[0], 0)
            self.assertEqual(json.loads((run / "results.json").read_text())["scenarios"], before)
            code, out, err = self.tiltproof("replay", run)
            self.assertEqual(code, 0, err)
            self.assertIn("1 of 1 equal", out)
        shown = []
        for run in (text, packed):
            page = self.folder / "page.html"
            self.assertEqual(self.tiltproof("report", run / "faults", "--out", page)[0], 0)
            shown.append(details(page, "faults"))
        self.assertEqual(shown[0]["times"]["count"], 251)
        for key in ("times", "bands", "ticks", "problems"):
            self.assertEqual(shown[0][key], shown[1][key])

    def test_flights_in_several_processes_and_repeats_pack_the_same(self):
        path = self.scenario("faults", FAULTS)
        traces = set()
        for number, arguments in enumerate((["-j", "1"], ["-j", "2"], ["--distributed=socket"])):
            out = self.folder / str(number)
            self.tiltproof("run", path, "--trace", "packed", "--out", out, *arguments)
            traces.add((out / "latest/faults/trace.packed").read_bytes())
        self.assertEqual(len(traces), 1)

    def test_a_cut_packed_trace_is_not_scored_and_its_whole_rows_are_exported(self):
        _, packed = self.run_both(self.scenario("long", duration_s="duration_s: 20 #"))
        trace = packed / "long/trace.packed"
        trace.write_bytes(trace.read_bytes()[:-1000])
        code, _, err = self.tiltproof("score", packed)
        self.assertEqual(code, 3)
        self.assertRegex(err, r"trace\.packed: byte \d+: the file was cut in a block of rows: \d+ of \d+ bytes \(1024 rows before it are whole\)")
        code, _, err = self.tiltproof("compare", packed, packed)
        self.assertEqual(code, 3, err)
        code, _, err = self.tiltproof("export", packed, "--to", "csv")
        self.assertEqual(code, 0)
        self.assertIn("1024 rows before it are whole); the export has the rows before it", err)
        self.assertEqual(len(rows_of(packed / "long/csv/trace.csv")), 1 + 1024)

    def test_two_traces_of_one_flight_are_not_chosen_from(self):
        text, packed = self.run_both(self.scenario("hover"))
        shutil.copy(packed / "hover/trace.packed", text / "hover")
        code, _, err = self.tiltproof("export", text, "--to", "csv")
        self.assertEqual(code, 3)
        self.assertIn("has both trace.csv and trace.packed", err)

    def test_without_a_trace_the_verdict_remains(self):
        code, _, err = self.tiltproof("run", self.scenario("hover"), "--trace", "none")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual([path.name for path in (self.latest() / "hover").glob("trace*")], [])
        results = (self.latest() / "results.json").read_bytes()
        code, _, err = self.tiltproof("score", self.latest())
        self.assertEqual(code, 2)
        self.assertIn("flown with --trace none", err)
        self.assertEqual((self.latest() / "results.json").read_bytes(), results)
        code, out, _ = self.tiltproof("replay", self.latest())
        self.assertEqual(code, 0, out)
        code, _, err = self.tiltproof("export", self.latest(), "--to", "mcap")
        self.assertEqual(code, 3)
        self.assertIn("no trace.csv or trace.packed in", err)
        self.assertFalse((self.latest() / "hover/flight.mcap").exists())
        self.assertEqual(self.tiltproof("run", self.scenario("hover"), "--trace", "small")[0], 2)

    # export

    def test_tables_have_what_the_files_have(self):
        self.tiltproof("run", self.scenario("faults", FAULTS))
        flight = self.latest() / "faults"
        self.assertEqual(self.tiltproof("export", self.latest(), "--to", "csv", "--out", "tables")[0], 0)
        tables = self.folder / "tables"
        self.assertEqual(sorted(path.name for path in tables.iterdir()),
                         ["events.csv", "fault_activations.csv", "frames.csv", "metrics.csv", "trace.csv"])
        self.assertEqual((tables / "trace.csv").read_bytes(), (flight / "trace.csv").read_bytes())
        verdict = json.loads((flight / "verdict.json").read_text())
        self.assertEqual({name: float(value) for name, value in rows_of(tables / "metrics.csv")[1:]}, verdict["metrics"])
        activations = [json.loads(line) for line in (flight / "faults.jsonl").read_text().splitlines()]
        self.assertEqual(rows_of(tables / "fault_activations.csv")[0], ["t_s", "fault", "type", "what"])
        self.assertEqual([(float(t), *rest) for t, *rest in rows_of(tables / "fault_activations.csv")[1:]],
                         [(a["time_s"], a["fault"], a["type"], a["what"]) for a in activations if "time_s" in a])
        events = [json.loads(line) for line in (self.latest() / "events.jsonl").read_text().splitlines()]
        self.assertEqual([(float(t), kind, text) for t, kind, _, text in rows_of(tables / "events.csv")[1:]],
                         [(e["time_s"], e["kind"], e["text"]) for e in events])
        _, dump, _ = self.tiltproof("link-dump", flight / "link.bin")
        self.assertTrue(dump)
        frames = rows_of(tables / "frames.csv")
        self.assertEqual(frames[0], ["t_s", "client", "direction", "side", "bytes"])
        self.assertEqual({frame[3] for frame in frames[1:]}, {"sent", "delivered"})
        # link.bin: 13 bytes before the bytes of each record, after 8 at its start.
        self.assertEqual(8 + sum(13 + len(frame[4]) // 2 for frame in frames[1:]), (flight / "link.bin").stat().st_size)

    def test_several_flights_go_to_a_folder_each_or_to_one_folder(self):
        self.scenario("one")
        self.scenario("two")
        self.tiltproof("run", ".")
        code, out, _ = self.tiltproof("export", self.latest(), "--to", "mcap")
        self.assertEqual(code, 0)
        self.assertEqual(out.splitlines(), [str(self.latest() / name / "flight.mcap") for name in ("one", "two")])
        self.assertEqual(self.tiltproof("export", self.latest(), "--to", "mcap", "--out", "all")[0], 0)
        self.assertEqual(sorted(path.name for path in (self.folder / "all").iterdir()), ["one.mcap", "two.mcap"])
        self.assertEqual((self.folder / "all/one.mcap").read_bytes(), (self.latest() / "one/flight.mcap").read_bytes())
        self.assertEqual(self.tiltproof("export", self.latest(), "--to", "csv", "--out", "all")[0], 0)
        self.assertTrue((self.folder / "all/two/trace.csv").exists())
        self.assertEqual(self.tiltproof("export", self.latest() / "one", "--to", "mcap", "--out", "my.mcap")[0], 0)
        self.assertEqual((self.folder / "my.mcap").read_bytes(), (self.latest() / "one/flight.mcap").read_bytes())
        code, _, err = self.tiltproof("export", self.latest(), "--to", "mcap", "--out", "my.mcap")
        self.assertEqual(code, 2)
        self.assertIn("2 flights need a folder", err)

    def test_nothing_is_written_over(self):
        self.tiltproof("run", self.scenario("hover"))
        for to, output in (("mcap", "flight.mcap"), ("csv", "csv")):
            self.assertEqual(self.tiltproof("export", self.latest(), "--to", to)[0], 0)
            before = {path: path.stat().st_mtime_ns for path in (self.latest() / "hover").rglob("*")}
            code, _, err = self.tiltproof("export", self.latest(), "--to", to)
            self.assertEqual(code, 2)
            self.assertIn(f"{output} is there already: remove it, or choose another place with --out", err)
            self.assertEqual({path: path.stat().st_mtime_ns for path in (self.latest() / "hover").rglob("*")}, before)

    def test_wrong_runs_and_formats_are_refused(self):
        code, _, err = self.tiltproof("export", self.folder, "--to", "mcap")
        self.assertEqual(code, 2)
        self.assertIn("is neither a run's results folder nor a scenario's in it", err)
        self.tiltproof("run", self.scenario("hover"), "--keep", "verdicts")
        code, _, err = self.tiltproof("export", self.latest(), "--to", "mcap")
        self.assertEqual(code, 2)
        self.assertIn("no flight of this run left a folder (--keep verdicts)", err)
        self.assertEqual(self.tiltproof("export", self.latest(), "--to", "ulog")[0], 2)
        self.assertEqual(self.tiltproof("export", self.latest())[0], 2)

    def test_damaged_files_are_named_with_the_place(self):
        self.tiltproof("run", self.scenario("hover"))
        flight = self.latest() / "hover"
        self.forget_hashes(flight)
        for file, content, said in (("trace.csv", "a,b\n1,2\n", "trace.csv: the trace has no column 't_s'"),
                                    ("trace.csv", "t_s,b\nnan,2\n", "trace.csv: the trace has no valid time in row 0"),
                                    ("faults.jsonl", '{"left_out_count": 1}\n{"time_s": 1}\n', "faults.jsonl: line 2: "),
                                    ("faults.jsonl", '{"time_s":1,"type":"a","fault":"b","what":"","before":[{"begin_s":1,"bytes":"0x"}],"after":[]}\n',
                                     "faults.jsonl: line 1: bytes that are not hexadecimal"),
                                    ("faults.jsonl", '{"time_s":1,"type":"a","fault":"b","what":"","before":[{"begin_s":1,"bytes":"7e0"}],"after":[]}\n',
                                     "faults.jsonl: line 1: bytes with 3 hexadecimal digits, not a whole number of bytes"),
                                    ("link.bin", "TPLINK2\n123", "link.bin: damaged link log: cut record header at byte 8"),
                                    ("verdict.json", "{", "verdict.json: "),
                                    ("flight.json", "[]", "flight.json: ")):
            with self.subTest(file=file, said=said):
                whole = (flight / file).read_bytes()
                (flight / file).write_text(content)
                code, out, err = self.tiltproof("export", self.latest(), "--to", "mcap")
                self.assertEqual((code, out), (3, ""))
                self.assertIn(said, err)
                self.assertFalse((flight / "flight.mcap").exists())
                (flight / file).write_bytes(whole)
        self.assertEqual(self.tiltproof("export", self.latest(), "--to", "mcap")[0], 0)

    def test_a_full_disk_is_reported(self):
        self.tiltproof("run", self.scenario("hover"))
        code, _, err = self.tiltproof("export", self.latest(), "--to", "mcap", "--out", "/dev/full")
        self.assertEqual(code, 3)
        self.assertIn("cannot write /dev/full: No space left on device", err)
        self.assertTrue(pathlib.Path("/dev/full").is_char_device())

    def test_a_device_takes_an_export(self):
        self.tiltproof("run", self.scenario("hover"))
        code, _, err = self.tiltproof("export", self.latest(), "--to", "mcap", "--out", "/dev/null")
        self.assertEqual((code, err), (0, ""))
        self.assertTrue(pathlib.Path("/dev/null").is_char_device())

    def dumped(self, link):
        """Of each line of link-dump: time, direction, side, and the number of bytes."""
        self.scenario("linked", **{"seed: 3": f"seed: 3\nlink: {link}", "position_error_m <= 0.5": "z_m > -100"})
        self.tiltproof("run", "linked.yaml")
        lines = [line.split() for line in self.tiltproof("link-dump", self.latest() / "linked/link.bin")[1].splitlines()[1:]]
        return [(float(line[0]), line[1], line[2], int(line[4])) for line in lines if float(line[0]) >= 0]

    def test_the_buffer_of_an_adapter(self):
        """A reply of 68 bytes and more: the first 62 at once, the others 2 ms after the 63rd; a request of 8 bytes 2 ms after its first."""
        records = self.dumped("{adapter: {latency_ms: 2, bytes_count: 62}}")
        byte_s = 10 / 921600
        replies = [record for record in records if record[1:3] == ("to_client", "passed_on")]
        sent = {round(record[0], 6) for record in records if record[1:3] == ("to_client", "sent")}
        self.assertGreaterEqual(len(replies), 100)
        for full, late in zip(replies[0::2], replies[1::2]):
            self.assertEqual(full[3], 62)
            self.assertGreaterEqual(late[3], 6)
            self.assertAlmostEqual(late[0] - full[0], byte_s + 0.002, delta=2e-9)
            self.assertIn(round(full[0] - 62 * byte_s, 6), sent)
        requests = [record for record in records if record[1:] == ("to_plant", "passed_on", 8) and record[0] > 0]  # `start` comes at 0
        self.assertGreater(len(requests), 40)
        asked = {round(time, 6) for time, direction, side, size in records if (direction, side, size) == ("to_plant", "delivered", 4)}
        for time, *_ in requests:
            self.assertIn(round(time - byte_s - 0.002, 6), asked)
        self.assertEqual([record for record in self.dumped("{adapter_latency_ms: 2}") if record[2] == "passed_on"], [])

    def test_the_rate_of_the_reference_line(self):
        """At 57600 baud a reference is there before the next one is due; at 9600 it is not, and they queue."""
        for baud, period_s in ((57600, 0.012), (9600, None)):
            begins = [time for time, direction, side, _ in self.dumped(f"{{reference_baud: {baud}}}") if (direction, side) == ("reference", "sent")]
            gaps = [round(after - before, 6) for before, after in zip(begins, begins[1:])]
            if period_s:
                self.assertEqual(set(gaps), {period_s})
            else:
                self.assertGreater(min(gaps), 0.03)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
