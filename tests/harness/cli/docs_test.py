#!/usr/bin/env python3
"""The docs say what the program does: docs/wire.md by its examples and a flight's link.bin, and what other pages show to type.

Usage: docs_test.py TILTPROOF SOURCE_DIR
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SOURCE = (pathlib.Path(a).resolve() for a in sys.argv[1:3])
PAGE = (SOURCE / "docs/wire.md").read_text()

FAULTY_FLIGHT = """\
name: faulty
duration_s: 6
reference: {type: hover, at_m: [0, 0, 2]}
faults:
  - {id: bits, type: wire.bit_error, target: both, start_s: 1, end_s: 1.1, parameters: {ber: 0.001}}
  - {id: lost, type: wire.byte_drop, target: reference, start_s: 1, end_s: 3, parameters: {probability: 0.05}}
  - {id: flags, type: wire.stuck_byte, target: reference, start_s: 2, end_s: 4, parameters: {value: 126, length_bytes: 2, rate_hz: 200}}
  - {id: escapes, type: wire.stuck_byte, target: reference, start_s: 3, end_s: 5, parameters: {value: 125, length_bytes: 4, rate_hz: 300}}
  - {id: twice, type: frame.duplicate, target: reference, start_s: 5, end_s: 5.5, parameters: {probability: 0.5}}
  - {id: gone, type: frame.drop, target: reference, start_s: 5.5, end_s: 6, parameters: {probability: 0.5}}
