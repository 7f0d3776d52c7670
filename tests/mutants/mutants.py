# SPDX-License-Identifier: MIT
"""What tests/mutants/run runs: see there.

All mutants of a folder are compiled into one program, each beside the code it changes; an environment variable says
which one is active. A first run of each test notes which mutants it reaches; only those tests are run for a mutant.
"""
import argparse
import concurrent.futures
import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from statements import Source, code_of, either

root = Path(__file__).resolve().parents[2]
headers = root / "include/membrane"
tests = root / "tests"
scratch = root / "build/mutants"

# As many cases as without asserts, and yet an index out of range ends the program.
flags = ["-std=c++20", "-O1", "-DNDEBUG", "-DMEMBRANE_TEST_ALL_TYPES", "-ffp-contract=off", "-w",
         "-D_GLIBCXX_ASSERTIONS", "-fsanitize=array-bounds", "-fsanitize-trap=array-bounds",
         "-Deigen_assert(holds)=((holds) ? void() : __builtin_trap())"]
includes = [f"-I{root}/include", f"-I{tests}", f"-I{root}/examples", f"-I{tests}/support/hd_double",
            "-isystem", "/usr/include/eigen3", f'-DMEMBRANE_TEST_DATA="{tests}/data"']
files_in_unit = 6  # that are compiled together
memory_limit = 6 << 30  # [bytes]

# What the compiler or the processor decides, not the tests, and what only saves time.
left_out = {"core/instruction_set.hpp", "core/version.hpp"}
skipped_lines = re.compile(r"\s*(#|template|concept|requires|using|namespace|static_assert|friend|MEMBRANE_)"
                           r"|.*\breserve\(")

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

# What a program of mutants includes before all else. Constants of the compiler's are not changed.
prefix = r'''
#include "support/catch.hpp"
#include <Eigen/Core>
#include <cstdio>
#include <cstdlib>

struct Mutants {
    int active = std::getenv("MEMBRANE_MUTANT") ? std::atoi(std::getenv("MEMBRANE_MUTANT")) : 0;
    bool reached[COUNT] = {};
    ~Mutants() {
        const char* const name = std::getenv("MEMBRANE_REACHED");
        std::FILE* const file = name ? std::fopen(name, "w") : nullptr;
        if (!file) return;
        for (int i = 0; i < COUNT; ++i)
            if (reached[i]) std::fprintf(file, "%d ", i);
        std::fclose(file);
    }
};
inline Mutants mutants;
constexpr bool mutant(int i) {
    if (std::is_constant_evaluated()) return false;
    mutants.reached[i] = true;
    return mutants.active == i;
}
'''


@dataclass(frozen=True)
class Mutant:
    header: str  # folder/name.hpp
    line: int
    column: int  # of the first character that changes
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
        yield match.start(), match.end(), str(int(match[0]) + 1) if is_whole else f"{2 * float(match[0]) or 1.0:g}"
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
                yield Mutant(header, i, begin, line[:len(code)], line[:begin] + new + line[end:len(code)])
        inside_skipped = inside_skipped and not code.endswith((";", ">", "{", "}")) and not code.startswith("#")
        previous = code


def chosen(arguments):
    """Each mutant in an order of its own, by the seed, wherever in its header it is."""
    paths = sorted(headers.glob(f"{arguments.folder}/*.hpp"))
    found = {m.key: m for path in paths if str(path.relative_to(headers)) not in left_out for m in mutants_of(path)}
    found = [m for m in found.values() if any(text in f"{m.name} {m.before} -> {m.after}" for text in arguments.only)]
    return sorted(found, key=lambda m: hashlib.sha256(f"{arguments.seed} {m.key}".encode()).digest())


def equivalents():
    """The changes that make no difference: blocks of a header, `- before`, `+ after`, and the reason."""
    text = (tests / "mutants/equivalent").read_text(encoding="utf-8")
    blocks = [block.splitlines() for block in text.split("\n\n") if not block.startswith("#")]
    return {(b[0], b[1][2:], b[2][2:]) for b in blocks if len(b) > 3}


@cache
def source_of(header):
    return Source((headers / header).read_text(encoding="utf-8"))


@cache
def rewritten(mutant):
    """Begin and end of the statement that a mutant changes, and it in both forms; None if it cannot have both."""
    source = source_of(mutant.header)
    place, line = source.at(mutant.line, mutant.column), source.at(mutant.line, 0)
    found = source.statement(place)
    if found is None or found.end <= place:
        return None
    whole = source.plain[:line] + mutant.after + source.plain[line + len(mutant.before):]
    end = found.end + len(mutant.after) - len(mutant.before)
    old, new = (re.sub(r"\s+", " ", text) for text in (source.plain[found.begin:found.end], whole[found.begin:end]))
    text = either("mutant(@)", old, new)
    if text is None or "#" in text or found.in_declarations and text.lstrip().startswith("{"):
        return None
    return found.begin, found.end, " " + text


