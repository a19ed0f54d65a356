#!/usr/bin/env python3
"""Manual pages and completion hold what --help says, no more and no less. Usage: manual_test.py TILTPROOF"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = pathlib.Path(sys.argv.pop(1)).resolve()


def output(*command, **options):
    return subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=True, **options).stdout


def options_in_help(*command):
    text = output(PROGRAM, *command, "--help")
    return {name for line in re.findall(r"^  (-[^\s,]+(?:, -[^\s,]+)*)", text, re.MULTILINE) for name in line.split(", ")}


def section(text, title):
    return re.search(rf"^{title}:\n((?:  .*\n)+)", text, re.MULTILINE).group(1)


def commands_in_help(*command):
    text = output(PROGRAM, *command, "--help")
    return re.findall(r"^  ([a-z-]+)", section(text, "Commands"), re.MULTILINE) if "\nCommands:" in text else []


class ManualTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-manual-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder, ignore_errors=True)
        output(PROGRAM, "manual", cls.folder, "2026-11-23")
        # Every place at which options may stand: (), ("run",), ..., ("frame", "encode").
        cls.places = [()]
        for place in cls.places:
            cls.places += [(*place, name) for name in commands_in_help(*place)]

    def bash(self, *words):
        """What bash offers behind these words; the last one is not finished."""
        script = f'source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _tiltproof; printf "%s\\n" "${{COMPREPLY[@]}}"'
        return set(output("bash", "--norc", "-c", script, "bash", self.folder / "tiltproof.bash", "tiltproof", *words).split())

    def page(self, place):
        return self.folder / ("-".join(("tiltproof", *place[:1])) + ".1")

    def test_places(self):
        self.assertIn(("frame", "decode"), self.places)
        self.assertGreater(len(self.places), 18)
        self.assertEqual({page.name for page in self.folder.glob("*.1")}, {self.page(place).name for place in self.places})

    def test_help_is_narrow_and_plain(self):
        """No page is wider than 100 columns, and none has words of the library that parses: its types, its checks."""
        for place in self.places:
            text = output(PROGRAM, *place, "--help")
            self.assertEqual(text, output(PROGRAM, "help", *place))
            for line in text.splitlines():
                self.assertTrue(len(line) <= 100 or " " not in line.strip(), (place, line))
            self.assertNotRegex(text, r"\b(TEXT|INT|UINT|FLOAT|REQUIRED|SUBCOMMANDS?)\b| in \[", place)
        run = output(PROGRAM, "help", "run")
        self.assertRegex(run, r"\nUsage: tiltproof run \[OPTIONS\] PATH\.\.\.\n")
        self.assertRegex(run, r"\n  --mode lockstep\|realtime\n {24}How time passes: ")
        self.assertRegex(run, r"\n  --seed N {14}Overrides every scenario's seed \(0 - \d+\)\n")

    def test_without_a_command(self):
        alone = subprocess.run([PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        self.assertEqual((alone.returncode, alone.stdout, alone.stderr), (2, output(PROGRAM, "help"), ""))

    def test_mistakes_say_what_was_meant(self):
        for words, message in ((("help", "rnu"), "tiltproof: unknown command 'rnu'; did you mean 'run'?"),
                               (("frame", "decod"), "tiltproof frame: unknown command 'decod'; did you mean 'decode'?"),
                               (("run", "--repaet", "3", "x"), "tiltproof run: unknown option '--repaet'; did you mean '--repeat'?"),
                               (("run", "--repaet=3", "x"), "tiltproof run: unknown option '--repaet'; did you mean '--repeat'?"),
                               (("run", "--gremlin", "x"), "tiltproof run: unknown option '--gremlin'; `tiltproof run --help` says more"),
                               (("run",), "tiltproof run: PATH is required; `tiltproof run --help` says more"),
                               (("list",), "tiltproof list: PATH is required; `tiltproof list --help` says more"),
                               (("schema", "x"), "tiltproof schema: one argument too many: 'x'; `tiltproof schema --help` says more")):
            done = subprocess.run([PROGRAM, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
            self.assertEqual((done.returncode, done.stdout, done.stderr), (2, "", message + "\n"), words)

    def test_pages_have_every_option(self):
        of_page = {self.page(place): set() for place in self.places}
        for place in self.places:
            of_page[self.page(place)] |= options_in_help(*place)
        for file, expected in of_page.items():
            roff = file.read_text().replace("\\-", "-")
            tags = re.findall(r"^\.TP\n\\fB(-.*?)\\fR", roff, re.MULTILINE)
            self.assertEqual({name for tag in tags for name in tag.split(", ")}, expected, file)

    def test_pages_have_every_command(self):
        roff = self.page(()).read_text().replace("\\-", "-")
        self.assertEqual(re.findall(r"^\.BR tiltproof-(\S+) \(1\)", roff, re.MULTILINE), commands_in_help())

    def test_pages_are_well_formed(self):
        checkers = [command for command in (["mandoc", "-T", "lint", "-W", "warning"], ["groff", "-man", "-ww", "-z"]) if shutil.which(command[0])]
        if not checkers:
            self.skipTest("neither mandoc nor groff")
        for command in checkers:
            for file in sorted(self.folder.glob("*.1")):
                done = subprocess.run([*command, file], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
                self.assertEqual((done.returncode, done.stdout), (0, ""), f"{command} {file}")

    def test_bash_offers_every_option(self):
        for place in self.places:
            self.assertEqual(self.bash(*place, "-"), options_in_help(*place), place)

    def test_bash_offers_commands(self):
        self.assertEqual(self.bash(""), set(commands_in_help()))
        self.assertEqual(self.bash("co"), {"compare"})
        self.assertEqual(self.bash("frame", ""), {"encode", "decode"})

    def test_bash_offers_values(self):
        self.assertEqual(self.bash("run", "--mode", ""), {"lockstep", "realtime"})
        self.assertEqual(self.bash("run", "--mode", "=", "rea"), {"realtime"})
        self.assertEqual(self.bash("run", "--mode", "="), {"lockstep", "realtime"})
        self.assertEqual(self.bash("run", "some.yaml", "--keep", "f"), {"failing"})
        self.assertEqual(self.bash("node", "base"), {"base-station"})
        # Files are for the shell to find.
        self.assertEqual(self.bash("run", "--out", ""), set())
        self.assertEqual(self.bash("run", ""), set())

    def faults(self):
        """The headings of the catalogue."""
        names = set(re.findall(r"^#+ `?([a-z]+\.[a-z0-9_]+)`?$", output(PROGRAM, "faults"), re.MULTILINE))
        self.assertGreater(len(names), 60)
        return names

    def test_bash_offers_faults(self):
        self.assertEqual(self.bash("faults", ""), self.faults())
        self.assertEqual(self.bash("faults", "frame.d"), {name for name in self.faults() if name.startswith("frame.d")})
        self.assertIn("frame.delay", self.bash("faults", "frame.d"))

    def zsh(self, *place):
        """What zsh is told at each command on the way to this place."""
        # In place of zsh's own: says what it is told, and leads to the command that was typed.
        script = ('_arguments() { print -rl -- "$@"; state=arguments; line=($words); shift words 2>/dev/null; }; _describe() { }; _files() { }; '
                  'file=$1; shift; words=("$@"); source $file; :')
        return output("zsh", "-f", "-c", script, "zsh", self.folder / "_tiltproof", *place).split("-C\n")

    def test_zsh_offers_faults(self):
        if not shutil.which("zsh"):
            self.skipTest("no zsh")
        (offered,) = re.findall(r"^1:NAME:\((.*)\)$", self.zsh("faults")[-1], re.MULTILINE)
        self.assertEqual(set(offered.split()), self.faults())

    def test_zsh_is_told_every_option(self):
        if not shutil.which("zsh"):
            self.skipTest("no zsh")
        for place in self.places:
            told = self.zsh(*place)
            names = re.findall(r"^\*(-[a-z_-]*[a-z])[=+]?\[", told[len(place) + 1], re.MULTILINE)
            self.assertEqual(set(names), options_in_help(*place), place)

    def test_a_folder_that_cannot_be(self):
        file = self.folder / "file"
        file.write_text("")
        done = subprocess.run([PROGRAM, "manual", file, "2026-11-23"], stderr=subprocess.PIPE, text=True, check=False)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn(str(file), done.stderr)


if __name__ == "__main__":
    unittest.main()
