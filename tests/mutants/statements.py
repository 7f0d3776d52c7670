# SPDX-License-Identifier: MIT
"""Finds the statement around a place of a C++ file, and writes it so that one program holds it and a changed form.

Text only: it knows brackets, comments and texts, and the layout that clang-format gives, not names or types. What it
cannot write with both forms it leaves out; what it writes wrongly does not compile.
"""
import bisect
import re
from dataclasses import dataclass

opening, closing = "({[", ")}]"
scope_of_declarations = re.compile(r"\b(struct|class|namespace|enum|union)\b")
declaration = re.compile(r"(const |static |inline |constexpr |auto |using |struct |template)"
                         r"|[\w:]+(<.*?>)?[&*]? [&*]?\w+ ?([({;,\[]|$)")
declared = re.compile(r"([\w:<>,&*\[\] ]+ [&*]?\w+|(const )?auto&? \[[\w, ]+\])$")

constructed = re.compile(r"((?:const )?([\w:]+(?:<[\w, :]+>)?) \w+)([({].*[)}]);$")  # T name(...); or T name{...};


def code_of(line):
    """The line with spaces in place of what a comment or a text says."""
    line = re.sub(r'"(\\.|[^"\\])*"', lambda text: " " * len(text[0]), line)
    comment = line.find("//")
    return line if comment < 0 else line[:comment].rstrip()


@dataclass(frozen=True)
class Statement:
    begin: int  # in the file's code
    end: int  # behind its semicolon, or at the brace that opens its block
    in_declarations: bool  # of a class or a namespace


class Source:
    """A file's code: its lines without comments. Texts and the preprocessor's lines are spaces, but not in `plain`."""

    def __init__(self, text):
        lines = [line[:len(code_of(line))] for line in text.splitlines()]
        self.plain = "\n".join(lines)
        self.code = "\n".join(" " * len(line) if line.lstrip().startswith("#") else code_of(line) for line in lines)
        self.lines = [0]
        for line in lines:
            self.lines.append(self.lines[-1] + len(line) + 1)
        self.partner = matched(self.code)
        self.blocks = [b for b in sorted(self.partner) if self.code[b] == "{" and self.is_block(b)]

    def at(self, line, column):
        return self.lines[line - 1] + column

    def line_of(self, place):
        return bisect.bisect_right(self.lines, place)

    def is_block(self, begin):
        """Whether braces hold statements, not values."""
        i, end = begin + 1, self.partner[begin]
        if not self.code[i:end].strip():
            return self.code[:begin].rstrip().endswith((")", "const", "noexcept", "override"))
        while i < end:
            if self.code[i] == ";" or self.code[i] == "{" and self.is_block(i):
                return True
            i = self.partner[i] + 1 if self.code[i] in opening else i + 1
        return False

    def statement(self, place):
        """The statement around a place, None in an empty file."""
        around = [b for b in self.blocks if b < place < self.partner[b]]
        begin, last = (around[-1] + 1, self.partner[around[-1]]) if around else (0, len(self.code))
        i = begin
        while i < last:
            c = self.code[i]
            if c == ";" or c == "{" and i in self.blocks:
                if place < i or c == ";" and place == i:
                    return Statement(begin, i + (c == ";"), self.is_scope(around[-1]) if around else True)
                i = begin = (i if c == ";" else self.partner[i]) + 1
            else:
                i = self.partner[i] + 1 if c in opening else i + 1
        return None

    def is_scope(self, block):
        head = re.split(r"[;}]|\{(?!\})", self.code[:block])[-1]
        return bool(scope_of_declarations.search(head)) and ") " not in head


def matched(code):
    """Where each bracket closes."""
    partner, open_ones = {}, []
    for i, c in enumerate(code):
        if c in opening:
            open_ones.append(i)
        elif c in closing:
            partner[open_ones.pop()] = i
    return partner


def parts(text, separator):
    """The text between separators outside all brackets."""
    found, depth, begin = [], 0, 0
    for i, c in enumerate(text):
        depth += (c in opening) - (c in closing)
        if depth == 0 and text.startswith(separator, i):
            found.append(text[begin:i])
            begin = i + len(separator)
    return [*found, text[begin:]]


def either(test, old, new):
    """`old` and `new` are the same statement, unchanged and changed; None if both cannot stand in one program."""
    control = re.match(r"\s*((case [^?]*?|default|public|private):(?!:)|else\b|do\b)\s*", old)
    if control:
        same = old[:control.end()]
        rest = either(test, old[control.end():], new[control.end():]) if new.startswith(same) else None
        return None if rest is None else same + rest
    control = re.match(r"\s*(if|while|for|switch) \(", old)
    if control:
        return either_control(test, old, new, control)
    return either_simple(test, old.strip(), new.strip())


def either_control(test, old, new, control):
    begin = control.end()
    if not new.startswith(old[:begin]):
        return None
    old_end, new_end = (matched(text)[begin - 1] for text in (old, new))
    inside, changed = old[begin:old_end], new[begin:new_end]
    if inside == changed:
        rest = either(test, old[old_end + 1:], new[new_end + 1:])
        return None if rest is None else f"{old[:old_end + 1]} {rest}"
    if control[1] == "for":
        inside = either_loop(test, inside, changed)
    elif control[1] == "switch" or ";" in inside or re.match(r"\s*(const|auto)\b", inside):
        return None
    else:
        inside = f"{test} ? bool({changed}) : bool({inside})"
    return None if inside is None else old[:begin] + inside + old[old_end:]


def either_loop(test, old, new):
    old, new = parts(old, ";"), parts(new, ";")
    if len(old) != 3 or len(new) != 3:
        return None
    first = old[0] + ";" if old[0] == new[0] else either_simple(test, old[0], new[0])
    if first is None:
        return None
    condition = old[1] if old[1] == new[1] else f"{test} ? bool({new[1]}) : bool({old[1]})"
    step = old[2] if old[2] == new[2] else f"({test} ? void({new[2]}) : void({old[2]}))"
    return f"{first.rstrip(';')}; {condition}; {step}"


def either_simple(test, old, new):
    if re.match(r"(return|throw|break|continue)\b", old):
        return f"{{ if ({test}) {{ {new} }} {old} }}"
    left, *right = parts(old, " = ")
    if right and declared.match(left):
        changed = parts(new, " = ")
        right, changed = " = ".join(right), " = ".join(changed[1:])
        if re.search(r"\b(constexpr|static)\b", left) or right.startswith("{") or not new.startswith(left + " ="):
            return None
        return f"{left} = {test} ? ({changed.rstrip(';')}) : ({right.rstrip(';')});"
    built = constructed.match(old)
    if built and new.startswith(built[1]) and not old.startswith("return"):
        return f"{built[1]} = {test} ? {built[2]}{new[len(built[1]):-1]} : {built[2]}{built[3]};"
    if declaration.match(old) or not re.match(r"[\w+\-*(]", old) or not old.endswith(";"):
        return None
    return f"{{ if ({test}) {{ {new} }} else {{ {old} }} }}"
