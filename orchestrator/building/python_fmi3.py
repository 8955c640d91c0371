"""Builds FMUs of FMI 3.0 that run Python: the C of native FMUs around a slave that stays Python.

The archive has the modules of a Python FMU of FMI 2.0 and a library of its own, which needs the C library alone and
finds a Python as the launcher does. There is one for Linux; FMUs for other platforms are native.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from orchestrator.building.archive import write_archive
from orchestrator.building.build import bring_up_to_date, default_directory, python_toolchain
from orchestrator.building.documentation import documentation
from orchestrator.building.fmi3_description import fmi3_description
from orchestrator.building.fmi3_files import terminals_and_icons
from orchestrator.building.launcher import Toolchain, compile_host, find_toolchain
from orchestrator.building.native_description import native_description
from orchestrator.building.native_sources import OF_FMI3, RUNTIME, count_tables, indicator_total, slave_class
from orchestrator.building.reference_files import reference_files
from orchestrator.building.sources import BRIDGE, PLACEHOLDER, Recipe, digest, fingerprint, recipes_of
from orchestrator.building.stamping import content_guid, final_text, stamp
from orchestrator.building.starts import default_starts
from orchestrator.building.translation.slave import has_states, variable_table
from orchestrator.building.worker import ENTRY, pythonfmu_license, runtime_files
from orchestrator.errors import FmuError
from orchestrator.shared.equation_files import members as source_members

PLATFORM = "x86_64-linux"
_SOURCE = """#define _GNU_SOURCE
#include "translated.h"
#include "slave_types.h"

#define PACKAGE "{package}"
#define VARIABLES {variables}
#define STATES_COUNT {states}
#define RESULTS {results}
#define FEEDTHROUGH {feedthrough}
#define GUID "{token}"
{settings}

{tables}

#include "python_slave.h"
#include "fmi3_slave.h"
"""


def ensure_python_fmi3(
    names: Sequence[str] | None = None, directory: Path | None = None, force: bool = False
) -> dict[str, Path]:
    """Return the path of each FMU of FMI 3.0 that runs Python (default: all), after building what is missing or stale.

    Args:
        directory: where they are (default: ``fmi3/`` beside those of FMI 2.0).
    """
    folder = default_directory(3) if directory is None else directory
    return {recipe.name: _ensure(recipe, folder, force) for recipe in recipes_of(names)}


def _ensure(recipe: Recipe, directory: Path, force: bool) -> Path:
    toolchain = find_toolchain()
    if toolchain.compiler is None:
        raise FmuError("Python FMUs of FMI 3.0 need a C compiler (cc) on Linux x86_64, but there is none")
    current = fingerprint(recipe, "FMI 3.0", *python_toolchain(toolchain))
    return bring_up_to_date(directory / f"{recipe.name}.fmu", current, force, partial(_build, recipe, toolchain))


def _build(recipe: Recipe, toolchain: Toolchain, path: Path, current: str) -> None:
    cls = slave_class(recipe, fmi=3)
    package, members = _modules(recipe)
    members |= documentation(recipe, native_description(recipe, cls, 0), fmi=3)
    members |= reference_files(recipe, native_description(recipe, cls, 0))
    members["documentation/licenses/PythonFMU.txt"] = pythonfmu_license()
    members["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_and_icons(cls)
    description = fmi3_description(cls, recipe.name, native=False)
    stamp(description, current)
    source = _source(cls, package, PLACEHOLDER)
    token = content_guid(description, members | {"slave.c": source})
    files = {name: (RUNTIME / name).read_bytes() for name in OF_FMI3}
    files["slave.c"] = _source(cls, package, token)
    members[f"binaries/{PLATFORM}/{recipe.name}.so"] = compile_host(toolchain, "slave.c", files)
    write_archive(path, members | {"modelDescription.xml": final_text(description, token)})


def _modules(recipe: Recipe) -> tuple[str, dict[str, bytes]]:
    """Return the package of all modules and its members; its name carries a hash of its content."""
    starts = default_starts(recipe.plain) | dict(recipe.starts)
    sources = source_members(recipe.module) | source_members(BRIDGE)
    sources |= {f"pythonfmu/{name}": data for name, data in runtime_files().items()}
    content = [part for name in sorted(sources) for part in (name.encode(), sources[name])]
    identity = digest([json.dumps([recipe.name, sorted(starts.items())]).encode(), ENTRY.encode(), *content])
    package = f"pyfmu_{identity[:16]}"
    named = {"module": recipe.module, "class_name": recipe.class_name, "name": recipe.name, "starts": starts}
    entry = ENTRY.format(**named, build=identity[:16], learn="")
    sources |= {"entry.py": entry.encode(), "__init__.py": b'"""The sources of one FMU."""\n'}
    return package, {f"resources/{package}/{name}": data for name, data in sources.items()}


def _source(cls: Any, package: str, token: str) -> bytes:
    """Return the C of one FMU: tables and settings, around them what all FMUs have."""
    states = len(cls.continuous_states) if has_states(cls) else 0
    outputs = getattr(cls, "response_outputs", ())
    indicators = indicator_total(cls)
    names = [variable.name for variable in cls.table]
    settings = []
    if states:
        nominals = ", ".join(repr(float(nominal)) for _, _, nominal, _ in cls.continuous_states)
        rated = ", ".join(str(names.index(name)) for name in outputs)
        settings += [
            f"#define CONTINUOUS_STATES {states}",
            f"#define INDICATORS {indicators}",
            f"#define FIRST_STATE {names.index(cls.continuous_states[0][0])}",
            f"static const double nominals[] = {{{nominals}}};",
            f"#define OUTPUT_RATES {len(outputs)}",
            f"static const Reference rated_outputs[] = {{{rated}}};",
        ]
    if hasattr(cls, "begin_exchange"):
        settings.append("#define BEGIN_EXCHANGE")
    if getattr(cls, "follows_inputs", False):
        settings.append("#define FOLLOWS_INPUTS")
    if cls.sample_time_reference is not None:
        settings.append(f"#define SAMPLE_TIME {cls.sample_time_reference}")
    return _SOURCE.format(
        package=package,
        variables=len(cls.table),
        states=states,
        results=max(states, len(outputs), indicators),
        feedthrough=int(cls.feedthrough),
        token=token,
        settings="\n".join(settings),
        tables=f"{variable_table(cls)}\n\n{count_tables(cls)}",
    ).encode()
