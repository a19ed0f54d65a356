#!/usr/bin/env python3
"""Checks the rules that keep the house in order: who may include what, what no file may hold, and the words of pages (words.py).

Usage: check_layers.py SOURCE_DIR    exit 0 when every rule holds, else 1 and one line a violation.
"""
import pathlib
import re
import sys

sys.dont_write_bytecode = True
import words  # noqa: E402
from function_lengths import functions  # noqa: E402

# Folder (longest prefix wins) -> folders whose headers it may include. Arrows point downward only, so there are no circles.
LINK_CODEC = {"link/time.h", "link/fletcher16.h", "link/frame.h", "link/message_kind.h", "link/chunk.h"}
MAY_INCLUDE = {
    "link": ["link"],
    "plant": ["plant", "link/check.h", "link/time.h", "link/signal_table.h", "link/disturbance.h"],
    "faults": ["faults", "link"],
    "firmware": ["firmware", *sorted(LINK_CODEC)],
    # The build lqr flies on the host only.
    "firmware/lqr": ["firmware", "link"],
    "firmware/ports/host": ["firmware", "link"],
    # An example that flies on the host only, and uses the cycle of the build lqr.
    "firmware/examples/nmpc": ["firmware", "link"],
    "harness/reference": ["harness/reference", "link"],
    "harness/formula": ["harness/formula", "faults/nearest_name.h", "link/check.h", "link/time.h"],
    "harness/scenario": ["harness/scenario", "harness/reference", "faults", "link"],
    "harness/protocol": ["harness/protocol", "link"],
    "harness/integrity": ["harness/integrity", "faults", "link"],
    "harness/terminal": ["harness/terminal"],
    "harness/process": ["harness/process", "link/time.h", "link/unix_socket.h"],
    "harness/emulator": ["harness/emulator", "harness/process", "faults", "link"],
    "harness/emulator/diagnosis": ["harness/emulator", "harness/process", "faults", "link"],
    "harness/client": ["harness/client", "harness/scenario", "harness/emulator", "harness/process", "harness/terminal", "firmware/tiltproof_client.h", "firmware/tiltproof_program.h", "faults", "link"],
    "harness/client/preload": ["harness/client/preload", "firmware/tiltproof_program.h"],
    "harness/dds": ["harness/dds", "harness/terminal", "link"],
    "harness/run": ["harness/run", "harness/process", "harness/terminal", "harness/client", "harness/emulator", "harness/dds", "harness/reference", "harness/scenario", "harness/formula",
                    "plant", "faults", "link"],
    "harness/node": ["harness/node", "harness/process", "harness/terminal", "harness/run", "harness/client", "harness/emulator", "harness/dds", "harness/scenario",
                     "harness/reference", "plant", "faults", "link"],
    "harness/score": ["harness/score", "harness/run", "harness/scenario", "harness/formula", "harness/reference", "faults", "link"],
    "harness/engine": ["harness/engine", "harness/score", "harness/run", "harness/client", "harness/process", "harness/dds", "harness/scenario", "harness/terminal", "plant", "faults", "link"],
    "harness/campaign": ["harness/campaign", "harness/report", "harness/engine", "harness/score", "harness/run", "harness/client", "harness/scenario", "harness/formula", "plant", "faults", "link"],
    "harness/report": ["harness/report", "harness/engine", "harness/score", "harness/run", "harness/scenario", "faults", "link"],
    "harness/export": ["harness/export", "harness/report", "harness/engine", "harness/score", "harness/run", "harness/dds", "link"],
    "harness/live": ["harness/live", "harness/process", "harness/report", "harness/score", "harness/run", "harness/dds", "harness/scenario", "harness/reference", "link"],
    "harness/cli": ["harness", "plant", "faults", "link"],
}
# Room -> rooms in it that it may not include.
MAY_NOT_INCLUDE = {"harness/emulator": ["harness/emulator/diagnosis"]}
# External header prefix -> the only files (or folders, ending in /) that may see it.
ONLY_IN = {
    "yaml-cpp/": ["harness/scenario/yaml_tree.cpp"],
    "CLI/": ["harness/cli/"],
    "dds/": ["harness/dds/"],
    "ode/": ["plant/"],
    "sdf/": ["plant/"],
    "tinyxml2": ["plant/", "harness/report/results.cpp"],
    "Eigen/": ["plant/", "firmware/examples/nmpc/", "harness/campaign/robustness_search.h", "harness/campaign/robustness_search.cpp"],
    "boost/asio/serial_port": ["link/serial_port.cpp"],
    "boost/random": ["tests/"],
    "zstd.h": ["harness/report/zstd_bytes.cpp"],
    "sqlite3.h": ["harness/campaign/campaign_store.cpp"],
    "sleef.h": ["link/deterministic_math.c"],
    "libelf": ["harness/emulator/elf_file.h"],
    "gelf": ["harness/emulator/elf_file.h"],
    "elfutils/": ["harness/emulator/diagnosis/source_lines.cpp", "harness/emulator/diagnosis/watched_variable.cpp"],
    "dlfcn.h": ["harness/client/"],
    # The codec is one framing; all others than the firmware go through link/framing.h.
    "link/frame.h": ["link/frame.cpp", "link/hdlc_framing.cpp", "firmware/"],
    "link/crc32.h": ["link/crc32.cpp", "link/frame.cpp"],
    "link/fletcher16.h": ["link/fletcher16.cpp", "link/frame.cpp", "link/checksum.cpp", "firmware/"],
}
# Patterns that would make a replay differ, or tie the product to one machine.
FORBIDDEN = {
    r"\bstd::random_device\b": "unseeded randomness",
    r"\bs?rand\(\)": "global randomness",
    r"\bstd::(normal|uniform_\w+|bernoulli|geometric|poisson|exponential)_distribution\b": "a distribution that differs between libraries",
    r"\bsystem_clock::now\b": "the wall clock",
    r"\b(sleep_for|usleep|nanosleep)\b": "a sleep",
    r"/home/|/root/|/tmp/[a-z]": "a path of one machine",
}
# The last is a program whose waits the virtual clock holds.
MAY_HOLD = {"the wall clock": {"harness/report/files.cpp"}, "a sleep": {"tests/harness/client/preload/waiting_program.c"}}
# Output of the harness goes through harness/terminal, for texts of others may hold anything. The plug-in runs in the emulator.
PRINTS = r"\bfmt::(v?print|println)\(|\bstd::(cout|cerr|clog) ?<<|\bstd::(v?f?printf|f?puts|f?putc|putchar|fwrite|perror)\("
MAY_PRINT = {"harness/terminal/terminal.cpp", "harness/emulator/plugin/lockstep_plugin.cpp", "harness/emulator/plugin/command.h"}
# A comment starts with a noun or a verb: a reader sees first what it is about.
STARTERS = r"^\s*(//|#) (What|Whether|Of|That|Which|Why|How)\b"
COMMENTED = (".h", ".cpp", ".c", ".py", ".mjs", ".js", ".cmake", ".txt")
# A function does one thing that its name says. A file holds one module, as long as that is: a limit on files would cut
# classes at a line instead of a joint, so this one only finds files that are several.
FUNCTION_LINES_MAX = 70
FILE_LINES_MAX = 1000
# Product only: the cases of a test stand in one list.
PRODUCT = ("link/", "plant/", "faults/", "firmware/", "harness/")


