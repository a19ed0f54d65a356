#!/usr/bin/env python3
"""Compiles the examples in the comments of headers.

Usage: header_examples.py SOURCE_DIR BUILD_DIR    exit 0 when every example compiles, else 1 and the errors, each at
the line of the header.

What counts as an example: comment lines indented by two or more spaces after `//`, of which at least one ends, before
a remark of its own, in `;`, `{`, `}` or `) ...`. Other indented lines are tables, formulas, commands or output. All
examples of a header are one function, in the header's namespace; a function that an example defines stands before it.
`...` stands for what an example leaves out: statements, elements of a list, a value, alternatives of a std::visit.

What an example assumes and does not declare is in example_context.h and example_context_harness.h. The flags are those of a source in the header's
folder, from BUILD_DIR/compile_commands.json. The sources that are compiled remain in BUILD_DIR/header_examples.
"""
import json
import pathlib
import re
import shlex
import subprocess
import sys

# Folders: the examples of each are compiled at once.
FOLDERS = ("link", "plant", "faults", "firmware", "harness/node", "harness/run", "harness")
HEADERS_MIN = 90  # with an example: fewer means that this script no longer finds them
INDENTED = re.compile(r"\s*//( {2,}\S.*)")
# A string, a character, a remark: nothing in them is code.
NOT_CODE = re.compile(r'"(?:\\.|[^"\\])*"|(?<!\w)\'(?:\\.|[^\'\\])\'|//.*')
# The first line of a function that an example defines.
DEFINES = re.compile(r"(template <.*|(?!(if|for|while|else|do|return)\b)[\w:<>,&* ]+ \w+\([^;]*\) \{.*)(?<=[{}])$")


def without_texts(line):
    """The line with blanks instead of its texts and its remark."""
    return NOT_CODE.sub(lambda m: m.group()[0] + " " * (len(m.group()) - 2) + m.group()[-1]
                        if m.group()[0] in "\"'" else " " * len(m.group()), line)


def is_code(block):
    return any(re.search(r"([;{}]|\) \.\.\.)$", without_texts(text).rstrip()) for _, text in block)


def blocks(lines):
    """Runs of indented comment lines, each line with its number."""
    block = []
    for number, line in enumerate([*lines, ""], 1):
        indented = INDENTED.match(line)
        if indented:
            block.append((number, indented.group(1)))
        elif block:
            yield block
            block = []


def filled_in(code):
    """The code with something that compiles for each `...`."""
    while True:
        bare = "\n".join(without_texts(line) for line in code.split("\n"))
        found = re.search(r"(?<![\w.])\.\.\.", bare)
        if not found:
            return code
        begin, end = found.span()
        before, after = bare[:begin].rstrip(), bare[end:].lstrip()
        # The bracket that it is in.
        opener, depth = None, 0
        for place in range(begin - 1, -1, -1):
            if bare[place] in ")}]":
                depth += 1
            elif bare[place] in "({[":
                if depth == 0:
                    opener = place
                    break
                depth -= 1
        in_visit = opener is not None and bare[:opener].endswith("Overloaded")
        if in_visit:
            new = "tiltproof::examples::OtherAlternatives{}"
        elif before.endswith("="):
            new = "{}"
        elif before.endswith(","):
            begin, new = len(before) - 1, ""
        elif after.startswith(","):
            end, new = bare.index(",", end) + 1, ""
        elif before.endswith("throw") or after.startswith(";"):
            new = ""
        else:
            new = ";"
        code = code[:begin] + new + code[end:]


