"""Builds native FMUs: the same slaves, translated to C and compiled, so that they need no Python at run time.

In all functions: ``fmi``: version of FMI, 2 or 3. ``real_outputs``: outputs that are no real numbers become local
variables, for hosts that read every output as a real number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from pathlib import Path

from orchestrator.building.archive import write_archive
from orchestrator.building.build import bring_up_to_date, default_directory
from orchestrator.building.compilers import FLAGS, TARGETS, Compiler, compile_library, find_compiler
from orchestrator.building.documentation import documentation
from orchestrator.building.fmi3_description import fmi3_description
from orchestrator.building.fmi3_files import build_description, terminals_and_icons
from orchestrator.building.native_description import native_description
from orchestrator.building.native_sources import c_sources, indicator_total, slave_class
from orchestrator.building.reference_files import reference_files
from orchestrator.building.sources import PLACEHOLDER, Recipe, fingerprint, recipes_of
from orchestrator.building.stamping import content_guid, final_text, stamp
from orchestrator.errors import FmuError
from orchestrator.shared.cores import usable_cores

NO_COMPILER = "native FMUs need a C compiler: install one (cc), or `pip install 'backlash-cosim[native]'` for zig"


def native_directory(fmi: int = 2, real_outputs: bool = False) -> Path:
    """Return where native FMUs live, in folders of their own beside the others, because they have the same names."""
    folder = default_directory() / ("native" if fmi == 2 else "fmi3")
    return folder / "real" if real_outputs else folder


def ensure_native(
    names: Sequence[str] | None = None,
    directory: Path | None = None,
    force: bool = False,
    here: bool = False,
    fmi: int = 2,
    real_outputs: bool = False,
    versions: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> dict[str, Path]:
    """Return the path of each native FMU in ``names`` (default: all), after building what is missing or stale.

    Args:
        here: for this platform alone, with the local compiler where there is one: a second instead of half a minute.
        versions: FMUs of other sources stay beside them, each in a folder of its own.
        progress: called after each FMU with what was done, and the share of all.
    """
    folder = native_directory(fmi) if directory is None else directory
    build = partial(
        _ensure, directory=folder, force=force, here=here, fmi=fmi, real_outputs=real_outputs, versions=versions
    )
    recipes = list(recipes_of(names))
    with ThreadPoolExecutor(usable_cores()) as pool:  # each waits for a compiler most of its time
        jobs = {pool.submit(build, recipe): recipe.name for recipe in recipes}
        try:
            for n, job in enumerate(as_completed(jobs), start=1):
                job.result()
                if progress is not None:
                    progress(f"built {jobs[job]}", n / len(jobs))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    paths = {name: job.result() for job, name in jobs.items()}
    return {recipe.name: paths[recipe.name] for recipe in recipes}


def build_native(recipe: Recipe, directory: Path, fmi: int = 2) -> Path:
    """Return the native FMU of a recipe of one's own, for this platform; its sources are in it."""
    return _ensure(recipe, directory, force=False, here=True, fmi=fmi, real_outputs=False, versions=False)


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


def _ensure(
    recipe: Recipe, directory: Path, force: bool, here: bool, fmi: int, real_outputs: bool, versions: bool
) -> Path:
    compiler = find_compiler(here)
    if compiler is None:
        raise FmuError(NO_COMPILER)
    targets = [str(target.zig) for target in compiler.targets]
    current = fingerprint(recipe, "native", f"{fmi} {real_outputs}", compiler.identity, *FLAGS, *targets)
    directory = directory / current[:16] if versions else directory
    build = partial(_build, recipe, compiler, fmi, real_outputs)
    return bring_up_to_date(directory / f"{recipe.name}.fmu", current, force, build)


def _build(recipe: Recipe, compiler: Compiler, fmi: int, real_outputs: bool, path: Path, current: str) -> None:
    cls = slave_class(recipe, fmi, real_outputs)
    sources = c_sources(recipe, cls, PLACEHOLDER, fmi)
    folders = {target: target.folders(fmi) for target in compiler.targets}
    description = native_description(recipe, cls, indicator_total(cls))
    members = documentation(recipe, description, [name for names in folders.values() for name in names], fmi)
    members |= reference_files(recipe)
    if fmi == 3:
        description = fmi3_description(cls, recipe.name)
        sources["buildDescription.xml"] = build_description(recipe.name)
        members["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_and_icons(cls)
    stamp(description, current)
    guid = content_guid(description, members | {f"sources/{name}": data for name, data in sources.items()})
    sources = {name: data.replace(PLACEHOLDER.encode(), guid.encode()) for name, data in sources.items()}
    members |= {f"sources/{name}": data for name, data in sources.items()}
    for target in compiler.targets:
        library = compile_library(compiler, target, recipe.name, sources)
        members |= {f"binaries/{folder}/{recipe.name}{target.suffix}": library for folder in folders[target]}
    write_archive(path, members | {"modelDescription.xml": final_text(description, guid)})
