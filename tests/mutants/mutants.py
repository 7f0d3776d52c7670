# SPDX-License-Identifier: MIT
"""What tests/mutants/run runs: see there."""
import argparse
import concurrent.futures
import hashlib
import os
import re
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

root = Path(__file__).resolve().parents[2]
headers = root / "include/membrane"
tests = root / "tests"
scratch = root / "build/mutants"

# As many cases as without asserts, and yet an index out of range ends the program.
flags = ["-std=c++20", "-O1", "-DNDEBUG", "-ffp-contract=off", "-w", "-D_GLIBCXX_ASSERTIONS",
         "-Deigen_assert(holds)=((holds) ? void() : __builtin_trap())"]
includes = [f"-I{root}/include", f"-I{tests}", f"-I{root}/examples", f"-I{tests}/support/hd_double",
            "-isystem", "/usr/include/eigen3", f'-DMEMBRANE_TEST_DATA="{tests}/data"']
compile_limit, run_limit = 1200, 120  # [s] of a processor; the tests of a folder take some tens
files_in_unit = 6  # that are compiled together
memory_limit = 6 << 30  # [bytes]

# What the compiler or the processor decides, not the tests, and what only saves time.
left_out = {"core/instruction_set.hpp", "core/version.hpp"}
skipped_lines = re.compile(r"\s*(#|template|concept|requires|using|namespace|static_assert|friend|MEMBRANE_)|.*\breserve\(")

# clang-format puts spaces around binary operators alone: neither templates nor references match.
swaps = [(" + ", " - "), (" * ", " / "), (" < ", " <= "), (" > ", " >= "), (" < ", " > "), (" <= ", " >= "),
         (" == ", " != "), (" && ", " || "), (" += ", " -= "), (" *= ", " /= "), (" | ", " & "), ("++", "--"),
         ("true", "false"), ("std::min)", "std::max)"), ("minCoeff", "maxCoeff"), ("cwiseMin", "cwiseMax"),
         ("lower_bound", "upper_bound"), ("floor", "ceil"), (".front()", ".back()"), (".low", ".high"),
         ("continue;", "break;")]
dropped_calls = ("std::abs", "std::sqrt", "norm", "normalized")
number = re.compile(r"(?<![\w.'])\d+(\.\d+)?(e-?\d+)?(?![\w.'])")
statement = re.compile(r"\s+(\+\+|--)?(?!(return|throw|else|case|default|break|continue|goto|delete)\b)"
                       r"[A-Za-z_]\w*((\.|->|::)\w+|\[[^\]]*\]|\(.*\))*( [-+*/|&]?= .*)?;$")


@dataclass(frozen=True)
class Mutant:
    header: str  # folder/name.hpp
    line: int
    before: str
    after: str

    @property
    def name(self):
        return f"{self.header}:{self.line}"

    @property
    def key(self):
        return self.header, self.before.strip(), self.after.strip()

    def __str__(self):
        return f"{self.name}\n- {self.before.strip()}\n+ {self.after.strip()}"


def code_of(line):
    """The line with spaces in place of what a comment or a text says."""
    line = re.sub(r'"(\\.|[^"\\])*"', lambda text: " " * len(text[0]), line)
    comment = line.find("//")
    return line if comment < 0 else line[:comment].rstrip()


def end_of(code, begin):
    """Where the bracket at `begin` closes; None if on another line."""
    depth = 0
    for i in range(begin, len(code)):
        depth += (code[i] == "(") - (code[i] == ")")
        if depth == 0:
            return i
    return None


