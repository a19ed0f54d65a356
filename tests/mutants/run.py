#!/usr/bin/env python3
"""Seeds defects, one at a time, into a copy of the sources, and reports which of them the suites and tests notice.

Usage: tests/mutants/run.py [NAME...] [--group firmware|harness|client] [--sample N --seed S] [--check] [--write]
       tests/mutants/run.py [NAME...] --campaign N

Without names: all of them. --sample: N of them, drawn with --seed. --check: only that every patch applies and is described.
--write: the tables in README.md, after a run of all. --campaign: no suite, but at most N flights of a default campaign hunt each
defect of the firmware that this machine can show. Exit 0: every defect was noticed, but for those that are known not to be; 1: one was not; 2: wrong usage; 3: a
defect could not be built, or its killer fails without it.

A defect is <group>/<name>.patch beside this file: a header (see Patch), then a unified diff. It is applied to a copy in
build/mutants, which later runs use again; the tree itself is only read. The harness and the tests are those of build/release,
which is built first where something is missing.

- firmware: the firmware of the copy flies in the unchanged harness, as a library or as an image on the emulated board. It is
  noticed when a flight is not green. The library traps where it leaves an array or does what C++ does not define.
- client: the C client of firmware/examples/minimal_c, with a defect that was planted without knowledge of the suites, flies
  scenarios/acceptance. It is noticed when a flight is not green that is green without the defect.
- harness: the changed source is compiled with the release build's flags, and linked into a test program in front of the code
  that it replaces. It is noticed when a test fails.
"""
import argparse
import contextlib
import fcntl
import functools
import json
import os
import pathlib
import random
import re
import shlex
import shutil
import signal
import sqlite3
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).resolve().parent
RELEASE = ROOT / "build/release"
WORK = ROOT / "build/mutants"
COPY = WORK / "source"
SOURCES = ("CMakeLists.txt", "cmake", "link", "faults", "firmware", "plant", "harness", "tests/planted",
           "tests/emulator")  # the copy's: all that the host build and the images compile
JOBS = str(os.cpu_count() or 2)
GROUPS = ("firmware", "harness", "client")
# Not for a law that is linear around a heading of 0: with the shipped firmware itself they are not applicable.
LARGE_HEADINGS = {f"acceptance-sound-{name}" for name in ("heading-half-turn", "heading-circle", "heading-sideways", "heading-turns", "turn-left", "turn-right")}
CAMPAIGN_FLIGHTS = ("hover", "spiral-velocity")
LIBRARY_FLAGS = "-D_GLIBCXX_ASSERTIONS -fsanitize=undefined -fsanitize-undefined-trap-on-error"


class Trouble(Exception):
    """Neither noticed nor missed: a patch, a build or a killer is broken."""


class Patch:
    """The header has one `Key: text` a line, which goes on in indented lines: Defect, Why, and Killer, or in its place
    Equivalent, with the reason. A firmware's killer is the name of a scenario; a harness's a test program and a filter of its
    tests. Client: the image that flies, for what only the emulated board shows. Unnoticed: why no flight shows a client's
    defect; it counts as missed all the same."""

    def __init__(self, path):
        self.path, self.group, self.name = path, path.parent.name, path.stem
        header, separator, diff = path.read_text().partition("\n--- ")
        self.diff = separator[1:] + diff
        self.keys = {key: " ".join(text.split()) for key, text in re.findall(r"^(\w+): (.*(?:\n .*)*)", header, re.MULTILINE)}
        self.files = re.findall(r"^\+\+\+ b/(\S+)", diff, re.MULTILINE)
        missing = {"Defect", "Why"} - self.keys.keys()
        if self.group != "client" and ("Killer" in self.keys) == self.equivalent:
            missing.add("Killer or Equivalent")
        if missing or not self.files:
            raise Trouble(f"{path}: a header has Defect, Why, and Killer or Equivalent (a client's only the first two); then comes a diff")

    @property
    def equivalent(self):
        return "Equivalent" in self.keys


