"""vcpkg_manifest.py PORT: the manifest of PORT has only fields that vcpkg documents, and names as dependencies the helper
ports of the functions that its portfile calls. Prints the version."""
import json
import pathlib
import sys

port = pathlib.Path(sys.argv[1])
manifest = json.loads((port / "vcpkg.json").read_text(encoding="utf-8"))
if unknown := set(manifest) - {"name", "version-semver", "description", "homepage", "license", "dependencies"}:
    sys.exit(f"packages: vcpkg.json has {unknown}")

portfile = (port / "portfile.cmake").read_text(encoding="utf-8")
helpers = {"vcpkg_cmake_configure": "vcpkg-cmake", "vcpkg_cmake_config_fixup": "vcpkg-cmake-config"}
needed = [{"name": helper, "host": True} for function, helper in helpers.items() if f"{function}(" in portfile]
if missing := [dependency for dependency in needed if dependency not in manifest["dependencies"]]:
    sys.exit(f"packages: vcpkg.json lacks {missing}")
print(manifest["version-semver"])
