"""The public names of the headers, as Doxygen sees them.

Names are namespaces, types, concepts, enumerators, macros, and public functions, data and friends; not what is in
`detail`, and not functions that are defaulted or deleted. Not seen: template parameters; deduction guides;
specialisations; what the preprocessor leaves out for g++ with SSE2 (the registers of other compilers); and what Doxygen
does not understand.
"""
import glob
import os
import re
import subprocess
import sys
import tempfile
import typing
import xml.etree.ElementTree as ElementTree

project = os.path.abspath(os.path.join(os.path.dirname(__file__), "../.."))

# All names are in the output, those without a comment too: Doxygen itself does not miss comments of concepts and friends.
settings = """
EXTRACT_ALL = YES
GENERATE_HTML = NO
GENERATE_XML = YES
XML_PROGRAMLISTING = NO
WARN_FORMAT = "$file:$line: $text"
"""


class Name(typing.NamedTuple):
    file: str
    line: int
    name: str  # qualified
    signature: str  # as it is declared
    commented: bool
    dangles: bool = False  # of a temporary: a function that returns a span of its data, or a reference to it


def has_comment(element):
    parts = (element.find(part) for part in ("briefdescription", "detaileddescription"))
    return any("".join(part.itertext()).strip() for part in parts if part is not None)


def is_view(member):
    """Whether a member function returns a span or a reference and may be called of a temporary."""
    if member.get("kind") != "function" or member.get("static") == "yes" or member.findtext("name").startswith("operator"):
        return False
    returned = "".join(member.find("type").itertext()).strip()
    for_all = member.get("refqual") is None or member.get("const") == "yes"
    return for_all and bool(re.match(r"std::span\b|.*&$", returned))


def names_in(compound):
    """Each public name of a class, concept, namespace or file."""
    location = compound.find("location")
    if compound.get("prot", "public") != "public" or location is None or location.get("file") == "[generated]":
        return
    scope = compound.findtext("compoundname")
    if compound.get("kind") in ("class", "struct", "union", "concept", "namespace"):
        yield Name(location.get("file"), int(location.get("line")), scope, scope, has_comment(compound))
    scope = "" if compound.get("kind") == "file" else f"{scope}::"
    for_temporaries = {member.findtext("name") for member in compound.iter("memberdef") if member.get("refqual") == "rvalue"}
    for member in compound.iter("memberdef"):
        signature = (member.findtext("definition") or member.findtext("name")) + (member.findtext("argsstring") or "")
        is_class = member.get("kind") == "friend" and signature.startswith(("friend class", "friend struct", "class"))
        if member.get("prot") != "public" or is_class or re.search(r"= ?(default|delete)$", signature):
            continue
        if member.get("refqual") == "rvalue":  # as the overload for all others
            continue
        file, line = (member.find("location").get(key) for key in ("file", "line"))
        name = member.findtext("name")
        yield Name(file, int(line), scope + name, signature, has_comment(member),
                   is_view(member) and name not in for_temporaries)
        for value in member.findall("enumvalue"):
            enumerator = f"{name}::{value.findtext('name')}"
            yield Name(file, int(line), scope + enumerator, enumerator, has_comment(value))


def public_names(root):
    """The names of the headers below root, sorted, and what Doxygen warns of in headers and pages."""
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(project, "cmake/docs/Doxyfile"), encoding="utf-8") as file:
            all_settings = file.read() + settings
        environment = dict(os.environ, MEMBRANE_ROOT=root, MEMBRANE_DOCS=folder, MEMBRANE_TOOLS=f"{project}/cmake/docs")
        run = subprocess.run(
            ["doxygen", "-"], input=all_settings, env=environment, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            sys.exit(f"{run.stderr}doxygen failed")
        names = set()
        for file in glob.glob(os.path.join(folder, "xml/*.xml")):
            for compound in ElementTree.parse(file).getroot().iter("compounddef"):
                names.update(names_in(compound))
    return sorted(names), run.stderr