class Header:
    def __init__(self, root, path):
        self.path = path
        lines = (root / path).read_text().splitlines()
        self.blocks = [block for block in blocks(lines) if is_code(block)]
        spaces = [m.group(1) for m in (re.match(r"namespace ([\w:]+) \{", line) for line in lines) if m]
        self.namespace = next(space for space in [*spaces, "tiltproof"] if space.startswith("tiltproof"))

    def unbalanced(self):
        for block in self.blocks:
            bare = "".join(without_texts(text) for _, text in block)
            for pair in ("{}", "()", "[]"):
                if bare.count(pair[0]) != bare.count(pair[1]):
                    yield f"{self.path}:{block[0][0]}: error: the example has {bare.count(pair[0])} '{pair[0]}' and " \
                          f"{bare.count(pair[1])} '{pair[1]}'"

    def source(self, context, name):
        definitions, statements = [], []
        for block in self.blocks:
            code = f'#line {block[0][0]} "{self.path}"\n' + filled_in("\n".join(text for _, text in block))
            (definitions if DEFINES.match(block[0][1].strip()) else statements).append(code)
        spaces = [f"namespace {self.namespace}::{name} {{", *(f"namespace {chr(97 + n)} {{\n{part}"
                                                             for n, part in enumerate(context))]
        return "\n".join([*spaces, *definitions, "void Example() {", *statements, "}", "}" * len(spaces)])


def read_context(files):
    """Their declarations by header or folder, and what comes before them, for all."""
    preamble = []
    sections = {}
    for file in files:
        current = preamble
        for number, line in enumerate(file.read_text().splitlines(), 1):
            place = re.match(r"// ([\w/]+(?:/|\.h))$", line)
            if place:
                current = sections.setdefault(place.group(1), [f'#line {number + 1} "{file.as_posix()}"'])
            else:
                current.append(line)
    return sections, preamble


def command_of(folder, build):
    """The compiler, and the flags of a source below the folder with what any of them includes or defines besides."""
    # Without precompiled headers, so that a header includes all it needs.
    commands = [shlex.split(re.sub(r" -Winvalid-pch -include \S+", "", entry["command"])) for entry in json.loads((build / "compile_commands.json").read_text())
                if re.search(rf"-o {folder}/\S+", entry["command"]) and not entry["file"].endswith(".c")]
    commands = [words[words[0].endswith("ccache"):words.index("-o")] for words in commands]
    words = [word for word in commands[-1] if word != "-fno-exceptions"]
    for other in commands:
        for place, word in enumerate(other):
            if word.startswith(("-I", "-D")) and word not in words:
                words.append(word)
            elif word == "-isystem" and other[place + 1] not in words:
                words += other[place:place + 2]
    return words


def is_below(path):
    return lambda folder: path.startswith(folder + "/")


def main():
    root, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    sections, preamble = read_context(sorted((root / "tests/architecture").glob("example_context*.h")))
    out = build / "header_examples"
    out.mkdir(exist_ok=True)
    count, failed = 0, False
    used = set()
    for folder in FOLDERS:
        paths = [file.relative_to(root).as_posix() for file in sorted((root / folder).rglob("*.h"))]
        headers = [Header(root, path) for path in paths if max(filter(is_below(path), FOLDERS), key=len) == folder]
        headers = [header for header in headers if header.blocks]
        count += len(headers)
        for problem in (problem for header in headers for problem in header.unbalanced()):
            print(problem)
            failed = True
        parts, includes = [], []
        for number, header in enumerate(headers):
            # The nearest section counts.
            places = [place for place in sections if place == header.path or
                      (place.endswith("/") and header.path.startswith(place))]
            used.update(places)
            context = []
            for place in sorted(places, key=len):
                includes += [line for line in sections[place] if line.startswith("#include")]
                context.append("\n".join("" if line.startswith("#include") else line for line in sections[place]))
            parts.append(header.source(context, f"example_{number}"))
        source = out / f"{folder.replace('/', '_')}.cpp"
        includes = [f'#include "{header.path}"' for header in headers] + includes
        source.write_text("\n".join([*includes, *preamble, *parts]) + "\n")
        if subprocess.run([*command_of(folder, build), "-w", "-fsyntax-only", source], cwd=root).returncode != 0:
            failed = True
    for place in sorted(sections.keys() - used):
        print(f"tests/architecture/example_context*.h: no example needs the section {place}")
        failed = True
    if count < HEADERS_MIN:
        print(f"only {count} headers with examples, of at least {HEADERS_MIN}: does this script still find them?")
        failed = True
    print(f"{count} headers with examples" + ("" if failed else ", all of which compile"))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
