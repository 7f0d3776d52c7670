# SPDX-License-Identifier: MIT
"""stubs.py PACKAGE: writes PACKAGE/__init__.pyi and a file for each submodule, for editors and type checkers, from the
signatures that pybind11 writes into the docstrings of the compiled module.
"""
import importlib
import inspect
import pathlib
import re
import sys
import textwrap

HEAD = """\
# Written by stubs.py.
import os
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Union, overload

import numpy
import numpy.typing
"""
ARRAY = "numpy.typing.NDArray[numpy.float64]"
BOTH = {r"(?<=: )function": "Callable[..., Any]", r"Optional\[(.*)\]": r"\1 | None", r"Tuple\[": "tuple[", "NoneType": "None"}
TAKEN = {"Vector3": "numpy.typing.ArrayLike", "Field": "numpy.typing.ArrayLike | None",
         r"List\[int\[\d\]\]": "Sequence[int]",
         r"List\[float\]": "Sequence[float] | numpy.typing.NDArray[numpy.float64]",
         r"List\[int\]": "Sequence[int] | numpy.typing.NDArray[numpy.int32]", r"List\[": "Sequence[",
         r"os\.PathLike": "str | os.PathLike[str]"}
GIVEN = {"Vector3": ARRAY, r"List\[int\[\d\]\]": "list[int]", r"List\[": "list["}
VARIADIC = {"follow": "*parts: TearableSprings | Tissue | Foundation | QuasiStaticSolver | AabbTree | ContactTracker | "
                      "Grasper | VertexNormals | ToolFriction | CoarseCorrection"}
LITERAL = re.compile(r"-?[\d.]+(e-?\d+)?|True|False|None")


def in_words_of_typing(text, names):
    text = re.sub(r"membrane::(\w+)<double>", r"\1", text)  # of a class that is defined after the function
    for pattern, by in {**names, **BOTH}.items():
        text = re.sub(rf"\b{pattern}", by, text)
    return text.replace("Sequence[Waypoint]", "Sequence[Waypoint | tuple[Any, ...]]")


def parts(text):
    """The parameters of a signature: what stands between the commas that are in no brackets."""
    depth, start = 0, 0
    for i, sign in enumerate(text):
        depth += (sign in "([{<") - (sign in ")]}") - (sign == ">" and text[i - 1] != "-")
        if sign == "," and depth == 0:
            yield text[start:i].strip()
            start = i + 1
    if text[start:].strip():
        yield text[start:].strip()


def parameter(text, variadic):
    text = text.replace("membrane._membrane.", "")
    if text.startswith("self:"):
        return "self"
    if text == "*args":
        return variadic
    declared, _, default = text.partition(" = ")
    declared = in_words_of_typing(declared, TAKEN)
    return declared + (f" = {default if LITERAL.fullmatch(default) else '...'}" if default else "")


def signature(line):
    """def NAME(...) -> ... from a line of a docstring."""
    name, taken, given = re.fullmatch(r"(\w*)\((.*)\) -> (.*)", line).groups()
    given = in_words_of_typing(given.replace("membrane._membrane.", ""), GIVEN)
    variadic = VARIADIC.get(name, "*constraints: Constraint")
    return name, ", ".join(parameter(each, variadic) for each in parts(taken)), given


def documented(head, comment, indent):
    body = f'"""{comment.strip()}"""' if comment.strip() else "..."
    return [indent + head, textwrap.indent(textwrap.dedent(body), indent + "    ")]


def overloads(function):
    """Signature and comment of each overload."""
    doc = function.__doc__
    if "\nOverloaded function." not in doc:
        line, _, comment = doc.partition("\n")
        return [(line, comment)]
    found = re.split(r"^\d+\. (?=\w+\()", doc, flags=re.MULTILINE)[1:]
    return [tuple(each.partition("\n")[::2]) for each in found]


def stub_of_function(function, indent=""):
    lines, all_overloads = [], overloads(function)
    for line, comment in all_overloads:
        name, taken, given = signature(line)
        if len(all_overloads) > 1:
            lines.append(indent + "@overload")
        lines += documented(f"def {name}({taken}) -> {given}:", comment, indent)
    return lines


def stub_of_class(name, cls):
    bases = [base.__name__ for base in cls.__bases__ if base.__module__ == cls.__module__]
    if issubclass(cls, Exception):
        bases = ["ValueError"]
    lines = documented(f"class {name}({', '.join(bases)}):" if bases else f"class {name}:", cls.__doc__ or "", "")
    for member, value in vars(cls).items():
        if isinstance(value, property):
            head = signature("get" + value.fget.__doc__.split("\n")[0])[2]
            lines += ["    @property", *documented(f"def {member}(self) -> {head}:", value.__doc__ or "", "    ")]
            if value.fset:
                taken = "numpy.typing.ArrayLike" if head == ARRAY else head
                lines += [f"    @{member}.setter", f"    def {member}(self, value: {taken}) -> None: ..."]
        elif isinstance(value, cls):
            lines.append(f"    {member}: ClassVar[{name}]")
        elif inspect.isroutine(value) and (value.__doc__ or "").startswith(member + "("):
            if member not in ("__repr__", "__str__", "__hash__", "__eq__", "__ne__", "__getstate__", "__setstate__"):
                lines += stub_of_function(value, "    ")
    return lines


def stub_of(module):
    lines = []
    for name, value in vars(module).items():
        if inspect.isclass(value):
            lines += ["", "", *stub_of_class(name, value)]
        elif inspect.isroutine(value):
            lines += ["", "", *stub_of_function(value)]
        elif not inspect.ismodule(value) and (not name.startswith("__") or name == "__version__"):
            lines.append(f"{name}: {type(value).__name__}")
    return lines


def main(package):
    folder = pathlib.Path(package)
    sys.path.insert(0, str(folder.parent.resolve()))
    module = importlib.import_module(f"{folder.name}._membrane")
    (folder / "_membrane.pyi").write_text(HEAD + "\n".join(stub_of(module)) + "\n")
    for name in ("devices", "materials"):
        imports = "from ._membrane import DeviceProfile, MaterialRange\n"
        (folder / f"{name}.pyi").write_text(imports + "\n".join(stub_of(getattr(module, name))) + "\n")
    (folder / "__init__.pyi").write_text("from ._membrane import *\nfrom ._membrane import __version__ as __version__\n"
                                         "from . import devices as devices, materials as materials\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