def owner(path):
    return max((p for p in MAY_INCLUDE if path.startswith(p + "/")), key=len, default=None)


def allowed(folder, header):
    prefixes, inner = MAY_INCLUDE[folder], MAY_NOT_INCLUDE.get(folder, ())
    return not any(header.startswith(p + "/") for p in inner) and any(header == p or header.startswith(p + "/") for p in prefixes)


def main():
    root = pathlib.Path(sys.argv[1])
    problems = []
    files = [p for top in ("link", "plant", "faults", "firmware", "harness", "tests")
             for p in sorted((root / top).rglob("*")) if p.suffix in (".h", ".cpp", ".c")]
    if len(files) < 40:
        sys.exit(f"only {len(files)} source files below {root}: wrong folder?")
    for file in files:
        path = file.relative_to(root).as_posix()
        text = file.read_text()
        if text.count("\n") > FILE_LINES_MAX:
            problems.append(f"{path}: more than {FILE_LINES_MAX} lines: several modules in one?")
        if path.startswith(PRODUCT):
            problems += [f"{path}:{line}: {name} has {lines} lines, at most {FUNCTION_LINES_MAX}: split it into steps"
                         for name, line, lines in functions(text) if lines > FUNCTION_LINES_MAX]
        folder = owner(path)
        for number, line in enumerate(text.splitlines(), 1):
            place = f"{path}:{number}"
            include = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', line)
            if include:
                header = include.group(2)
                if include.group(1) == '"' and folder and "/" in header and not allowed(folder, header):
                    problems.append(f"{place}: {folder} may not include {header}")
                if include.group(1) == '"' and folder and "/" not in header and not path.startswith("firmware/examples/"):
                    problems.append(f"{place}: include by the path from the top folder, not {header}")
                for prefix, homes in ONLY_IN.items():
                    if header.startswith(prefix) and not path.startswith("tests/") and \
                            not any(path == h or (h.endswith("/") and path.startswith(h)) for h in homes):
                        problems.append(f"{place}: only {', '.join(homes)} may see {header}")
            for pattern, what in FORBIDDEN.items():
                if re.search(pattern, line) and path not in MAY_HOLD.get(what, ()):
                    problems.append(f"{place}: holds {what}")
            if path.startswith("harness/") and path not in MAY_PRINT and re.search(PRINTS, line):
                problems.append(f"{place}: prints by something else than Print of harness/terminal")
    for top in ("cmake", "link", "plant", "faults", "firmware", "harness", "tests"):
        for file in sorted((root / top).rglob("*")):
            if file.suffix not in COMMENTED or "node_modules" in file.parts:
                continue
            for number, line in enumerate(file.read_text().splitlines(), 1):
                if found := re.match(STARTERS, line):
                    problems.append(f"{file.relative_to(root)}:{number}: a comment starts with '{found.group(2)}'")
    problems += words.problems(root)
    print("\n".join(problems) if problems else f"{len(files)} files keep the rules")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
