"""The plant's, controller's and estimator's own source, compiled by numba.

The functions of ``pyfmu_sources`` are plain Python on floats and tuples. Here each is compiled in a private copy of
its module, whose names lead to the compiled functions, so that the FMU and the orchestrator share one source.

The copies lie in the user's cache directory, in a folder named by a hash of all the sources: numba keeps its machine
code beside them, and a changed source can never meet machine code made from an older one.
"""

import hashlib
import importlib.util
import inspect
import os
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType

import numba

import pyfmu_sources

_PACKAGE = pyfmu_sources.__name__
_SOURCES = Path(pyfmu_sources.__file__).parent


@cache
def compiled(name: str) -> ModuleType:
    """Return a copy of ``pyfmu_sources.NAME`` whose functions are compiled by numba (at their first call).

    Raises:
        ModuleNotFoundError: there is no such source.
    """
    full_name = f"_compiled_{name}"
    original = f"{_PACKAGE}.{name}"
    path = _copied_sources() / f"{name}.py"
    if not path.exists():
        raise ModuleNotFoundError(original)
    spec = importlib.util.spec_from_file_location(original, path)
    assert spec is not None
    assert spec.loader is not None
    copy = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(copy)
    copy.__name__ = full_name
    sys.modules[full_name] = copy
    for attribute, value in list(vars(copy).items()):
        if not inspect.isfunction(value):
            continue
        home = value.__module__.rpartition(".")[2]
        if home == name:
            value.__module__ = full_name
            setattr(copy, attribute, numba.njit(cache=True)(value))
        elif value.__module__.startswith(_PACKAGE + "."):
            setattr(copy, attribute, getattr(compiled(home), attribute))
    return copy


@cache
def _copied_sources() -> Path:
    sources = sorted(_SOURCES.glob("*.py"))
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sources:
        digest.update(source.name.encode() + source.read_bytes())
    folder = _cache_root() / digest.hexdigest()[:20]
    folder.mkdir(exist_ok=True)
    for source in sources:
        target = folder / source.name
        if not target.exists():
            with tempfile.NamedTemporaryFile(dir=folder, delete=False) as part:
                part.write(source.read_bytes())
            os.replace(part.name, target)
    return folder


def _cache_root() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    root = Path(base) / "backlash-cosim" / "numba"
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError:
        return Path(tempfile.mkdtemp(prefix="backlash-cosim-"))
    return root
