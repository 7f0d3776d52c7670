# SPDX-License-Identifier: MIT
"""The wheel is complete: an example runs where nothing but the wheel and Debian's packages is found."""
import os
import pathlib
import subprocess
import sys
import zipfile

HERE = pathlib.Path(__file__).resolve().parents[1]


def test_a_wheel_runs_in_a_new_environment(tmp_path):
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}

    def run(*command):
        done = subprocess.run(command, cwd=tmp_path, env=clean, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    said = run(HERE / "run", "--wheel", tmp_path / "dist")
    wheel, = (tmp_path / "dist").glob("membrane-*.whl")
    assert wheel.name in said
    names = zipfile.ZipFile(wheel).namelist()
    for name in ("__init__.py", "__init__.pyi", "_membrane.pyi", "devices.pyi", "materials.pyi", "py.typed"):
        assert f"membrane/{name}" in names

    run(sys.executable, "-m", "venv", "--system-site-packages", "environment")
    python = tmp_path / "environment/bin/python"
    run(python, "-m", "pip", "install", "--quiet", "--no-index", wheel)
    found = pathlib.Path(run(python, "-c", "import membrane; print(membrane.__file__)").strip())
    assert tmp_path in found.parents
    assert "peak force" in run(python, HERE / "scripts/sweep.py")
