"""Finds in Markdown pages and in descriptions of scenarios what breaks the rules of CONTRIBUTING.md, "Words".

A machine finds long sentences, words with a plainer one, headings that are questions, and long lines. Fenced and
indented code, HTML comments, tables' long lines, sources and the history are exempt.
"""
import re

WORDS_MAX = 30
COLUMNS_MAX = 110
# Pattern -> the words to write instead.
INSTEAD = {
    r"anew|afresh": "again",
    r"mend(s|ed|ing)?": "fix",
    r"nobody|no one|somebody|someone|anybody|anyone": "the user, the node, or whoever it is",
    r"tells? of|told of|says? so|said so": "report, print",
    r"gives? way|gave way": "fail",
    r"whatsoever|thereof|therein|hitherto|henceforth|whereby|wherein": "a plain word",
    r"of itself|of themselves": "automatically",
}
# A heading names a task or a thing.
HEADING_STARTERS = r"(What|Whether|How|Of|That|Which|Why|Where|Who|Again)\b"
FOLDERS = ("docs", "firmware", "scenarios", "tests")
NOT_PROSE = {"CHANGELOG.md", "THIRD_PARTY.md"}


class Page:
    """The prose of a page: `parts` are (line number, kind, text); a kind is text, heading or cell. `wide` are lines that are too long."""

    def __init__(self, text):
        self.parts, self.wide, self._kept, self._start, self._indent = [], [], [], 0, 0
        fenced = commented = False
        for number, line in enumerate(text.splitlines(), 1):
            bare = line.strip()
            if bare.startswith("```"):
                fenced = not fenced
                self._end()
            elif fenced:
                continue
            elif bare.startswith("<!--") or commented:
                commented = "-->" not in bare
                self._end()
            elif not bare:
                self._end()
            elif bare.startswith("#"):
                self._end()
                self.parts.append((number, "heading", bare.lstrip("# ")))
            elif bare.startswith("|"):
                self._end()
                self.parts += [(number, "cell", part.strip()) for part in re.split(r" \| |; |\), ", bare.strip("|"))]
            else:
                self._add(number, line, bare)
        self._end()

    def _add(self, number, line, bare):
        indent = len(line) - len(bare.rstrip()) - (len(line) - len(line.rstrip()))
        item = re.match(r"\s*([-*]|\d+\.)\s+", line)
        if not self._kept and not item:
            if indent == 0:
                self._indent = 0
            elif indent >= self._indent + 4:
                return  # code
        if len(line) > COLUMNS_MAX and " " in bare:
            self.wide.append((number, len(line)))
        if item:
            self._end()
            self._indent = item.end()
            bare = line[item.end():].strip()
        if not self._kept:
            self._start = number
        self._kept.append(bare)

    def _end(self):
        if self._kept:
            self.parts.append((self._start, "text", " ".join(self._kept)))
        self._kept = []


def plain(text):
    """Each code span becomes one word, each link its text."""
    text = re.sub(r"(`+)[^`]+\1", "code", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"<https?:[^>]*>", "address", text)


def length(sentence):
    return sum(bool(re.search(r"[^\W_]", word)) for word in sentence.split())


def long_sentences(text):
    for sentence in re.split(r"(?<=[.!?])[\"')*]*\s+(?=[\"'(*]*[A-Z0-9‡†§]|code\b|\*)", plain(text)):
        if length(sentence) > WORDS_MAX:
            yield f"a sentence of {length(sentence)} words: '{' '.join(sentence.split()[:8])} ...'"


def other_words(text):
    for pattern, instead in INSTEAD.items():
        if found := re.search(rf"\b({pattern})\b", plain(text), re.IGNORECASE):
            yield f"'{found.group(0)}': write {instead}"


def of_page(text):
    """(line number, problem) of a page."""
    page = Page(text)
    for number, columns in page.wide:
        yield number, f"{columns} columns, at most {COLUMNS_MAX}"
    for number, kind, part in page.parts:
        if kind == "heading" and (found := re.match(HEADING_STARTERS, part)):
            yield number, f"a heading starts with '{found.group(1)}'"
        if part.startswith("Source:"):
            continue
        for problem in [*long_sentences(part), *other_words(part)]:
            yield number, problem


def of_scenario(text):
    """(line number, problem) of a scenario's description."""
    lines = text.splitlines()
    for at, line in enumerate(lines):
        if not (found := re.match(r"description:\s*(.*)", line)):
            continue
        parts = [found.group(1).strip("|>-")]
        for more in lines[at + 1:]:
            if more.strip() and not more.startswith(" "):
                break
            parts.append(more.strip())
        description = " ".join(parts).strip().strip("\"'")
        for problem in [*long_sentences(description), *other_words(description)]:
            yield at + 1, problem


def problems(root):
    pages = sorted(root.glob("*.md")) + [page for folder in FOLDERS for page in sorted((root / folder).rglob("*.md")) if "node_modules" not in page.parts]
    found = [(page, *problem) for page in pages if page.name not in NOT_PROSE for problem in of_page(page.read_text())]
    for file in sorted((root / "scenarios").rglob("*.yaml")):
        found += [(file, *problem) for problem in of_scenario(file.read_text())]
    return [f"{file.relative_to(root).as_posix()}:{number}: {what}" for file, number, what in found]
