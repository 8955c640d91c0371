"""A shared library of kernels: the C text of modules of the subset, with a function for each that callers may use.

A kernel module lists what it offers in ``__all__``: functions of numbers and arrays (:mod:`kernel_arrays`) that return
nothing or a number. One written for the names of another module can be bound to a third: ``a[b]`` is module ``a`` in
which every name that it imports from its ``SLOTS`` is that of module ``b``; what ``b`` lacks, ``DEFAULTS`` has.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from orchestrator.building.translation.definitions import Function
from orchestrator.building.translation.functions import translate
from orchestrator.building.translation.kinds import NOTHING, REAL, TRUTH, WHOLE, ArrayKind, Kind, Scalar, describe
from orchestrator.building.translation.program import Program
from orchestrator.building.translation.source import read_source
from pyfmu_sources.hybrid.syntax import parse_python

HEADERS = tuple(Path(__file__).parents[1] / "native_fmu" / name for name in ("translated.h", "kernel.h"))
_NUMBERS: dict[Kind, str] = {REAL: "double", WHOLE: "int64_t", TRUTH: "bool"}


def bind_module(name: str) -> ModuleType:
    """Return the module of a name, which may be bound: ``orchestrator.plants.motion[some.plant]``."""
    if name in sys.modules:
        return sys.modules[name]
    if not name.endswith("]"):
        return importlib.import_module(name)
    template, _, binding = name[:-1].partition("[")
    given, original = bind_module(binding), importlib.import_module(template)
    path = original.__file__
    assert path is not None
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for node in parse_python(Path(path).read_bytes()).body:
        if isinstance(node, ast.ImportFrom) and node.module == module.SLOTS:
            for alias in node.names:
                setattr(module, alias.asname or alias.name, _slot(module, given, alias.name))
    sys.modules[name] = module
    return module


def _slot(module: Any, given: ModuleType, name: str) -> Any:
    """Return what a bound module has under a name of its default: the given module's, else that of all that lack it."""
    if hasattr(given, name):
        return getattr(given, name)
    return getattr(bind_module(f"{module.DEFAULTS}[{given.__name__}]"), name)


def library_text(name: str, checked: bool) -> str:
    """Return the C text of a library.

    Args:
        name: of the module, maybe bound.
        checked: arithmetic raises where Python does; else it goes on with infinities and NaN.
    """
    module, source = bind_module(name), read_source(name)
    program = Program(translate, checked=checked, taken=frozenset({"EXPORT"}))
    offered = []
    for entry in module.__all__:
        function = program.function(None, None, getattr(module, entry))
        for parameter, kind in [*function.parameters, ("", function.returns)]:
            if isinstance(kind, ArrayKind) or kind in _NUMBERS or (kind == NOTHING and not parameter):
                continue
            source.refuse(source.functions[entry], f"`{parameter or 'the result'}` of `{entry}` must be a number or an "
                          f"array, for callers can use it, but is {describe(kind)}")  # fmt: skip
        offered.append(function)
    parts = ['#include "kernel.h"', program.types(), program.constants(), program.prototypes(), program.definitions()]
    about = json.dumps([_describe_kernel(function) for function in offered])
    about = about.replace("\\", "\\\\").replace('"', '\\"')
    parts.append(f'EXPORT extern const char kernels[];\nEXPORT const char kernels[] = "{about}";')
    return "\n\n".join([*parts, *(_caller(function) for function in offered)]) + "\n"


def _describe_kernel(function: Function) -> list[Any]:
    """Return name, result and parameters (name, type, lengths, whether it is filled) of a kernel, for its callers."""
    parameters = [
        [name, kind.item.word, list(kind.shape), name in function.mutated]
        if isinstance(kind, ArrayKind)
        else [name, kind.word if isinstance(kind, Scalar) else "", None, False]
        for name, kind in function.parameters
    ]
    return [function.name, function.returns.word if isinstance(function.returns, Scalar) else "", parameters]


def _caller(function: Function) -> str:
    """Return the C function by which a kernel is called: numbers, pointers and lengths; it returns what was raised."""
    parameters, arguments = [], []
    for n, (_, kind) in enumerate(function.parameters):
        if isinstance(kind, ArrayKind):
            item = "double" if kind.item == REAL else "int64_t"
            lengths = [f"n{n}_{axis}" for axis in range(len(kind.shape))]
            parameters += [f"{item} *a{n}", *(f"int64_t {length}" for length in lengths)]
            name = f"{'Reals' if kind.item == REAL else 'Wholes'}{len(kind.shape)}"
            arguments.append(f"({name}){{a{n}, {{{', '.join(lengths)}}}}}")
        else:
            parameters.append(f"{_NUMBERS[kind]} a{n}")
            arguments.append(f"a{n}")
    parameters += ["void *result", "Fault *fault"]
    if function.faults:
        arguments.append("fault")
    call = f"{function.c}({', '.join(arguments)});"
    if function.returns != NOTHING:
        call = f"*({_NUMBERS[function.returns]} *)result = {call}"
    return (
        f"EXPORT int call_{function.name}({', '.join(parameters)});\n"
        f"EXPORT int call_{function.name}({', '.join(parameters)})\n{{\n    (void)result;\n"
        f"    fault->kind = NO_FAULT;\n    {call}\n    return (int)fault->kind;\n}}"
    )


def sources_of(name: str) -> list[Path]:
    """Return the files that a kernel module's C is made from: its own, and those of all that it names, by module."""
    packages = {"orchestrator", "pyfmu_sources", *(part.partition(".")[0] for part in re.split(r"[\[\]]+", name))}
    found: dict[str, Path] = {}
    waiting = [bind_module(name)]
    while waiting:
        here = waiting.pop()
        if here.__name__ in found or not here.__file__:
            continue
        found[here.__name__] = Path(here.__file__)
        homes = (other for other in _neighbours(here) if other.__name__.partition(".")[0] in packages)
        waiting += [other for other in homes if other.__name__ not in found]
    return [found[module] for module in sorted(found)]


def _neighbours(module: ModuleType) -> Iterator[ModuleType]:
    for value in vars(module).values():
        home = value if isinstance(value, ModuleType) else sys.modules.get(getattr(value, "__module__", None) or "")
        if home is not None:
            yield home


def library_stem(name: str, checked: bool) -> str:
    """Return the name of a library's file without what the platform adds; it changes whenever the C would."""
    parts = name.replace("]", "").split("[")
    return f"{'-'.join(part.rpartition('.')[2] for part in parts)}-{_digest(name, checked)}"


def _digest(name: str, checked: bool) -> str:
    digest = hashlib.sha256(f"{name} {checked}".encode())
    translator = sorted(Path(__file__).parent.glob("*.py"))
    for path in (*translator, *HEADERS, *sources_of(name)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:20]
