"""conan create cmake/packages/conan: a package of the source tree that it stands in. It has the CMake package that
`cmake --install` makes, with the targets membrane::membrane, membrane::deterministic and membrane::instantiated.
"""
import os
import re

from conan import ConanFile
from conan.tools.build import check_min_cppstd
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load


class Membrane(ConanFile):
    name = "membrane"
    description = "Deforming thin tissue under a tool, and feeling it"
    license = "MIT"
    package_type = "header-library"
    settings = "os", "arch", "compiler", "build_type"
    no_copy_source = True

    @property
    def root(self):
        return os.path.normpath(os.path.join(self.recipe_folder, "../../.."))

    def set_version(self):
        text = load(self, os.path.join(self.root, "include/membrane/core/version.hpp"))
        self.version = ".".join(re.findall(r"#define MEMBRANE_VERSION_\w+ (\d+)", text))

    def export_sources(self):
        for files in ("CMakeLists.txt", "LICENSE", "include/*", "cmake/*"):
            copy(self, files, self.root, self.export_sources_folder)

    def layout(self):
        cmake_layout(self)

    def requirements(self):
        self.requires("eigen/3.4.0", transitive_headers=True)

    def validate(self):
        check_min_cppstd(self, 20)

    def generate(self):
        parts = CMakeToolchain(self)
        for part in ("TESTS", "EXAMPLES", "BENCHMARKS"):
            parts.cache_variables[f"MEMBRANE_BUILD_{part}"] = False
        parts.generate()
        CMakeDeps(self).generate()

    def build(self):
        CMake(self).configure()

    def package(self):
        CMake(self).install()

    def package_id(self):
        self.info.clear()

    def package_info(self):
        self.cpp_info.bindirs = []
        self.cpp_info.libdirs = []
        self.cpp_info.set_property("cmake_find_mode", "none")  # its own package, whose targets are more than one
        self.cpp_info.builddirs = ["share/cmake/membrane"]
