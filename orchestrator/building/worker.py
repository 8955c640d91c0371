"""Builds one FMU with PythonFMU; run as a process of its own, because PythonFMU imports the sources by name.

Reads a recipe as JSON from standard input and writes the FMU to the path in it.
"""

import json
import sys
from importlib.metadata import distribution
from pathlib import Path
from xml.etree import ElementTree

from orchestrator.building.archive import read_archive, write_archive
from orchestrator.building.launcher import compile_launcher, find_toolchain
from orchestrator.building.sources import Recipe, digest
from orchestrator.building.stamping import content_guid, final_text, stamp
from orchestrator.building.starts import default_starts
from orchestrator.errors import OrchestratorError
from orchestrator.shared.equation_files import members as source_members
from orchestrator.shared.scratch import Scratch
from orchestrator.shared.stopping import stop_on_signals

RUNTIME = ("_version", "default_experiment", "enums", "fmi2slave", "logmsg", "variables")
LINUX = "binaries/linux64"

ENTRY = '''"""The class that PythonFMU instantiates, with the name and the start values of this FMU."""

from .{module} import {class_name} as Model

Model.customise({name!r}, {build!r}, {starts!r})
'''
OWNED = """import ctypes

if locals() is not globals():  # for an instance: PythonFMU then gives back a reference that it never took
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))
"""
"""Head of an FMU's module, which PythonFMU imports once, and then runs for every instance with locals of its own."""
LOADED = '''"""Loaded by PythonFMU."""

{owned}
from {package}.entry import Model as {name}
'''


def build(recipe: Recipe, target: Path, fingerprint: str) -> None:
    """Build ``recipe`` into ``target``."""
    starts = default_starts(recipe.class_name) | dict(recipe.starts)
    runtime = runtime_files()
    sources = source_members(recipe.module)
    content = [part for name in sorted(sources) for part in (name.encode(), sources[name])]
    options = json.dumps([recipe.name, sorted(starts.items())]).encode()
    identity = digest([options, ENTRY.encode(), *runtime.values(), *content])
    package = f"pyfmu_{identity[:16]}"
    entry = ENTRY.format(
        module=recipe.module, class_name=recipe.class_name, name=recipe.name, build=identity[:16], starts=starts,
    )  # fmt: skip
    sources |= {"entry.py": entry.encode(), "__init__.py": b'"""The sources of one FMU."""\n'}
    loaded = LOADED.format(owned=OWNED, package=package, name=recipe.class_name)
    with Scratch("build") as scratch:
        members = _build_by_pythonfmu(scratch.path, package, sources, loaded, recipe.name)
    write_archive(target, _complete(members, package, runtime, fingerprint, recipe))


def runtime_files() -> dict[str, bytes]:
    """Return the content of the files of PythonFMU that a slave needs when it runs, by their names."""
    import pythonfmu

    folder = Path(pythonfmu.__file__).parent
    return {"__init__.py": b'"""PythonFMU."""\n'} | {f"{m}.py": (folder / f"{m}.py").read_bytes() for m in RUNTIME}


def _build_by_pythonfmu(
    folder: Path, package: str, sources: dict[str, bytes], loaded: str, name: str
) -> dict[str, bytes]:
    from pythonfmu import FmuBuilder

    (folder / package).mkdir()
    for file, content in sources.items():
        (folder / package / file).parent.mkdir(exist_ok=True)
        (folder / package / file).write_bytes(content)
    script = folder / f"{name}_{package}.py"
    script.write_text(loaded, encoding="utf-8")
    built = FmuBuilder.build_FMU(script, dest=folder / "out.fmu", project_files=[folder / package])
    return read_archive(Path(built))


def _complete(
    members: dict[str, bytes], package: str, runtime: dict[str, bytes], fingerprint: str, recipe: Recipe
) -> dict[str, bytes]:
    """Return the members with PythonFMU put into the package, the launcher, all documents and the GUID."""
    from orchestrator.building.documentation import documentation
    from orchestrator.building.reference_files import reference_files

    kept = {name: data for name, data in members.items() if not name.startswith("resources/pythonfmu/")}
    kept |= {f"resources/{package}/pythonfmu/{name}": data for name, data in runtime.items()}
    toolchain = find_toolchain()
    library = f"{LINUX}/{recipe.name}.so"
    if toolchain.compiler is not None and library in kept:
        wrapper = f"libpythonfmu-export-{digest([kept[library]])[:16]}.so"
        kept[f"{LINUX}/{wrapper}"] = kept[library]
        kept[library] = compile_launcher(toolchain, wrapper)
    description = ElementTree.fromstring(kept.pop("modelDescription.xml"))
    kept |= documentation(recipe, description)
    kept |= reference_files(recipe)
    kept["documentation/licenses/PythonFMU.txt"] = pythonfmu_license()
    stamp(description, fingerprint)
    guid = content_guid(description, kept)
    return kept | {"modelDescription.xml": final_text(description, guid), "resources/guid.txt": guid.encode() + b"\n"}


def pythonfmu_license() -> bytes:
    """Return the text of PythonFMU's licence, in UTF-8."""
    files = distribution("pythonfmu").files or []
    path = next((file for file in files if file.name.upper().startswith("LICENSE")), None)
    return path.read_binary() if path is not None else b"PythonFMU is distributed under the MIT license.\n"


def main() -> int:
    """Read the recipe from standard input; return 0, or 2 with one line on standard error."""
    stop_on_signals()
    request = json.load(sys.stdin)
    recipe = Recipe(request["name"], request["module"], request["class_name"], request["starts"])
    try:
        build(recipe, Path(request["target"]), request["fingerprint"])
    except (OrchestratorError, ValueError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
