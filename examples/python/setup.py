# SPDX-License-Identifier: MIT
"""The wheel of the module `membrane`: an extension of the sources in source/ and of the library's headers, and the stubs
that are made of its docstrings.

What is built lies in build/python of the repository. MEMBRANE_JOBS: compilers at once, 1 unless given.
MEMBRANE_OPTIMISATION: -O3 unless given; the results are the same.
"""
import os
import pathlib
import subprocess
import sys

from pybind11.setup_helpers import ParallelCompile, Pybind11Extension, build_ext
from setuptools import setup

here = pathlib.Path(__file__).resolve().parent
root = here.parents[1]
build = root / "build/python"
include = root / "include"
sources = sorted((here / "source").glob("*.cpp"))
headers = [*include.rglob("*.hpp"), *(here / "source").glob("*.hpp")]
os.chdir(here)

# -ffp-contract=off: the same bits as a program of C++ with this option, whatever the processor. g++ 12 does not see that
# pybind11 asks for the size of a function object before it constructs it in place.
optimisation = os.environ.get("MEMBRANE_OPTIMISATION", "-O3")
options = [optimisation, "-g0", "-ffp-contract=off", "-Wall", "-Wextra", "-Wno-placement-new"]


def version():
    lines = (include / "membrane/core/version.hpp").read_text().split()
    return ".".join(lines[lines.index(f"MEMBRANE_VERSION_{part}") + 1] for part in ("MAJOR", "MINOR", "PATCH"))


def is_older(target, *origins):
    return not target.exists() or any(origin.stat().st_mtime > target.stat().st_mtime for origin in origins)


class BuildExtension(build_ext):
    """Writes the docstrings before, and the stubs after."""

    def build_extensions(self):
        docstrings = build / "docstrings.inc"
        if is_older(docstrings, here / "docstrings.py", *headers):
            build.mkdir(parents=True, exist_ok=True)
            subprocess.run([sys.executable, here / "docstrings.py", include, docstrings], check=True)
        self.precompile_headers()
        ParallelCompile("MEMBRANE_JOBS", default=1, needs_recompile=self.needs_recompile).install()
        super().build_extensions()
        package = pathlib.Path(self.get_ext_fullpath("membrane._membrane")).parent
        for name in ("__init__.py", "py.typed"):
            self.copy_file(str(here / "membrane" / name), str(package / name))
        subprocess.run([sys.executable, here / "stubs.py", package], check=True)

    def precompile_headers(self):
        """types.hpp, which most sources include first: a third of the time of a build is saved."""
        target = build / "headers/types.hpp.gch"
        if not is_older(target, *headers):
            return
        target.parent.mkdir(exist_ok=True)
        extension, = self.extensions
        includes = [f"-I{folder}" for folder in [*extension.include_dirs, *self.include_dirs]]
        flags = [flag for flag in extension.extra_compile_args if flag not in ("-include", "types.hpp")]
        subprocess.run([*self.compiler.compiler_so, *includes, *flags, "-x", "c++-header", "source/types.hpp",
                        "-o", target], check=True)

    @staticmethod
    def needs_recompile(target, source):
        own = [build / "docstrings.inc"] if source.endswith("module.cpp") else []
        return is_older(pathlib.Path(target), pathlib.Path(source), *headers, *own)


setup(
    name="membrane",
    version=version(),
    description="Deforming thin tissue under a tool, and feeling it",
    license="MIT",
    python_requires=">=3.9",
    install_requires=["numpy"],
    packages=["membrane"],
    package_data={"membrane": ["py.typed", "*.pyi"]},
    ext_modules=[
        Pybind11Extension("membrane._membrane", [str(source.relative_to(here)) for source in sources], cxx_std=20,
                          include_dirs=[str(build / "headers"), str(here / "source"), str(include), str(build)],
                          extra_compile_args=["-isystem", "/usr/include/eigen3", "-include", "types.hpp", *options])
    ],
    cmdclass={"build_ext": BuildExtension},
    options={"build": {"build_base": str(build)}, "egg_info": {"egg_base": str(build)}},
    zip_safe=False,
)