def sample(arguments):
    """Mutants that can stand in one program: not two in the same statement."""
    explained, taken, places = equivalents(), [], {}
    for mutant in chosen(arguments):
        if len(taken) >= arguments.count:
            break
        form = None if mutant.key in explained else rewritten(mutant)
        others = places.setdefault(mutant.header, [])
        if form and all(form[1] <= begin or end <= form[0] for begin, end in others):
            others.append(form[:2])
            taken.append(mutant)
    return taken


def write_headers(numbered, place):
    """The headers with all mutants, on the lines of the original; returns which mutants are on which lines."""
    lines = {}
    shutil.rmtree(place / "include", ignore_errors=True)  # a header may have lost its last one
    for header in {mutant.header for mutant in numbered.values()}:
        source = source_of(header)
        text = source.plain
        forms = [(*rewritten(mutant), i) for i, mutant in numbered.items() if mutant.header == header]
        for begin, end, form, i in sorted(forms, reverse=True):
            text = text[:begin] + form.replace("@", str(i)) + "\n" * text.count("\n", begin, end) + text[end:]
            for line in range(source.line_of(begin), source.line_of(end) + 1):
                lines.setdefault((header, line), []).append(i)
        target = place / "include/membrane" / header
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text + "\n", encoding="utf-8")
    return lines


def run(command, limit, **more):
    """How a command ends: `passes`, `fails`, `crashes`, or `hangs` if it computes for longer than `limit` [s]; and what
    it prints."""
    command = ["prlimit", f"--as={memory_limit}", "--core=0", f"--cpu={int(limit) + 1}", *command]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
                          text=True, errors="replace", env={**os.environ, **more}) as process:
        try:
            printed = process.communicate(timeout=20 * (limit + 1))[0]  # or waits for what does not come
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return "hangs", ""
    if process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return "hangs", printed
    return "crashes" if process.returncode < 0 else "fails" if process.returncode > 0 else "passes", printed


def compile_one(source, target, *more):
    """What the compiler prints, None if it compiles."""
    result, printed = run(["clang++", *flags, *more, *includes, "-c", source, "-o", target], 1200)
    return None if result == "passes" else printed


def compile_support():
    """What no mutant changes: Catch2's main and the references that tests compare with."""
    sources = [tests / "main.cpp", *sorted(tests.glob("support/*.cpp"))]
    for source in sources:
        target = scratch / f"{source.stem}.o"
        is_old = not target.exists() or target.stat().st_mtime < source.stat().st_mtime
        if not source.stem.startswith("usual") and is_old and compile_one(source, target):
            sys.exit(f"error: {source} does not compile")
    return [scratch / f"{source.stem}.o" for source in sources if not source.stem.startswith("usual")]


def test_units(folder, mutants, own_only, place):
    """The folder's test files, a few in a unit; or only those that are named as the mutants' headers."""
    files = sorted((tests / folder).glob("*_test.cpp"))
    if own_only:
        names = {Path(m.header).stem + "_test" for m in mutants}
        files = [file for file in files if file.stem in names]
    alone = [f for f in files if re.search(r"^#(define|undef)|CGAL|cgal", f.read_text(encoding="utf-8"), re.MULTILINE)]
    others = [f for f in files if f not in alone]
    units = []
    for begin in range(0, len(others), files_in_unit):
        units.append(place / f"unit{begin}.cpp")
        subprocess.run([tests / "together", units[-1], *others[begin:begin + files_in_unit]], check=True)
    return [*alone, *units]


def mutants_at(lines, printed, kind):
    """Those on the lines that the compiler names in messages of a kind."""
    named = re.findall(r"include/membrane/(\S+?):(\d+)(?::\d+)?" + kind, printed)
    return {i for header, line in named for i in lines.get((header, int(line)), [])}


