"""Builds our FMUs: reproducible to the byte, rebuilt when stale, published whole or not at all.

An FMU is stale when its fingerprint (sources, builder, versions, compiler there or not) is not the one that a build
would have now. The fingerprint is in the FMU, so nothing beside the file itself is needed to tell.
"""

import importlib
import json
import os
import platform
import re
import sys
import sysconfig
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import orchestrator
from orchestrator.building.archive import DAMAGE
from orchestrator.building.launcher import Toolchain, find_toolchain
from orchestrator.building.sources import Recipe, catalogue, fingerprint, recipe_of, recipes_of
from orchestrator.errors import FmuError
from orchestrator.fmi.ours import is_ours, record
from orchestrator.shared.cache import tell_damage
from orchestrator.shared.tool_runs import run_tool
from pyfmu_sources.adapters.fmu_variables import with_starts

ROOT = Path(orchestrator.__file__).resolve().parents[1]
IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")
_STAMP = re.compile(rb'<Build fingerprint="([0-9a-f]{64})"')


def default_directory() -> Path:
    """Return where FMUs live: ``fmus/`` of the repository; of an installed package, ``fmus/`` in the current folder.

    A repository that the user cannot write is an installed package, too.
    """
    beside = ROOT / "fmus"
    return beside if (ROOT / "pyproject.toml").exists() and os.access(beside, os.W_OK) else Path("fmus")


def ensure_built(
    names: Sequence[str] | None = None, directory: Path | None = None, force: bool = False
) -> dict[str, Path]:
    """Return the path of each FMU in ``names`` (default: all), after building what is missing or stale."""
    folder = default_directory() if directory is None else directory
    return {recipe.name: _ensure(recipe, folder, force) for recipe in recipes_of(names)}


def build_variant(
    name: str,
    base: str = "Drivetrain",
    start_values: Mapping[str, float | str] | None = None,
    directory: Path | None = None,
) -> Path:
    """Build (unless it is there already) an FMU called ``name`` that is ``base`` with other start values."""
    if not IDENTIFIER.fullmatch(name) or name in catalogue():
        raise FmuError(f"`name` must be a new C identifier of at most 100 characters, but is {name!r}")
    starts = {parameter: _number(value) for parameter, value in (start_values or {}).items()}
    recipe = replace(recipe_of(base), name=name, starts=starts)
    slave = getattr(importlib.import_module(f"pyfmu_sources.{recipe.module}"), recipe.class_name)
    try:
        with_starts(slave.table, starts)
    except ValueError as error:
        raise FmuError(str(error)) from None
    return _ensure(recipe, default_directory() if directory is None else directory)


def _number(value: float | str) -> float:
    if not isinstance(value, str):
        return float(value)
    from pyfmu_sources.adapters.model_xml import ENUMERATIONS

    for items in ENUMERATIONS.values():
        names = [item for item, _ in items]
        if value in names:
            return float(names.index(value) + 1)
    raise FmuError(f"a start value must be a number or the name of an enumeration's item, but is {value!r}")


def _ensure(recipe: Recipe, directory: Path, force: bool = False) -> Path:
    current = fingerprint(recipe, *python_toolchain(find_toolchain()))
    return bring_up_to_date(directory / f"{recipe.name}.fmu", current, force, partial(_build, recipe))


def python_toolchain(toolchain: Toolchain) -> tuple[str, ...]:
    """Return what FMUs that run Python are made with."""
    from importlib.metadata import version  # native FMUs do without

    return version("pythonfmu"), platform.python_version(), sysconfig.get_platform(), toolchain.identity


def bring_up_to_date(path: Path, current: str, force: bool, build: Callable[[Path, str], None]) -> Path:
    """Return the FMU at ``path``, built if it has another fingerprint than ``current``, or is not what we built."""
    if force or stamp_of(path) != current or not is_trusted(path):
        if path.exists() and _is_damaged(path):
            tell_damage(path)
        build(path, current)
        record(path)
    return path


def is_trusted(path: Path) -> bool:
    """Tell whether the file is what we built; a stamp alone can be forged, save beside sources as open."""
    if is_ours(path):
        return True
    own = (ROOT / "fmus" / folder for folder in ("", "native", "fmi3"))
    if path.parent.resolve() in own and (ROOT / "pyproject.toml").exists() and not _is_damaged(path):
        record(path)
        return True
    return False


def stamp_of(path: Path) -> str | None:
    """Return the fingerprint inside the FMU at ``path``, 64 hexadecimal digits; ``None`` where there is none."""
    try:
        with zipfile.ZipFile(path) as archive:
            found = _STAMP.search(archive.read("modelDescription.xml"))
    except DAMAGE:
        return None
    return found[1].decode() if found else None


def _is_damaged(path: Path) -> bool:
    """Whether an archive is not whole, by the sums in it."""
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.testzip() is not None
    except DAMAGE:
        return True


def _build(recipe: Recipe, path: Path, current: str) -> None:
    """Run the worker; it writes beside ``path`` and renames, so that two builds at a time do no harm."""
    request = {
        "name": recipe.name,
        "module": recipe.module,
        "class_name": recipe.class_name,
        "starts": dict(recipe.starts),
        "target": str(path.absolute()),
        "fingerprint": current,
    }
    inherited = os.environ.get("PYTHONPATH")
    paths = [str(ROOT), *([inherited] if inherited else [])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"}
    run = run_tool([sys.executable, "-m", "orchestrator.building.worker"], None, environment, json.dumps(request))
    if run.returncode != 0:
        lines = run.stderr.strip().splitlines() or ["no message"]
        raise FmuError(f"cannot build {recipe.name}: {lines[-1]}")
