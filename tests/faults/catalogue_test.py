#!/usr/bin/env python3
"""Every registered fault type has its parts: a file and a line in the registry, an entry in docs/faults.md, tests, and two scenarios.

Usage: catalogue_test.py TILTPROOF SOURCE_DIR [--table]
The two scenarios: one that is survived and one that fails, each with its level as a fraction of the measured margin in its description.
--table prints the parts of each type as a Markdown table instead.
"""
import argparse
import pathlib
import re
import subprocess
import sys

# The suites that test one type per scenario.
SUITES = ["wire", "device", "nodes", "sensor", "actuator", "plant", "selftest"]

# Parts that a type cannot have, each with the reason. A part that is listed here must indeed be missing.
EXCEPTIONS = {
    ("node.kill", "survived"):
        "the node is gone for good: without its firmware no flight is a pass, and without another node none can be judged (expect: error)",
    ("uart.noise_error", "fails"):
        "the byte is right: at the largest probability, 1, both builds miss no period (noise-error-survive); a firmware that drops such bytes fails",
    ("wire.echo", "fails"):
        "neither build takes a request for a reply: at the largest probability, 1, both fly on (echo-survive); on a slower line it fails (scenarios/builds/echo-on-a-full-line.yaml), and one rate is all that images have",
    ("frame.length_error", "survived"):
        "it needs frames with a length in front, which no shipped firmware speaks; tests/faults/models/frame/framings_test.cpp reads them",
    ("frame.length_error", "fails"): "the same",
    ("harness.null", "fails"): "it changes nothing: it tests the harness",
    ("harness.canary", "survived"): "it cuts every thrust, and nothing flies without: it tests the harness",
}
# Flights without a verdict of their own: `tiltproof compare --outcomes` counts them.
CAMPAIGNS = "campaign"

# A description states a fraction when one sentence has a number or a fraction and says what is survived.
NUMBER = r"\d|\b(half|third|quarter|twice|times|whatever|tenths|(fif|six|seven|eigh|nin|ten|twelf|\w+teen|\w+tie|hundred)th)\b"
SURVIVED = r"\b(surviv(es?|ed)|needs|tolerates)\b"
# A fault that happens at one instant, and one that no number measures, has no margin.
NO_SEVERITY = r"\bno severity\b"


def states_fraction(description):
    return any(re.search(NO_SEVERITY, s) or (re.search(NUMBER, s) and re.search(SURVIVED, s)) for s in re.split(r"(?<=\.)\s", description))


class Scenario:
    """What the test needs of a scenario's file. The program itself reads it when the suites fly."""

    def __init__(self, path):
        self.path = path
        text = path.read_text()
        self.description = " ".join(re.search(r"^description: >-\n((?:  .*\n)+)", text, re.MULTILINE)[1].split())
        self.tags = re.search(r"^tags: \[(.*)\]", text, re.MULTILINE)[1].split(", ")
        self.types = set(re.findall(r"\btype: ([a-z]+\.[a-z_]+)", text))
        expect = re.search(r"^expect: (.*)", text, re.MULTILINE)
        firmware = re.search(r"^firmware: (\w+)", text, re.MULTILINE)
        self.verdict = expect[1] if expect else "pass"  # that it expects of the build that it flies
        if self.verdict.startswith("{"):
            of_build = dict(re.findall(r"(\w+): (\w+)", self.verdict))
            self.verdict = of_build.get(firmware[1] if firmware else "paper", "pass")

    def type(self):
        """The one that it is about: its only one, or the one that it is tagged with."""
        about = self.types if len(self.types) == 1 else self.types & set(self.tags)
        return about.pop() if len(about) == 1 else None