def call(command, cwd=ROOT, timeout_s=900):
    """Exit code and output of a command. Nothing that it started outlives this."""
    with subprocess.Popen([str(word) for word in command], cwd=cwd, text=True, errors="replace", start_new_session=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        try:
            return (lambda text: (process.wait(), text))(process.communicate(timeout=timeout_s)[0])
        except subprocess.TimeoutExpired:
            return None, f"took more than {timeout_s} s"
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def must(command, cwd=ROOT):
    code, text = call(command, cwd)
    if code != 0:
        raise Trouble(f"{shlex.join(map(str, command))}: exit code {code}\n{text[-2000:]}")
    return text


# --- The copy.

def update(files):
    """Makes files of the copy those of the tree. What is the same keeps its time, so that it is not compiled again."""
    for file in files:
        content = (ROOT / file).read_bytes()
        copied = COPY / file
        if copied.exists() and copied.read_bytes() == content:
            continue
        copied.parent.mkdir(parents=True, exist_ok=True)
        copied.write_bytes(content)


def update_all():
    files = {path.relative_to(ROOT) for folder in SOURCES for path in [ROOT / folder, *(ROOT / folder).rglob("*")] if path.is_file()}
    for copied in [path for path in COPY.rglob("*") if path.is_file() and path.relative_to(COPY) not in files]:
        copied.unlink()
    update(sorted(files))


def mutated(patch):
    """The files of a patch and their new content. The old lines of a hunk must be found once, wherever they have moved to."""
    contents = {}
    for section in re.split(r"^--- .*\n(?=\+\+\+ b/)", patch.diff, flags=re.MULTILINE)[1:]:
        file, *hunks = re.split(r"^@@ .*\n", section, flags=re.MULTILINE)
        file = file.removeprefix("+++ b/").strip()
        text = contents.get(file) or (ROOT / file).read_text()
        for hunk in hunks:
            lines = hunk.splitlines(keepends=True)
            old = "".join(line[1:] for line in lines if line[0] in " -")
            if text.count(old) != 1:
                raise Trouble(f"{patch.path}: {file} has {text.count(old)} places for\n{hunk}")
            text = text.replace(old, "".join(line[1:] for line in lines if line[0] in " +"))
        contents[file] = text
    return contents


# --- Firmware: flights. Each returns who noticed, or None.

def build_client(image=None):
    """The firmware of the copy, for --client; `image`: its name, when the emulated board is to fly."""
    launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    if image:
        folder, target, source = WORK / "board", f"{image}.elf", COPY / "firmware/ports/stm32f4"
        options = ["--toolchain", COPY / "cmake/arm-none-eabi.cmake"]
        client = f"qemu:{folder / target}"
    else:
        folder, target, source = WORK / "library", "tiltproof_firmware", COPY
        options = ["-DCMAKE_BUILD_TYPE=Release", "-DTILTPROOF_CODEC_ONLY=ON", "-DTILTPROOF_BUILD_TESTS=OFF",
                   "-DTILTPROOF_BUILD_BENCHMARKS=OFF", f"-DCMAKE_CXX_FLAGS={LIBRARY_FLAGS}"]
        client = f"library:{folder}/lib/libtiltproof_firmware.so"
    if not (folder / "build.ninja").exists():
        must(["cmake", "-S", source, "-B", folder, "-G", "Ninja", *launcher, *options])
    must(["cmake", "--build", folder, "-j", JOBS, "--target", target])
    return client


def fly(client, names, *flags, folder="scenarios"):
    """Names of the flights that are not green, of these scenarios or, without names, of all suites in the folder."""
    select = ["-k", " or ".join(names)] if names else []
    code, text = call([RELEASE / "tiltproof", "run", ROOT / folder, "--client", client, *select, *flags, "-j", JOBS,
                       "--format", "jsonl", "--keep", "verdicts", "--out", WORK / "results", "--no-progress"])
    flights = [json.loads(line) for line in text.splitlines() if line.startswith("{")]
    flown = {flight["name"]: flight for flight in flights if not names or flight["name"] in names}
    if code not in (0, 1) or not flown or any(name not in flown for name in names):
        raise Trouble(f"exit code {code}, flown {sorted(flown)} of {sorted(names)}\n{text[-2000:]}")
    return [name for name, flight in flown.items() if not flight["green"]]


def noticed_in_flight(patch):
    client = build_client(patch.keys.get("Client"))
    noticed = fly(client, [patch.keys["Killer"]]) if "Killer" in patch.keys else []
    # An image has one firmware, and the suites ask for others.
    if not noticed and "Client" not in patch.keys:
        noticed = [name for name in fly(client, []) if name not in LARGE_HEADINGS]
    return next(iter(noticed), None)


# --- Clients: the suite for firmware of others.

def build_foreign_client():
    library = WORK / "client.so"
    must(["cc", "-std=c11", "-O2", "-shared", "-fPIC", "-ffp-contract=off", "-I", COPY, "-o", library,
          COPY / "firmware/examples/minimal_c/minimal_firmware.c"])
    return f"library:{library}"


@functools.cache
def red_without_defect():
    return frozenset(fly(f"library:{RELEASE}/lib/minimal_firmware.so", [], folder="scenarios/acceptance"))


def noticed_by_acceptance(patch):
    red = [name.removeprefix("acceptance-") for name in fly(build_foreign_client(), [], folder="scenarios/acceptance") if name not in red_without_defect()]
    return ", ".join(red[:2]) + (f" and {len(red) - 2} more" if len(red) > 2 else "") if red else None


# --- Campaigns: random faults in the paper's flights. A flight that only the sound firmware passes kills a defect.

def stored(folder):
    """What a campaign has stored: by number the verdict, its criterion, and the faults that acted."""
    try:
        with contextlib.closing(sqlite3.connect(f"file:{folder}/campaign.sqlite?mode=ro", uri=True)) as database:
            return {number: (verdict, criterion, types) for number, verdict, criterion, types in database.execute(
                "SELECT number, verdict, criterion, (SELECT group_concat(type, ' + ') FROM fault WHERE run = number AND activations > 0) FROM run")}
    except sqlite3.OperationalError:  # not yet there
        return {}


def first_of(sound, rows):
    """The first run that fails only with the defect. With several jobs a later one may be stored before it."""
    for number in range(len(sound)):
        if number not in rows:
            return None
        if sound[number][0] == "pass" and rows[number][0] == "fail":
            return number
    return None


def hunt(client, runs, sound=None):
    """Flies the first runs of the campaign, or until one kills. Returns them, and the exit code if it ended by itself."""
    folder = WORK / "campaign"
    shutil.rmtree(folder, ignore_errors=True)
    command = [RELEASE / "tiltproof", "campaign", *(ROOT / f"scenarios/paper/{name}.yaml" for name in CAMPAIGN_FLIGHTS), "--runs", str(runs),
               "--firmware", "paper,tolerant", "--client", client, "-j", JOBS, "--out", folder, "--no-report", "--no-progress"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace") as process:
        try:
            while process.poll() is None and len(stored(folder)) < runs and first_of(sound or {}, stored(folder)) is None:
                time.sleep(0.2)
        finally:
            code = process.poll()
            process.send_signal(signal.SIGINT)  # the failures of a campaign that goes on would be minimised
            text = process.communicate()[0]
    if code not in (None, 0, 1):
        raise Trouble(f"{shlex.join(map(str, command))}: exit code {code}\n{text[-2000:]}")
    return stored(folder), code


def sound_runs(runs):
    sound, _ = hunt(build_client(), runs)
    if len(sound) < runs:
        raise Trouble(f"the sound firmware flew {len(sound)} of {runs} runs")
    return sound


def killed_in_campaign(sound):
    """The words of the table: how a defect was killed; None: it was not."""
    rows, code = hunt(build_client(), len(sound), sound)
    if code is not None and not rows:
        return "without a fault"
    number = first_of(sound, rows)
    if number is None:
        return None
    _, criterion, types = rows[number]
    return f"run {number}: `{criterion}`, {types or 'no fault acted'}"


# --- Harness: tests.

def link_command(program):
    """How the release build links a test program, without what it does with it afterwards; and where to."""
    linked = must(["ninja", "-C", RELEASE, "-t", "commands", program]).splitlines()[-1]
    command = next(shlex.split(part) for part in linked.split("&&") if " -o " in part)
    return command, command.index("-o") + 1


def compile_alone(file):
    """The object of the copy's `file`, compiled as the release build does, which may put several sources into one."""
    for entry in json.loads((RELEASE / "compile_commands.json").read_text()):
        unit = pathlib.Path(entry["file"])
        if unit != ROOT / file and not ("/Unity/" in str(unit) and unit.exists() and f'"{ROOT / file}"' in unit.read_text()):
            continue
        made = WORK / "object.o"
        # A precompiled header is for units with the options of the build only.
        command = shlex.split(re.sub(r" -Winvalid-pch -include \S+", "", entry["command"]))
        command[command.index("-o") + 1] = str(made)
        command[command.index("-c") + 1] = str(COPY / file)
        # Code that a defect leaves unused is no error.
        must([*(f"-I{COPY}" if word == f"-I{ROOT}" else word for word in command), "-O1", "-Wno-error"], entry["directory"])
        return made
    raise Trouble(f"build/release compiles no {file}")


def test(program, tests):
    """Names of the tests that fail."""
    code, text = call([program, f"--gtest_filter={tests}", "--gtest_brief=1"], RELEASE)
    if not re.search(r"^\[=+\] [1-9]\d* test", text, re.MULTILINE) and code in (0, 1):
        raise Trouble(f"{program} has no test {tests}\n{text[-2000:]}")
    failed = re.findall(r"^\[  FAILED  \] ([A-Za-z]\S*\.[^\s,]+)", text, re.MULTILINE)
    return failed or ([] if code == 0 else [f"{tests} (exit code {code})"])


def noticed_in_test(patch):
    if len(patch.files) != 1 or not patch.files[0].endswith(".cpp"):
        raise Trouble(f"{patch.path}: the harness is mutated in one .cpp")
    program, tests = patch.keys["Killer"].split()
    command, output = link_command(program)
    command[output] = str(WORK / program)
    # The first definition of a function counts, for calls from its old neighbours, too: position-independent code inlines none
    # that another object may replace.
    must([command[0], "-Wl,--allow-multiple-definition", compile_alone(patch.files[0]), *command[1:]], RELEASE)
    failed = test(WORK / program, tests) or test(WORK / program, "*")
    return f"{program} {failed[0]}" if failed else None


# --- A run.

def build(*targets):
    if not (RELEASE / "build.ninja").exists():
        must(["cmake", "--preset", "release"])
    must(["cmake", "--build", "--preset", "release", "-j", JOBS, "--target", "tiltproof", *targets])
    update_all()


def prepare(patches):
    """Builds what is not mutated, and requires of all killers that they are green with it."""
    programs = sorted({patch.keys["Killer"].split()[0] for patch in patches if patch.group == "harness" and not patch.equivalent})
    build("tiltproof_lockstep", "minimal_firmware", *programs)
    for patch in {patch.keys.get("Client"): patch for patch in patches if patch.group == "firmware"}.values():
        killers = sorted({other.keys["Killer"] for other in patches if other.group == "firmware" and not other.equivalent
                          and other.keys.get("Client") == patch.keys.get("Client")})
        if red := fly(build_client(patch.keys.get("Client")), killers):
            raise Trouble(f"not green without a defect: {', '.join(red)}")
    for program in programs:
        tests = ":".join(sorted({patch.keys["Killer"].split()[1] for patch in patches if patch.keys.get("Killer", "").startswith(program + " ")}))
        command, output = link_command(program)
        if failed := test(RELEASE / command[output], tests):
            raise Trouble(f"fails without a defect: {', '.join(failed)}")


def noticed_by_group(patch):
    return {"firmware": noticed_in_flight, "harness": noticed_in_test, "client": noticed_by_acceptance}[patch.group](patch)


def seed(patch, noticed_by=noticed_by_group):
    """Who noticed the defect; None: it was not noticed."""
    try:
        for file, content in mutated(patch).items():
            (COPY / file).write_text(content)
        return noticed_by(patch)
    finally:
        update(patch.files)


def check(patches):
    """That a run could begin: all patches apply, killers exist, and the tables name what there is."""
    scenarios = {match for file in ROOT.glob("scenarios/**/*.yaml") for match in re.findall(r"^name: (\S+)", file.read_text(), re.MULTILINE)}
    tables = (HERE / "README.md").read_text()
    for patch in patches:
        mutated(patch)
        problems = []
        if patch.group == "firmware" and not patch.equivalent and patch.keys["Killer"] not in scenarios:
            problems.append(f"no scenario is named {patch.keys['Killer']}")
        if f"`{patch.name}`" not in tables:
            problems.append("README.md does not have it: run.py --write")
        if problems:
            raise Trouble(f"{patch.path}: {'; '.join(problems)}")
    print(f"{len(patches)} patches apply")


def write(group, rows, seconds):
    """The group's table in README.md, between its two marks."""
    lines = ["| defect | in | what | noticed by | s |", "|---|---|---|---|---|"]
    lines += [f"| `{patch.name}` | `{pathlib.Path(patch.files[0]).name}` | {patch.keys['Defect']} | "
              f"{'equivalent: ' + patch.keys['Equivalent'] if patch.equivalent else noticed or 'not noticed: ' + patch.keys.get('Unnoticed', '?')} | {took_s:.0f} |" for patch, noticed, took_s in rows]
    counted = [noticed for patch, noticed, _ in rows if not patch.equivalent]
    lines += ["", f"{sum(map(bool, counted))} of {len(counted)} noticed, {len(rows) - len(counted)} equivalent; {seconds:.0f} s on {JOBS} cores."]
    file = HERE / "README.md"
    begin, end = f"<!-- {group}: written by run.py --write -->\n", f"<!-- end of {group} -->"
    before, _, rest = file.read_text().partition(begin)
    file.write_text(before + begin + "\n".join(lines) + "\n" + end + rest.partition(end)[2])


def run(patches):
    """Exit code, and by group the rows of its table."""
    code, rows = 0, {group: [] for group in GROUPS}
    for patch in patches:
        began = time.monotonic()
        try:
            noticed = seed(patch)
        except Trouble as trouble:
            print(f"ERROR     {patch.group}/{patch.name}: {trouble}", flush=True)
            code = 3
            continue
        took_s = time.monotonic() - began
        rows[patch.group].append((patch, noticed, took_s))
        word = "noticed" if noticed else "SURVIVED"
        if patch.equivalent:
            word = "NOTICED" if noticed else "equal"  # an equivalent that is noticed is none
        if not noticed and "Unnoticed" in patch.keys:
            word = "missed"
        if word.isupper():
            code = max(code, 1)
        print(f"{word:9} {patch.group}/{patch.name:34} {took_s:5.1f} s  {noticed or ''}", flush=True)
    return code, rows


def campaign(patches, runs):
    """Prints a table: how the first of so many runs kills each defect of the firmware that this machine can show."""
    patches = [patch for patch in patches if patch.group == "firmware" and "Client" not in patch.keys and not patch.equivalent]
    build()
    sound = sound_runs(runs)
    passed = sum(verdict == "pass" for verdict, _, _ in sound.values())
    print(f"{runs} runs; the sound firmware passes {passed}", flush=True)
    killed = 0
    for patch in patches:
        how = seed(patch, lambda _: killed_in_campaign(sound))
        killed += how is not None
        print(f"| `{patch.name}` | {how or 'not killed'} |", flush=True)
    print(f"{killed} of {len(patches)} defects killed")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--group", choices=GROUPS)
    parser.add_argument("--sample", type=int, metavar="N")
    parser.add_argument("--seed", default="1", metavar="S")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--campaign", type=int, metavar="N")
    arguments = parser.parse_args()
    for name in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(name, lambda *_: sys.exit(130))
    patches = [Patch(path) for group in GROUPS for path in sorted((HERE / group).glob("*.patch")) if arguments.group in (None, group)]
    if unknown := set(arguments.names) - {patch.name for patch in patches}:
        parser.error(f"no defect is named {', '.join(sorted(unknown))}")
    if arguments.campaign is not None and arguments.campaign < 1:
        parser.error("--campaign takes a number of flights from 1")
    if arguments.write and (arguments.names or arguments.sample):
        parser.error("--write takes all defects of a group")
    if arguments.names:
        patches = [patch for patch in patches if patch.name in arguments.names]
    if arguments.check:
        return check(patches)
    if arguments.sample:
        drawn = random.Random(arguments.seed).sample(patches, min(arguments.sample, len(patches)))
        patches = [patch for patch in patches if patch in drawn]
    WORK.mkdir(parents=True, exist_ok=True)
    with open(WORK / "lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if arguments.campaign is not None:
            return campaign(patches, arguments.campaign)
        began = time.monotonic()
        prepare(patches)
        print(f"prepared in {time.monotonic() - began:.0f} s: killers are green without a defect", flush=True)
        code, rows = run(patches)
    for group in GROUPS if arguments.write else ():
        if rows[group]:
            write(group, rows[group], sum(took_s for _, _, took_s in rows[group]))
    counted = [noticed for group in GROUPS for patch, noticed, _ in rows[group] if not patch.equivalent]
    print(f"{sum(map(bool, counted))} of {len(counted)} defects noticed, {time.monotonic() - began:.0f} s")
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Trouble as trouble:
        print(f"run.py: error: {trouble}", file=sys.stderr)
        sys.exit(3)
    except KeyboardInterrupt:
        sys.exit(130)
