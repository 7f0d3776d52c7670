# SPDX-License-Identifier: MIT
"""README.md, docstrings and stubs: the program runs, the names exist, the types agree."""
import contextlib
import inspect
import io
import os
import pathlib
import re
import subprocess
import sys

import membrane
import pytest

HERE = pathlib.Path(__file__).resolve().parents[1]
PAGE = (HERE / "README.md").read_text()
PROGRAMS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
PUBLIC = [name for name in dir(membrane._membrane) if not name.startswith("_")]


def test_the_program_of_the_page_runs():
    program = PROGRAMS[0]
    assert program.count("\n") <= 32
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(program, {})  # noqa: S102
    felt, error = re.fullmatch(r"The hand feels (\S+) N, (\S+) N from the equilibrium.\n", printed.getvalue()).groups()
    assert 0.01 < float(felt) < 0.5 and float(error) < 0.05 * float(felt)


def test_the_tick_of_the_page_tears():
    mesh = membrane.with_reserve(membrane.disc(rings=8), 100)
    network = membrane.MassSpringNetwork(mesh, stiffness=20.0, pinned=membrane.border(mesh))
    tissue = membrane.Tissue(membrane.TearableSprings(mesh, network))
    scene = {"membrane": membrane, "dt": 1e-3, "tissue": tissue, "x": 1.3 * mesh.positions,
             "foundation": membrane.VirtualVolumeSprings(mesh, stiffness=1e-3), "tree": membrane.AabbTree(mesh),
             "solver": membrane.QuasiStaticSolver(tissue, layers=12), "tracker": membrane.ContactTracker(mesh),
             "tear": membrane.Tearing(mesh, membrane.EnergyRelease(toughness=100, thickness=1e-5))}
    path = [scene["tear"].surface.nearest_in_direction(0, (-1, 0, 0)), 0]
    while len(path) < 5:
        path.append(scene["tear"].surface.nearest_in_direction(path[-1], (1, 0, 0)))
    for event in scene["tear"].cut_along(path, scene["x"]):
        membrane.follow(event, *(scene[name] for name in ("tissue", "foundation", "solver", "tree", "tracker")))
    for _ in range(50):
        exec(PROGRAMS[1], scene)  # noqa: S102
    assert len(PROGRAMS) == 2 and scene["tear"].torn_length > 0


def test_the_names_of_the_page_are_bound():
    table = PAGE[PAGE.index("## What is bound"):].split("\n\n")[1]
    names = re.findall(r"`(\w+)`", table)
    missing = [name for name in names if not hasattr(membrane, name) and name not in ("step", "step_within")]
    assert len(names) > 60 and missing == []


def test_functions_that_the_page_does_not_name_are_few():
    unnamed = [name for name in PUBLIC if inspect.isroutine(getattr(membrane, name)) and f"`{name}`" not in PAGE]
    assert unnamed == []


@pytest.mark.parametrize("name", PUBLIC)
def test_everything_has_a_comment(name):
    assert (getattr(membrane, name).__doc__ or "").strip()


def test_comments_are_those_of_the_headers():
    assert "updated one after the other by the step rule" in membrane.QuasiStaticSolver.__doc__.replace("\n", " ")
    assert "layers: of the queue beyond layer 0" in membrane.QuasiStaticSolver.__init__.__doc__
    assert membrane.StepReport.converged.__doc__.startswith("No residual force exceeds")


def test_stubs_name_what_the_module_has():
    stub = (pathlib.Path(membrane.__file__).parent / "_membrane.pyi").read_text()
    declared = set(re.findall(r"^(?:class|def) (\w+)|^(\w+): ", stub, re.MULTILINE))
    declared = {a or b for a, b in declared}
    assert declared - {"__version__"} == set(PUBLIC) - {"devices", "materials"}
    for word in ("membrane_python", "_membrane.", "List[", "Vector3", "<"):
        assert word not in re.sub(r'""".*?"""', "", stub, flags=re.DOTALL)


def test_examples_have_the_types_of_the_stubs(tmp_path):
    run = subprocess.run([sys.executable, "-m", "mypy", "--ignore-missing-imports", "--check-untyped-defs",
                          "--cache-dir", tmp_path, *sorted((HERE / "scripts").glob("*.py")), HERE / "tests/loops.py"],
                         capture_output=True, text=True,
                         env={**os.environ, "MYPYPATH": str(pathlib.Path(membrane.__file__).parents[1])})
    assert run.returncode == 0, run.stdout + run.stderr


def test_a_wrong_type_is_found_by_the_stubs(tmp_path):
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import membrane\nmembrane.icosphere(radius='10 mm')\nmembrane.icosphere().vertices\n")
    run = subprocess.run([sys.executable, "-m", "mypy", "--cache-dir", tmp_path, wrong], capture_output=True, text=True,
                         env={**os.environ, "MYPYPATH": str(pathlib.Path(membrane.__file__).parents[1])})
    assert run.returncode == 1 and "Found 2 errors" in run.stdout


@pytest.mark.parametrize("name", ["figure_4", "trade", "fit", "convergence", "sweep", "tear"])
def test_examples_run(name, tmp_path):
    run = subprocess.run([sys.executable, HERE / f"scripts/{name}.py"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0 and run.stdout, run.stderr