class Catalogue:
    def __init__(self, tiltproof, source):
        self.source = source
        self.problems = []
        printed = subprocess.run([tiltproof, "faults"], capture_output=True, text=True, check=True).stdout
        if printed != (source / "docs/faults.md").read_text():
            self.problems.append("docs/faults.md is not what `tiltproof faults` prints")
        self.entries = {entry.split("\n")[0]: entry for entry in printed.split("\n## ")[1:]}
        self.registry = re.findall(r"^  FAULT\((\w+)\)", (source / "faults/registry.cpp").read_text(), re.MULTILINE)
        self.tests = {path: path.read_text() for folder in ("faults", "plant", "harness", "emulator", "system")
                      for path in sorted((source / "tests" / folder).rglob("*_test.*"))
                      if path.suffix in (".cpp", ".py") and path.stem not in ("registry_conformance_test", "catalogue_test")}
        self.scenarios = {}
        for suite in SUITES:
            for path in sorted((source / "scenarios" / suite).glob("*.yaml")):
                scenario = Scenario(path)
                if CAMPAIGNS not in scenario.tags:
                    self.scenarios.setdefault(scenario.type(), []).append(scenario)

    def file_of(self, name):
        layer, what = name.split(".")
        path = self.source / "faults/models" / layer / f"{what}.cpp"
        function = "".join(word.capitalize() for word in (layer + "_" + what).split("_"))
        if not path.exists():
            self.problems.append(f"{name}: no file faults/models/{layer}/{what}.cpp")
        elif not re.search(rf"\bFaultType {function}\(\)", path.read_text()):
            self.problems.append(f"{name}: its file does not have {function}()")
        if self.registry.count(function) != 1:
            self.problems.append(f"{name}: not one line FAULT({function}) in faults/registry.cpp")
        return path

    def check_entry(self, name):
        entry = self.entries[name]
        paragraphs = entry.split("\n\n")[1:]
        parts = {
            "what it models": re.search(r"\bModels\s", paragraphs[0]),
            "semantics": re.search(r"\.\s+\S", paragraphs[0]),
            "parameters": "\n| parameter | unit | allowed |" in entry or "\nNo parameters.\n" in entry,
            "a severity": re.search(r"\nSeverity: (`\w+`, from \S+ \(harmless\), on an? (linear|logarithmic) scale\.|the length of the window, |none: )", entry),
            "a source": re.search(r"\nSource: \S", entry),
        }
        self.problems += [f"{name}: docs/faults.md does not give {part}" for part, found in parts.items() if not found]

    def tests_of(self, name):
        word = re.compile(rf"(?<![\w.]){re.escape(name)}(?![\w.])")
        found = [path for path, text in self.tests.items() if word.search(text)]
        if not found:
            self.problems.append(f"{name}: no test names it but the conformance test")
        # Its own test first: the one of its layer in tests/faults/models.
        return sorted(found, key=lambda path: ("models/" + name.split(".", maxsplit=1)[0] not in str(path), "faults" not in path.parts, str(path)))

    def scenarios_of(self, name, what):
        """What: survived or fails."""
        verdicts = ["pass"] if what == "survived" else ["fail", "error"]
        found = [scenario for scenario in self.scenarios.get(name, []) if scenario.verdict in verdicts]
        if (name, what) in EXCEPTIONS:
            self.problems += [f"{name}: listed as an exception ({what}), but there is {scenario.path.name}" for scenario in found]
        elif not found:
            self.problems.append(f"{name}: no scenario that {'is survived' if what == 'survived' else 'fails'}")
        if not name.startswith("harness."):
            self.problems += [f"{name}: {scenario.path.relative_to(self.source)} does not state its level as a fraction of the margin"
                              for scenario in found if not states_fraction(scenario.description)]
        return [scenario.path for scenario in found]

    def rows(self):
        for name in self.entries:
            self.check_entry(name)
            yield name, self.file_of(name), self.tests_of(name), self.scenarios_of(name, "survived"), self.scenarios_of(name, "fails")
        if len(self.registry) != len(self.entries):
            self.problems.append(f"{len(self.registry)} types are registered, {len(self.entries)} documented")
        self.problems += [f"{name}: an exception, but no type" for name, _ in EXCEPTIONS if name not in self.entries]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("tiltproof", type=pathlib.Path)
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("--table", action="store_true")
    arguments = parser.parse_args()
    catalogue = Catalogue(arguments.tiltproof.resolve(), arguments.source.resolve())
    rows = list(catalogue.rows())
    if arguments.table:
        print("| type | file | docs | tests | survived | fails |\n|---|---|---|---|---|---|")
        relative = lambda path: str(path.relative_to(catalogue.source))
        for name, path, tests, *scenarios in rows:
            cells = [", ".join(f"`{relative(p).removeprefix('scenarios/')}`" for p in paths) if paths else f"none: {EXCEPTIONS.get((name, what), 'missing')}"
                     for paths, what in zip(scenarios, ("survived", "fails"))]
            more = f" and {len(tests) - 1} more" if len(tests) > 1 else ""
            print(f"| `{name}` | `{relative(path)}` | [entry](docs/faults.md#{name.replace('.', '')}) | "
                  f"{f'`{relative(tests[0])}`{more}' if tests else 'missing'} | {' | '.join(cells)} |")
    for problem in catalogue.problems:
        print(problem, file=sys.stderr)
    sys.exit(1 if catalogue.problems else 0)


if __name__ == "__main__":
    main()
