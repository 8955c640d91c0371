"""Builds native FMUs: the same slaves, translated to C and compiled, so that they need no Python at run time.

In all functions: ``fmi``: version of FMI, 2 or 3. ``real_outputs``: outputs that are no real numbers become local
variables, for hosts that read every output as a real number.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import orchestrator.building.translation
from orchestrator import __version__
from orchestrator.building.archive import write_archive
from orchestrator.building.build import default_directory, is_trusted, stamp_of
from orchestrator.building.compilers import FLAGS, TARGETS, Compiler, compile_library, find_compiler
from orchestrator.building.documentation import documentation
from orchestrator.building.fmi3_description import fmi3_description
from orchestrator.building.fmi3_files import build_description, terminals_and_icons
from orchestrator.building.native_description import native_description
from orchestrator.building.native_sources import RUNTIME, c_sources, indicator_count, slave_class
from orchestrator.building.reference_files import reference_files
from orchestrator.building.sources import DATA_FILES, Recipe, catalogue, digest, recipe_of
from orchestrator.building.stamping import content_guid, final_text, stamp
from orchestrator.errors import FmuError
from orchestrator.fmi.ours import record
from orchestrator.shared.equation_files import closure

PLACEHOLDER = "{00000000-0000-0000-0000-000000000000}"
NO_COMPILER = "native FMUs need a C compiler: install one (cc), or `pip install 'backlash-cosim[native]'` for zig"


def native_directory(fmi: int = 2, real_outputs: bool = False) -> Path:
    """Return where native FMUs live: ``native/`` beside the others, because they have the same names."""
    folder = default_directory(fmi) / "native"
    return folder / "real" if real_outputs else folder


def ensure_native(
    names: Sequence[str] | None = None,
    directory: Path | None = None,
    force: bool = False,
    here: bool = False,
    fmi: int = 2,
    real_outputs: bool = False,
) -> dict[str, Path]:
    """Return the path of each native FMU in ``names`` (default: all), after building what is missing or stale.

    Args:
        here: for this platform alone, with the local compiler where there is one: a second instead of half a minute.
    """
    recipes = [recipe_of(name) for name in (catalogue() if names is None else names)]
    folder = native_directory(fmi) if directory is None else directory
    return {recipe.name: _ensure(recipe, folder, force, here, fmi, real_outputs) for recipe in recipes}


def _require_compiler(here: bool = False) -> Compiler:
    """Return the compiler, see :func:`find_compiler`."""
    compiler = find_compiler(here)
    if compiler is None:
        raise FmuError(NO_COMPILER)
    return compiler


def native_remark() -> str | None:
    """Return one line on what is missing for all platforms, or ``None``."""
    compiler = find_compiler()
    if compiler is None or compiler.is_zig:
        return None
    platforms = ", ".join(target.folder for target in compiler.targets)
    return (
        f"the binaries are for {platforms} only: with zig (`pip install 'backlash-cosim[native]'`) they are for "
        f"{', '.join(target.folder for target in TARGETS)}"
    )


def native_fingerprint(recipe: Recipe, compiler: Compiler, fmi: int = 2, real_outputs: bool = False) -> str:
    """Return what changes whenever a native build would."""
    options = {
        "fmi": fmi,
        "real_outputs": real_outputs,
        "name": recipe.name,
        "class": recipe.class_name,
        "starts": {name: float(value).hex() for name, value in sorted(recipe.starts.items())},
        "version": __version__,
        "compiler": [compiler.identity, *FLAGS, *(str(target.zig) for target in compiler.targets)],
    }
    files = [*closure(recipe.module), *_builder_files()]
    named = [part for path in files for part in (path.name.encode(), path.read_bytes())]
    return digest([b"native", json.dumps(options, sort_keys=True).encode(), *named])


@cache
def _builder_files() -> tuple[Path, ...]:
    here = Path(__file__).parent
    names = (
        "archive", "arrays", "compilers", "documentation", "fmi3_description", "fmi3_files", "native_build",
        "native_description", "native_sources", "reference_files", "stamping",
    )  # fmt: skip
    translation = Path(orchestrator.building.translation.__file__).parent
    files = [*(here / f"{name}.py" for name in names), *sorted(translation.glob("*.py")), *sorted(RUNTIME.glob("*.h"))]
    return (*files, *DATA_FILES)


def _ensure(recipe: Recipe, directory: Path, force: bool, here: bool, fmi: int, real_outputs: bool) -> Path:
    compiler = _require_compiler(here)
    path = directory / f"{recipe.name}.fmu"
    current = native_fingerprint(recipe, compiler, fmi, real_outputs)
    if force or stamp_of(path) != current or not is_trusted(path):
        write_archive(path, _native_members(recipe, compiler, current, fmi, real_outputs))
        record(path)
    return path


def _native_members(
    recipe: Recipe, compiler: Compiler, fingerprint: str, fmi: int, real_outputs: bool
) -> dict[str, bytes]:
    """Return the members of the archive."""
    cls = slave_class(recipe, fmi, real_outputs)
    sources = c_sources(recipe, cls, PLACEHOLDER, fmi)
    folders = {target: target.folders(fmi) for target in compiler.targets}
    description = native_description(recipe, cls, indicator_count(sources[f"{recipe.name}.c"]))
    members = documentation(recipe, description, [name for names in folders.values() for name in names], fmi)
    members |= reference_files(recipe, description)
    if fmi == 3:
        description = fmi3_description(cls, recipe.name, native=True)
        sources["buildDescription.xml"] = build_description(recipe.name)
        members["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_and_icons(cls)
    stamp(description, fingerprint)
    guid = content_guid(description, members | {f"sources/{name}": data for name, data in sources.items()})
    sources = {name: data.replace(PLACEHOLDER.encode(), guid.encode()) for name, data in sources.items()}
    members |= {f"sources/{name}": data for name, data in sources.items()}
    for target in compiler.targets:
        library = compile_library(compiler, target, recipe.name, sources)
        members |= {f"binaries/{folder}/{recipe.name}{target.suffix}": library for folder in folders[target]}
    return members | {"modelDescription.xml": final_text(description, guid)}