def built(folder, numbered, support, arguments):
    """The folder's tests with all its mutants. Those that do not compile are taken from `numbered`."""
    place = scratch / folder
    place.mkdir(exist_ok=True)
    units = test_units(folder, numbered.values(), arguments.own, place)
    prefix_file, program = place / "prefix.hpp", place / "tests"
    prefix_file.write_text(prefix.replace("COUNT", str(max(numbered) + 1)), encoding="utf-8")
    if not units or compile_one(prefix_file, place / "prefix.hpp.gch", "-x", "c++-header"):
        sys.exit(f"error: no tests of {folder}, or Catch2 or Eigen does not compile")
    objects = {unit: place / f"{unit.stem}.o" for unit in units}

    def compile_unit(unit):
        return compile_one(unit, objects[unit], f"-I{place}/include", "-include", prefix_file)

    waiting = units
    while waiting:
        lines = write_headers(numbered, place)
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as workers:
            printed = dict(zip(waiting, workers.map(compile_unit, waiting)))
        failed = {unit: text for unit, text in printed.items() if text is not None}
        for unit, text in failed.items():
            at_fault = mutants_at(lines, text, ": error") or mutants_at(lines, text, "")
            if not at_fault:
                sys.exit(f"error: {unit} does not compile\n{text}")
            for i in at_fault & numbered.keys():
                del numbered[i]
        waiting = list(failed)
    result, text = run(["g++", *objects.values(), *support, "-o", program, "-lmpfr", "-lgmp", "-pthread"], 600)
    if result != "passes":
        sys.exit(f"error: the tests of {folder} do not link\n{text}")
    return program


@dataclass
class Case:
    """A test and what its run without a mutant shows."""
    name: str
    reached: set
    seconds: float


def run_case(program, name, mutant, limit, **more):
    escaped = re.sub(r"([\\,\[\]])", r"\\\1", name)
    return run([program, escaped], limit, MEMBRANE_MUTANT=str(mutant), **more)[0]


def cases_of(program, jobs):
    """All tests, the quickest first."""
    names = subprocess.run([program, "--list-test-names-only"], stdout=subprocess.PIPE, text=True, check=False).stdout

    def observed(name):
        file, begin = program.with_name(hashlib.sha256(name.encode()).hexdigest()), time.monotonic()
        if run_case(program, name, 0, 1200, MEMBRANE_REACHED=str(file)) != "passes":
            sys.exit(f"error: the test '{name}' fails without a mutant")
        seconds = time.monotonic() - begin
        reached = {int(i) for i in file.read_text(encoding="utf-8").split()}
        file.unlink()
        return Case(name, reached, seconds)

    with concurrent.futures.ThreadPoolExecutor(jobs) as workers:
        cases = workers.map(observed, filter(None, names.splitlines()))
        return sorted(cases, key=lambda case: case.seconds)


def fate(program, cases, i):
    """`killed ...` or `survived ...`."""
    reaching = [case for case in cases if i in case.reached]
    for case in reaching:
        result = run_case(program, case.name, i, 10 * case.seconds + 2)
        if result != "passes":
            return f"killed ('{case.name}' {result})"
    return f"survived {len(reaching)} tests"


def try_folder(folder, mutants, support, arguments):
    """The survivors, and how many mutants were tried."""
    numbered = dict(enumerate(mutants, 1))
    program = built(folder, numbered, support, arguments)
    cases = cases_of(program, arguments.jobs)
    survivors = []

    def attempt(i):
        result = fate(program, cases, i)
        print(f"{result}: {numbered[i]}", flush=True)
        if result.startswith("survived"):
            survivors.append(numbered[i])

    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as workers:
        list(workers.map(attempt, numbered))
    return survivors, len(numbered)


def try_all(arguments):
    mutants = sample(arguments)
    scratch.mkdir(parents=True, exist_ok=True)
    support = compile_support()
    survivors, tried = [], 0
    for folder in sorted({m.header.split("/")[0] for m in mutants}):
        lived, count = try_folder(folder, [m for m in mutants if m.header.startswith(folder + "/")], support, arguments)
        survivors += lived
        tried += count
    print(f"{tried - len(survivors)} killed, {len(survivors)} survived, {len(mutants) - tried} did not compile")
    for mutant in sorted(survivors, key=str):
        print(f"\n{mutant}")
    return 1 if len(survivors) > (tried / 2 if arguments.own else max(1, tried / 20)) else 0


def main():
    parser = argparse.ArgumentParser(prog="tests/mutants/run")
    parser.add_argument("folder", nargs="?", default="*")
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=[""])
    parser.add_argument("--own", action="store_true")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--list", action="store_true")
    arguments = parser.parse_args()
    print(f"{len(chosen(arguments))} mutants, seed {arguments.seed}", flush=True)
    if not arguments.list:
        return try_all(arguments)
    for mutant in sample(arguments):
        print(mutant)
    return 0


sys.exit(main())
