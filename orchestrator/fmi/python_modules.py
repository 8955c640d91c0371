"""Modules of FMUs that run Python: each instance has its own, whatever others call theirs.

Such an FMU puts its ``resources`` at the head of ``sys.path`` and imports by bare names, and Python keeps one module of
a name in a process. Two FMUs that share a name, such as two versions of a model or a helper file, would both run the
code of whichever was made first; PythonFMU puts a package of its own into every FMU, too. So the modules of an
instance stand in ``sys.modules`` while it is made, and whenever its code imports something later, in place of those of
the same name that others have. Afterwards what is this process's own is back; of FMUs, the newest of a name stays.
"""

import builtins
import functools
import importlib
import importlib.util
import os
import pkgutil
import sys
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

_lock = threading.RLock()
_live: list["PythonModules"] = []
_owners: dict[int, "PythonModules"] = {}  # by the identity of a module's namespace
_import = builtins.__import__
# What finds modules by their names, besides ``import``: data files of packages are read through these.
_LOOKUPS = {importlib: ("import_module", "reload"), importlib.util: ("find_spec",), pkgutil: ("get_data",)}


class PythonModules:
    """The modules of one instance.

    Args:
        folder: where its modules lie, put at the head of ``sys.path`` when it is made.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = os.path.realpath(folder)
        self._offered = _names_of_modules(folder)
        self._modules: dict[str, ModuleType] = {}
        self._paths: list[str] = []
        self._placed = False

    @contextmanager
    def place(self) -> Iterator[None]:
        """Let imports find the modules of this instance and none of another."""
        with _lock:
            if self._placed:
                yield
                return
            _watch_imports()
            if self not in _live:
                _live.append(self)
            others = {id(m) for o in _live if o is not self for m in o._modules.values()}
            away = {n: m for n, m in sys.modules.items() if id(m) in others or _top(n) in self._offered}
            for name in away:
                del sys.modules[name]
            sys.modules.update(self._modules)
            known, paths = set(sys.modules), list(sys.path)
            sys.path[:0] = self._paths
            self._placed = True
            try:
                yield
            finally:
                self._placed = False
                self._keep(known, paths)
                for name, module in away.items():
                    mine = self._modules.get(name)
                    if mine is None or (mine is not module and id(module) not in others):
                        sys.modules[name] = module

    def needs_place(self, name: str, parts: Collection[str]) -> bool:
        """Return whether an import of ``parts`` from ``name`` may find what is not of this instance, or is new."""
        found = sys.modules.get(name)
        if found is None or self._modules.get(name, found) is not found:
            return True
        return any(not hasattr(found, p) for p in parts) or (_top(name) in self._offered and name not in self._modules)

    def release(self) -> None:
        """Forget the modules, once the instance is freed."""
        with _lock:
            if self in _live:
                _live.remove(self)
            for name, module in self._modules.items():
                _owners.pop(id(vars(module)), None)
                if sys.modules.get(name) is module:
                    del sys.modules[name]
            self._modules = {}

    def _keep(self, known: set[str], paths: list[str]) -> None:
        """Keep the modules, and the entries of ``sys.path``, that have come from the folder."""
        for name, module in list(sys.modules.items()):
            if name not in known and any(map(self._holds, _places(module))):
                self._modules[name] = module
                _owners[id(vars(module))] = self
        more = [path for path in sys.path if path not in paths and path not in self._paths and self._holds(path)]
        self._paths[:0] = list(dict.fromkeys(more))
        sys.path[:] = [path for path in sys.path if path not in self._paths]

    def _holds(self, path: str) -> bool:
        real = os.path.realpath(path)
        return real == self._folder or real.startswith(self._folder + os.sep)


def _top(name: str) -> str:
    return name.partition(".")[0]


def _names_of_modules(folder: Path) -> frozenset[str]:
    """Return the names of modules and packages in a folder, but those of packages with machine code.

    The latter, such as a copy of NumPy, can be loaded once per process: what this process has of them is shared.
    """
    found = {path.stem for path in folder.glob("*.py")}
    for package in folder.glob("*/"):
        if not any(next(package.rglob(ending), None) for ending in ("*.so", "*.pyd", "*.dylib")):
            found.add(package.name)
    return frozenset(found)


def _places(module: ModuleType) -> list[str]:
    """Return the files and folders that a module says to be from."""
    spec = getattr(module, "__spec__", None)
    places = [getattr(spec, "origin", None), getattr(module, "__file__", None)]
    return [p for p in (*places, *(getattr(spec, "submodule_search_locations", None) or ())) if isinstance(p, str)]


def _watch_imports() -> None:
    """Look at who imports, from now on in this process."""
    if builtins.__import__ is _import_for_owner:
        return
    builtins.__import__ = _import_for_owner
    for module, names in _LOOKUPS.items():
        for name in names:
            setattr(module, name, _look_up_for_owner(getattr(module, name)))


def _owner_of(frame: FrameType | None) -> PythonModules | None:
    """Return whose code runs in a frame, or has called it: a library may import on behalf of an FMU."""
    while frame is not None:
        owner = _owners.get(id(frame.f_globals))
        if owner is not None:
            return owner
        frame = frame.f_back
    return None


def _import_for_owner(
    name: str,
    globals: Mapping[str, Any] | None = None,  # noqa: A002 - Python's own names
    locals: Mapping[str, Any] | None = None,  # noqa: A002
    fromlist: Any = (),
    level: int = 0,
) -> Any:
    owner = _owners.get(id(globals)) or _owner_of(sys._getframe(1))
    if owner is None or not (level or owner.needs_place(name, fromlist or ())):
        return _import(name, globals, locals, fromlist, level)
    with owner.place():
        return _import(name, globals, locals, fromlist, level)


def _look_up_for_owner(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that looks among the modules of whoever calls it."""

    @functools.wraps(function)
    def look_up(*arguments: Any, **named: Any) -> Any:
        owner = _owner_of(sys._getframe(1))
        with nullcontext() if owner is None else owner.place():
            return function(*arguments, **named)

    return look_up