def changed(code, previous):
    """All changes of one line of code: begin, end, replacement."""
    for pair in swaps:
        for old, new in (pair, pair[::-1]):
            for match in re.finditer(r"(?<![\w])" * old[0].isalpha() + re.escape(old), code):
                yield match.start(), match.end(), new
    for match in number.finditer(code):
        is_whole = match[0].isdigit()
        yield match.start(), match.end(), str(int(match[0]) + 1) if is_whole else f"{2 * float(match[0]):g}"
    for match in re.finditer(r"(?<=[(\s])!(?=[\w(])", code):
        yield match.start(), match.end(), ""
    for match in re.finditer(r"\b(if|while) \(", code):
        end = end_of(code, match.end() - 1)
        if end is not None:
            yield match.end(), end, f"!({code[match.end():end]})"
            if match[1] == "if":
                yield match.end(), end, "false"
    for call in dropped_calls:
        for match in re.finditer(r"(?<![\w:.])" + call + r"\(", code):
            yield match.start(), match.end(), "("
    if statement.match(code) and previous.endswith((";", "{", "}", ")", ":", "else")):
        yield len(code) - len(code.lstrip()), len(code), ";"


def mutants_of(path):
    header = str(path.relative_to(headers))
    previous, inside_skipped = "", False
    for i, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        code = code_of(line)
        if not code.strip():
            continue
        inside_skipped = inside_skipped or bool(skipped_lines.match(code))
        if not inside_skipped:
            for begin, end, new in changed(code, previous):
                yield Mutant(header, i, line, line[:begin] + new + line[end:])
        inside_skipped = inside_skipped and not code.endswith((";", ">", "{", "}")) and not code.startswith("#")
        previous = code


def chosen(arguments):
    """Each mutant in an order of its own, by the seed, wherever in its header it is."""
    paths = sorted(headers.glob(f"{arguments.folder}/*.hpp"))
    found = {m.key: m for path in paths if str(path.relative_to(headers)) not in left_out for m in mutants_of(path)}
    found = [m for m in found.values() if arguments.only in f"{m.name} {m.before} -> {m.after}"]
    return sorted(found, key=lambda m: hashlib.sha256(f"{arguments.seed} {m.key}".encode()).digest())


def equivalents():
    """The changes that make no difference: blocks of a header, `- before`, `+ after`, and the reason."""
    text = (tests / "mutants/equivalent").read_text(encoding="utf-8")
    blocks = [block.splitlines() for block in text.split("\n\n") if not block.startswith("#")]
    return {(b[0], b[1][2:], b[2][2:]) for b in blocks if len(b) > 3}


def run(command, limit):
    """How a command ends: `passes`, `fails`, `crashes`, or `hangs` if it computes for longer than `limit` [s]."""
    command = ["prlimit", f"--as={memory_limit}", "--core=0", f"--cpu={limit}", *command]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True) as process:
        try:
            process.communicate(timeout=20 * limit)  # or waits for what does not come
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return "hangs"
    if process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return "hangs"
    return "crashes" if process.returncode < 0 else "fails" if process.returncode > 0 else "passes"


def compiled(source, target, *more):
    return run(["g++", *flags, *more, *includes, "-c", source, "-o", target], compile_limit) == "passes"


def prepare():
    """What no mutant changes: the prefix of all tests, Catch2's main and the references that tests compare with."""
    scratch.mkdir(parents=True, exist_ok=True)
    (scratch / "prefix.hpp").write_text('#include "support/catch.hpp"\n#include <Eigen/Core>\n', encoding="utf-8")
    sources = [tests / "main.cpp", *sorted(tests.glob("support/*.cpp"))]
    sources = [source for source in sources if not source.name.startswith("usual")]
    objects = {scratch / f"{source.stem}.o": source for source in sources}
    if not compiled(scratch / "prefix.hpp", scratch / "prefix.hpp.gch", "-x", "c++-header"):
        sys.exit("error: Catch2 or Eigen does not compile")
    for target, source in objects.items():
        is_new = target.exists() and target.stat().st_mtime > source.stat().st_mtime
        if not is_new and not compiled(source, target):
            sys.exit(f"error: {source} does not compile")
    return list(objects)


