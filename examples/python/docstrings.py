# SPDX-License-Identifier: MIT
"""docstrings.py INCLUDE OUT: the comments of the library's headers as a C++ table, from which the module has its
docstrings. A name is "QuasiStaticSolver::step" or "icosphere"; comments of overloads stand one below the other.

The headers are formatted by clang-format, so that indentation is scope: names of the namespace begin a line, members of
a class stand four columns to the right.
"""
import pathlib
import re
import sys

CLASS = re.compile(r"(?:class|struct|enum class) (\w+)[^;]*$")
SKIPPED = re.compile(r"(template|requires|static_assert|using|public:|private:|inline namespace|#|//(?!/)|\}|&&)")


def names_of(declaration):
    """The names that a declaration declares: of a class, a function, or of data."""
    declaration = re.sub(r"\[\[\w+\]\]", "", declaration)
    if found := re.match(r"\s*(?:class|struct|enum class|concept) (\w+)", declaration):
        return [found[1]]
    if found := re.match(r"[^=(]*?(operator\(\)|[\w]+)\(", declaration):
        return [found[1]]
    plain = re.sub(r"\{[^{}]*(\}|$)|<[^<>]*(<[^<>]*>)?[^<>]*>", "", declaration)
    data = re.sub(r"\s*=\s*[^,]*", "", plain).rstrip("; {")
    return re.findall(r"(\w+)\s*(?:,|$)", data)


class Header:
    """The comments of one header."""

    def __init__(self, text):
        self.found = {}
        self.scopes = {0: ""}          # by indentation, with "::" at the end
        self.comment, self.group = [], None
        lines = iter(text.split("\n"))
        for line in lines:
            self.read(line, lines)

    def read(self, line, lines):
        indent, text = len(line) - len(line.lstrip()), line.strip()
        if text == "///@{":
            self.group, self.comment = [], []
        elif text == "///@}":
            self.group, self.comment = None, []
        elif text.startswith("///"):
            self.comment.append(text[3:].removeprefix(" "))
        elif not text:
            if self.group is None:
                self.comment = []
        elif found := re.match(r"namespace (\w+) \{", text):
            self.scopes[0] = {"membrane": "", "unit": "unit::"}.get(found[1], f"{found[1]}::")
            self.comment = []
        elif text.startswith("}  // namespace"):
            self.scopes[0] = ""
        elif SKIPPED.match(text) or indent not in (0, 4) or (indent == 4 and 4 not in self.scopes):
            if text.startswith("};"):
                self.scopes.pop(4, None)
                self.comment = []
        else:
            self.declare(indent, line, lines)

    def declare(self, indent, line, lines):
        code, _, note = line.partition("///<")
        while not re.search(r"[;{},]\s*(//.*)?$", code) or code.count("(") > code.count(")"):
            following, _, more = next(lines, ";").partition("///<")
            code, note = code + " " + following.strip(), note + more
        comment = self.comment or self.group or []
        if self.group is not None and self.comment:
            self.group = self.comment
        text = "\n".join(comment).strip() or note.strip()
        for name in names_of(code):
            if text and not self.scopes[indent].startswith("detail"):
                self.found.setdefault(self.scopes[indent] + name, []).append(text)
        if indent == 0 and (found := CLASS.match(code)):
            self.scopes[4] = f"{self.scopes[0]}{found[1]}::"
        self.comment = []


def comments(include):
    """All comments, by name."""
    found = {}
    for path in sorted(pathlib.Path(include).rglob("*.hpp")):
        for name, texts in Header(path.read_text()).found.items():
            found.setdefault(name, []).extend(text for text in texts if text not in found.get(name, []))
    return {name: "\n\n".join(texts).replace("@throws", "Raises").replace("@pre", "Requires:")
            for name, texts in found.items()}


def main(include, out):
    rows = [f'    {{"{name}", R"~({text})~"}},' for name, text in sorted(comments(include).items())]
    pathlib.Path(out).write_text("// Written by docstrings.py.\n" + "\n".join(rows) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
