"""Finds the functions of C and C++ sources that clang-format has formatted, and counts their lines.

    for name, line, lines in functions(text): ...      # name: "Wire::Transmit"

It reads brackets, not the language. A function inside another one, as a lambda is, belongs to it.
"""
import re

# Texts, characters and remarks: no bracket in them counts. Digits may hold an apostrophe: 1'000.
NOT_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|R"([^()\\ ]{0,16})\(.*?\)\1"|"(?:\\.|[^"\\\n])*"'
                      r"|(?<![0-9A-Fa-f])'(?:\\.|[^'\\\n])+'", re.S)
DIRECTIVE = re.compile(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.M)
# Heads of a block: what stands before its bracket.
SCOPE = re.compile(r'(inline )?(namespace|class|struct|enum|union)\b|extern ""$')
QUALIFIED = re.compile(r"\)( ?(const|noexcept|override|final|mutable|&&?|-> ?[\w:<>,*& ]+))*$")
TEMPLATE = re.compile(r"^template ?<")


def without_template(head):
    """The head without `template <...>`."""
    while TEMPLATE.match(head):
        depth, end = 0, 0
        for end, char in enumerate(head):
            depth += (char == "<") - (char == ">")
            if char == ">" and depth == 0:
                break
        head = re.sub(r"^requires ?\([^()]*\) ?", "", head[end + 1:].strip())
    return head


def kind_of(head):
    head = without_template(head)
    if head.endswith("namespace") or (SCOPE.match(head) and not QUALIFIED.search(head)):
        return "scope"
    if "(" not in head or head.endswith(("(", "=", ",")):
        return "data"
    before = re.sub(r"operator ?\W+", "", head[:head.index("(")])
    # `= [](int x) {` is a function as well.
    return "data" if "=" in before and not ("[" in head and QUALIFIED.search(head)) else "function"


def name_of(head):
    names = re.findall(r"(~?[\w:]+|operator ?[^\s\w(]+)\s*\(", without_template(head))
    return names[0] if names else head


def functions(text):
    code = NOT_CODE.sub(lambda m: ('""' if m.group()[0] in "\"R'" else "") + "\n" * m.group().count("\n"), text)
    code = DIRECTIVE.sub(lambda m: "\n" * m.group().count("\n"), code)
    line, head, head_line, open_blocks, inner = 1, "", None, [], 0
    for place, char in enumerate(code):
        line += char == "\n"
        if inner:
            inner += (char == "{") - (char == "}")
            if inner == 0:
                kind, name, begin = open_blocks.pop()
                # A member's initialiser stands before the body.
                if re.match(r"\s*[,{]", code[place + 1:place + 200]):
                    continue
                if kind == "function":
                    yield name, begin, line - begin + 1
                head, head_line = "", None
        elif char == "{":
            kind = kind_of(" ".join(head.split()))
            if kind != "scope":
                open_blocks.append((kind, name_of(" ".join(head.split())), head_line))
                inner = 1
            else:
                head, head_line = "", None
        elif char in "};" or (char == ":" and head.strip() in ("public", "private", "protected")):
            head, head_line = "", None
        elif head or not char.isspace():
            head, head_line = head + char, head_line or line