def units(mutant, own_only, place):
    """The test files to compile: the header's own, then the folder's others, a few at a time, those that include the
    header first."""
    folder, name = mutant.header.split("/")
    own = tests / folder / name.replace(".hpp", "_test.cpp")
    texts = {f: f.read_text(encoding="utf-8") for f in sorted((tests / folder).glob("*_test.cpp"))}
    if own in texts:
        yield own.stem, own
    if own_only:
        return
    others = sorted((f for f in texts if f != own), key=lambda f: f"<membrane/{mutant.header}>" not in texts[f])
    alone = [f for f in others if re.search(r"^#(define|undef)|CGAL", texts[f], re.MULTILINE)]
    others = [f for f in others if f not in alone]
    for begin in range(0, len(others), files_in_unit):
        together = place / "together.cpp"
        subprocess.run([tests / "together", together, *others[begin:begin + files_in_unit]], check=True)
        yield folder, together
    for file in alone:
        yield file.stem, file


def fate(mutant, support, own_only, place):
    """`killed ...`, `survived`, or None if it does not compile."""
    overlay = place / "include/membrane" / mutant.header
    lines = (headers / mutant.header).read_text(encoding="utf-8").splitlines()
    lines[mutant.line - 1] = mutant.after
    overlay.parent.mkdir(parents=True, exist_ok=True)
    overlay.write_text("\n".join(lines) + "\n", encoding="utf-8")
    unit, program = place / "unit.o", place / "program"
    try:
        for name, source in units(mutant, own_only, place):
            if not compiled(source, unit, f"-I{place}/include", "-include", scratch / "prefix.hpp"):
                return None
            # What a mutant and the references share is the mutant's: it comes first.
            if run(["g++", unit, *support, "-o", program, "-lmpfr", "-lgmp", "-pthread"], compile_limit) != "passes":
                return None
            result = run([program, "--abort"], run_limit)
            if result != "passes":
                return f"killed ({name} {result})"
        return "survived"
    finally:
        overlay.unlink()


class Campaign:
    """Takes mutants from a list until enough have come to an end, several at a time."""

    def __init__(self, arguments, mutants):
        self.arguments, self.explained, self.mutants = arguments, equivalents(), iter(mutants)
        self.killed, self.survivors, self.equivalent, self.taken = 0, [], 0, 0
        self.lock = threading.Lock()
        self.support = prepare()

    def next(self):
        with self.lock:
            for mutant in self.mutants:
                if self.taken >= self.arguments.count:
                    return None
                self.taken += 1
                if mutant.key not in self.explained:
                    return mutant
                self.equivalent += 1
        return None

    def work(self, number):
        place = scratch / str(number)
        while (mutant := self.next()) is not None:
            result = fate(mutant, self.support, self.arguments.own, place)
            with self.lock:
                if result is None:
                    self.taken -= 1
                    continue
                print(f"{result}: {mutant}", flush=True)
                if result == "survived":
                    self.survivors.append(mutant)
                else:
                    self.killed += 1

    def run(self):
        with concurrent.futures.ThreadPoolExecutor(self.arguments.jobs) as workers:
            list(workers.map(self.work, range(self.arguments.jobs)))
        print(f"{self.killed} killed, {len(self.survivors)} survived, {self.equivalent} are equivalent")
        for mutant in sorted(self.survivors, key=str):
            print(f"\n{mutant}")
        bearable = self.killed if self.arguments.own else max(1, self.killed / 19)
        return 1 if len(self.survivors) > bearable else 0


def main():
    parser = argparse.ArgumentParser(prog="tests/mutants/run")
    parser.add_argument("folder", nargs="?", default="*")
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--own", action="store_true")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--list", action="store_true")
    arguments = parser.parse_args()
    mutants = chosen(arguments)
    print(f"{len(mutants)} mutants, seed {arguments.seed}", flush=True)
    if not arguments.list:
        return Campaign(arguments, mutants).run()
    for mutant in mutants[:arguments.count]:
        print(mutant)
    return 0


sys.exit(main())
