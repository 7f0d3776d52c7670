"""conan_stand_in.py RECIPE SCRATCH: not Conan, but a stand-in for what RECIPE calls. Exports the sources, configures and
installs those alone, to SCRATCH/package. Prints the version; what CMake says goes to stderr."""
import fnmatch
import importlib.util
import pathlib
import shutil
import subprocess
import sys
import types

sys.dont_write_bytecode = True
recipe_file, scratch = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])


class ConanFile:
    def __init__(self):
        self.recipe_folder = recipe_file.parent
        self.export_sources_folder = scratch / "sources"
        self.info = types.SimpleNamespace(clear=lambda: None)
        self.cpp_info = types.SimpleNamespace(set_property=lambda name, value: None)
        self.requires = lambda reference, transitive_headers: None


class CMakeToolchain:
    variables = {}

    def __init__(self, conanfile):
        self.cache_variables = self.variables

    def generate(self):
        pass


class CMake:
    def __init__(self, conanfile):
        pass

    def configure(self):
        options = [f"-D{name}={'ON' if value else 'OFF'}" for name, value in CMakeToolchain.variables.items()]
        self.run("-G", "Ninja", "-S", scratch / "sources", "-B", scratch / "build", *options)

    def install(self):
        self.run("--install", scratch / "build", "--prefix", scratch / "package")

    def run(self, *arguments):
        subprocess.run(["cmake", *arguments], stdout=sys.stderr, check=True)


def copy(conanfile, pattern, source, target):
    for file in pathlib.Path(source).rglob("*"):
        name = str(file.relative_to(source))
        if file.is_file() and fnmatch.fnmatch(name, pattern):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target / name)


def nothing(*arguments):
    return types.SimpleNamespace(generate=lambda: None)


def module(name, **names):
    sys.modules[name] = types.ModuleType(name)
    vars(sys.modules[name]).update(names)


module("conan", ConanFile=ConanFile)
module("conan.tools")
module("conan.tools.build", check_min_cppstd=nothing)
module("conan.tools.cmake", CMake=CMake, CMakeDeps=nothing, CMakeToolchain=CMakeToolchain, cmake_layout=nothing)
module("conan.tools.files", copy=copy, load=lambda conanfile, path: pathlib.Path(path).read_text(encoding="utf-8"))

spec = importlib.util.spec_from_file_location("recipe", recipe_file)
loaded = importlib.util.module_from_spec(spec)
spec.loader.exec_module(loaded)
recipe = loaded.Membrane()
for step in ("set_version", "export_sources", "layout", "requirements", "validate", "generate", "build", "package",
             "package_id", "package_info"):
    getattr(recipe, step)()
if not (scratch / "package" / recipe.cpp_info.builddirs[0] / "membrane-config.cmake").is_file():
    sys.exit(f"packages: no CMake package in {recipe.cpp_info.builddirs}")
print(recipe.version)