"""


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S)


def hex_bytes(block):
    """The bytes at the beginning of each line; a remark stands behind two blanks and more."""
    return b"".join(bytes.fromhex(re.match(r"(?:[0-9A-F]{2}(?: {1,2}|$))*", line).group()) for line in block.splitlines())


def run(*arguments, **more):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, timeout=120, check=False, **more)


class Decoder:
    """The frames in a stream of bytes, as the page describes them."""

    def __init__(self):
        self.opened, self.body = False, bytearray()

    def feed(self, content):
        for byte in content:
            if byte != 0x7E:
                self.body.append(byte)
                continue
            if self.body:
                yield self.judge()
            self.opened, self.body = True, bytearray()

    def finish(self):
        if self.body:
            yield ("aborted", self.unescaped()[0]) if self.opened else ("no_opening_flag", b"")

    def unescaped(self):
        out, escaped = bytearray(), False
        for byte in self.body:
            if escaped:
                out.append(byte ^ 0x20)
            elif byte != 0x7D:
                out.append(byte)
            escaped = not escaped and byte == 0x7D
        return bytes(out), escaped

    def judge(self):
        if not self.opened:
            return "no_opening_flag", b""
        content, escaped = self.unescaped()
        if escaped:
            return "dangling_escape", content
        if len(content) == 1:
            return "too_short", content
        payload, check = content[:-2], content[-2:]
        first = second = 0
        for byte in payload:
            first = (first + byte) % 255
            second = (second + first) % 255
        if check != bytes([first, second]):
            return "bad_checksum", payload
        return ("ok", payload) if payload else ("empty", payload)


class WireDocTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-wire-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def records(self, content):
        names = {}
        exec(blocks("python")[0], names)  # pylint: disable=exec-used
        return list(names["records"](content))

    def test_the_example_of_frames(self):
        done = run("frame", "decode", input=hex_bytes(blocks("hex")[0]))
        self.assertEqual(done.stdout.decode(), blocks("json")[0])
        frame = hex_bytes(blocks("hex")[0].splitlines()[0])
        self.assertEqual(run("frame", "encode", "7e7d01").stdout.decode().strip(), frame.hex())

    def test_the_examples_of_messages(self):
        rows = re.findall(r"^\| `(7E [0-9A-F ]+7E)` \| (.*) \|$", PAGE, re.M)
        self.assertEqual(len(rows), 5)
        for row, meaning in rows[:3]:  # the others have a CRC-32
            self.assertEqual([status for status, _ in Decoder().feed(bytes.fromhex(row))], ["ok"], meaning)

    def test_the_example_of_link_bin(self):
        file = self.folder / "link.bin"
        file.write_bytes(hex_bytes(blocks("hex")[1]))
        self.assertEqual([record[:3] for record in self.records(file.read_bytes())],
                         [(-86805, "to_plant", "sent"), (-86805, "to_plant", "delivered"), (0, "to_plant", "sent"), (0, "to_plant", "delivered")])
        done = run("link-dump", file)
        self.assertEqual((done.returncode, done.stdout.decode()), (0, blocks("text")[0]))

    def test_a_flight_read_by_the_page_alone(self):
        (self.folder / "faulty.yaml").write_text(FAULTY_FLIGHT)
        run("run", "faulty.yaml", cwd=self.folder)
        file = self.folder / "results/latest/faulty/link.bin"
        decoders, expected, last_ns = {}, [], 0
        for begin_ns, direction, side, content in self.records(file.read_bytes()):
            last_ns = begin_ns
            for status, payload in decoders.setdefault((direction, side), Decoder()).feed(content):
                expected.append((begin_ns, direction, side, status, payload.hex()))
        for direction in ("to_plant", "to_client", "reference"):
            for side in ("sent", "delivered"):
                for status, payload in decoders[direction, side].finish():
                    expected.append((last_ns, direction, side, status, payload.hex()))
        found = []
        for line in run("link-dump", file).stdout.decode().splitlines()[1:]:
            begin_s, direction, side, status, size, *rest = line.split()
            payload = rest[0] if int(size) else ""
            found.append((round(float(begin_s) * 1e9), direction, side, status, payload))
        self.assertEqual(found, expected)
        # The flight had something to find.
        self.assertLessEqual({"ok", "bad_checksum", "dangling_escape", "too_short"}, {row[3] for row in found})
        self.assertEqual(sum(row[1:4] == ("reference", "sent", "ok") for row in found), 501)


def pages():
    return [page for page in SOURCE.rglob("*.md") if "build" not in page.relative_to(SOURCE).parts]


class DocsTest(unittest.TestCase):
    def test_clients_on_real_ports_are_shown_in_real_time(self):
        for page in pages():
            text = page.read_text().replace("\\\n", " ")
            for command in re.findall(r"tiltproof run .*--client '?(?:serial|process):.*", text):
                self.assertIn("--mode realtime", command, page)

    def test_help_names_every_client(self):
        for command in ("run", "check", "list"):
            shown = run(command, "--help").stdout.decode()
            for client in ("host", "library:FILE", "qemu[:ELF]", "main=usartN", "process:CMD", "serial:DEV[,REFDEV]"):
                self.assertIn(client, shown, command)

    def test_the_page_of_faults_is_what_the_program_prints(self):
        self.assertEqual((SOURCE / "docs/faults.md").read_text(), run("faults").stdout.decode(), "tiltproof faults > docs/faults.md")

    def test_libraries_in_the_docs_are_built_by_setup(self):
        setup = (SOURCE / "setup").read_text()
        targets = re.search(r"^targets=\((.*)\)$", setup, re.M).group(1).split()
        shown = set()
        for page in pages():
            text = page.read_text()  # a page may have the command that builds a library
            shown |= {name for name in re.findall(r"build/release/lib/(\w+)\.so", text) if f"--preset release --target {name}" not in text}
        self.assertIn("minimal_firmware", shown)
        self.assertLessEqual(shown, set(targets))


class FirstFaultDocTest(unittest.TestCase):
    """docs/first-fault.md and docs/why-did-it-fail.md, typed as they stand."""

    FIRST, WHY = ((SOURCE / "docs" / name).read_text() for name in ("first-fault.md", "why-did-it-fail.md"))

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-first-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    @staticmethod
    def texts(page):
        return re.findall(r"^```text\n(.*?)^```$", page, re.M | re.S)

    def fly(self, delay_ms):
        [scenario] = re.findall(r"^```yaml\n(.*?)^```$", self.FIRST, re.M | re.S)
        self.assertIn("mean_ms: 12", scenario)
        (self.folder / "late-link.yaml").write_text(scenario.replace("mean_ms: 12", f"mean_ms: {delay_ms}"))
        return run("run", "late-link.yaml", cwd=self.folder).stdout.decode()

    def test_the_first_fault(self):
        fails, passes, margin = self.texts(self.FIRST)
        out = self.fly(12)
        self.assertIn(fails, out)
        # The README shows the same.
        readme = (SOURCE / "README.md").read_text()
        shown = re.sub(r"again: .*", "", self.texts(readme)[0])
        self.assertIn(shown.rstrip(), re.sub(r"again: .*", "", out))
        [fault] = re.findall(r"^```yaml\n(.*?)^```$", readme, re.M | re.S)
        self.assertIn(fault, self.FIRST)
        self.assertIn(passes, self.fly(6))
        self.assertIn("FAIL", self.fly(7))
        self.assertIn("\n" + margin, run("margin", "late-link.yaml", "--fault", "late", cwd=self.folder).stdout.decode())

    def test_commands_work_from_where_the_reader_is(self):
        """In the folder of late-link.yaml, one page after the other."""
        self.fly(12)
        for command in re.findall(r"^    build/release/tiltproof (.*)$", self.FIRST + self.WHY, re.M):
            done = run(*command.removesuffix(" | less").split(), cwd=self.folder)
            self.assertIn(done.returncode, (0, 1), (command, done.stderr))

    def test_why_it_failed(self):
        out = self.fly(12)
        flight = self.folder / "results/latest/late-link"
        said, activation, dump = self.texts(self.WHY)
        self.assertIn(said, out)
        self.assertIn(activation.strip(), (flight / "faults.jsonl").read_text())
        dumped = run("link-dump", flight / "link.bin").stdout.decode()
        for line in dump.splitlines():
            self.assertIn("\n" + line, dumped)
        verdict = json.loads((flight / "verdict.json").read_text())
        for key in ("outcome", "end_reason"):
            self.assertIn(f'"{key}": "{verdict[key]}"', self.WHY)
        rows = re.findall(r"^\| `([a-z._0-9]+)` \| ([0-9.]+) \|", self.WHY, re.M)
        self.assertEqual(len(rows), 5)
        for metric, value in rows:
            self.assertAlmostEqual(verdict["metrics"][metric], float(value), delta=0.006)
        columns, *trace = [line.split(",") for line in (flight / "trace.csv").read_text().splitlines()]
        shown, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in self.WHY.splitlines()
                        if re.match(r"\| (t_s|1[01]\.\d{3}) \|", line)]
        self.assertEqual(len(rows), 5)
        by_time = {round(float(row[0]), 3): row for row in trace}
        for row in rows:
            for column, value in zip(shown, row):
                digits = len(value.partition(".")[2])
                self.assertEqual(f"{float(by_time[float(row[0])][columns.index(column)]):.{digits}f}", value, (row, column))
        margin = run("design-lqr", "tiltrotor").stdout.decode()
        self.assertIn("8.99 ms", margin)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
