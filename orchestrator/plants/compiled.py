"""The plant's, controller's and estimator's own source, compiled by numba.

The functions of ``pyfmu_sources`` are plain Python on floats and tuples. Here each is compiled in a private copy of
its module, whose names lead to the compiled functions, so that the FMU and the orchestrator share one source.

The copies lie in the user's cache directory, each in a folder named by a hash of what it needs: numba keeps its machine
code beside them, and a changed source can never meet machine code made from an older one.
"""

import hashlib
import importlib.util
import inspect
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numba

from orchestrator.shared.cache import cache_directory
from orchestrator.shared.cores import cache_once
from orchestrator.shared.equation_files import PACKAGE, closure, module_name
from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED, njit_on_disk
from orchestrator.shared.output import write_whole

INLINED = ("rates", "elastic_torque", "motor_torque", "load_torque")
"""Functions whose call costs more than their body: every stage of every step makes it."""

FORMULAS = ("axis_equations", "equations", "laws.friction", "laws.shaft", "laws.stops", "laws.waves")
"""Modules of the plants' own equations, which every stage of every step runs."""

LISTING = ("attachment", "backlash_estimator", "dead_time", "linear_mode")
"""Modules whose functions make lists: references to those are counted, there and in modules that call them."""


@cache_once
def compile_module(name: str) -> ModuleType:
    """Return a copy of ``pyfmu_sources.NAME`` whose functions are compiled by numba (at their first call)."""
    full_name = f"_compiled_{name}"
    original = f"{PACKAGE}.{name}"
    path = _copy_source(name)
    spec = importlib.util.spec_from_file_location(original, path)
    assert spec is not None
    assert spec.loader is not None
    copy = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(copy)
    copy.__name__ = full_name
    sys.modules[full_name] = copy
    options = _options(name)
    for attribute, value in list(vars(copy).items()):
        if not inspect.isfunction(value):
            continue
        home = value.__module__.removeprefix(f"{PACKAGE}.")
        if home == name:
            value.__module__ = full_name
            setattr(copy, attribute, njit_on_disk(forceinline=attribute in INLINED, **options)(value))
        elif value.__module__.startswith(PACKAGE + "."):
            setattr(copy, attribute, getattr(compile_module(home), value.__name__))
    return copy


def _options(name: str) -> dict[str, Any]:
    """Return the further options with which numba compiles a module's functions."""
    formulas = ALGEBRA if name in FORMULAS else {}
    return formulas if set(_modules(name)) & set(LISTING) else {**formulas, **UNCOUNTED}


@cache
def _copy_source(name: str) -> Path:
    """Return the copy of a source in a folder named by a hash of it and of all that it imports."""
    digest = hashlib.sha256(numba.__version__.encode())
    for module, path in _modules(name).items():
        digest.update(repr(_options(module)).encode())
        digest.update(path.read_bytes())
    folder = cache_directory("numba") / digest.hexdigest()[:20]
    folder.mkdir(exist_ok=True)
    target = folder / f"{name}.py"
    source = _modules(name)[name].read_bytes()
    try:
        intact = target.read_bytes() == source
    except OSError:
        intact = False
    if not intact:
        write_whole(target, source)
    return target


def _modules(name: str) -> dict[str, Path]:
    """Return the file of a module and of each that it imports, by name, in order."""
    return {module_name(path): path for path in closure(name)}
