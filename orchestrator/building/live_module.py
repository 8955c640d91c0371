"""FMUs as a WebAssembly module that simulates them inside a page: the same C as in the native FMUs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from orchestrator.building.compilers import FLAGS, WEB_FLAGS, Compiler, compile_web_module, find_compiler
from orchestrator.building.native_build import native_fingerprint
from orchestrator.building.native_sources import RUNTIME, c_sources, slave_class
from orchestrator.building.sources import digest, recipe_of
from orchestrator.building.translation.functions import translate
from orchestrator.building.translation.program import Program
from orchestrator.errors import FmuError
from orchestrator.shared.cache import cache_directory
from orchestrator.shared.output import write_whole
from pyfmu_sources import riccati

MASTER = "live.c"
_FUNCTIONS = {
    "instantiate": "Instantiate",
    "release": "FreeInstance",
    "setup": "SetupExperiment",
    "enter": "EnterInitializationMode",
    "leave": "ExitInitializationMode",
    "step": "DoStep",
    "get_real": "GetReal",
    "get_integer": "GetInteger",
    "set_real": "SetReal",
    "set_integer": "SetInteger",
}
_PART = '#define FMI2_FUNCTION_PREFIX {name}_\n#include "{name}.c"\n'
_REGULATOR = """#include "translated.h"

{types}

{constants}

{prototypes}

{definitions}

/* Gains from a state matrix, an input vector, the states' weights and the input's; false where there are none. */
int live_regulator(const double *given, double *gains);
int live_regulator(const double *given, double *gains)
{{
    Fault fault = {{NO_FAULT, ""}};
    Square A = {{25, {{0.0}}}};
    Gains B, weights;
    memcpy(A.v, given, sizeof A.v);
    memcpy(B.v, given + 25, sizeof B.v);
    memcpy(weights.v, given + 30, sizeof weights.v);
    const Gains found = regulator_gains(&A, B, weights, given[35], &fault);
    memcpy(gains, found.v, sizeof found.v);
    return !fault.kind;
}}
"""
_EXPORTED = """
int live_regulator(const double *given, double *gains);
__attribute__((export_name("live_gains"))) int live_gains(const double *given, double *gains)
{
    return live_regulator(given, gains);
}
"""


def live_module(names: Sequence[str], regulator: bool = False) -> bytes | None:
    """Return the module of some FMUs, from the user's cache if it was made before; None where there is no zig."""
    compiler = find_compiler()
    if compiler is None or not compiler.is_zig:
        return None
    path = cache_directory("live") / f"{_fingerprint(names, regulator, compiler)}.wasm"
    try:
        return path.read_bytes()
    except OSError:
        pass
    module = compile_web_module(compiler, _sources(names, regulator))
    with suppress(OSError):  # a full disk: it is made again next time
        write_whole(path, module)
    return module


def _fingerprint(names: Sequence[str], regulator: bool, compiler: Compiler) -> str:
    parts = [native_fingerprint(recipe_of(name), compiler) for name in names]
    parts += [Path(riccati.__file__).read_text(encoding="utf-8"), Path(__file__).read_text(encoding="utf-8")]
    parts += [(RUNTIME / MASTER).read_text(encoding="utf-8"), *FLAGS, *WEB_FLAGS, str(regulator)]
    return digest([b"live", json.dumps(parts).encode()])


def _sources(names: Sequence[str], regulator: bool) -> dict[str, bytes]:
    """Return all sources by file name: those that are not included by others end in ``_part.c``."""
    sources = {MASTER: (RUNTIME / MASTER).read_bytes(), "live_fmus.h": _functions(names, regulator).encode()}
    for name in names:
        recipe = recipe_of(name)
        sources |= c_sources(recipe, slave_class(recipe), name)
        sources[f"{name}_part.c"] = _PART.format(name=name).encode()
    if regulator:
        program = Program(translate)
        program.function(None, None, riccati.regulator_gains)
        sources["regulator_part.c"] = _REGULATOR.format(
            types=program.types(),
            constants=program.constants(),
            prototypes=program.prototypes(),
            definitions=program.definitions(),
        ).encode()
    return sources


def _functions(names: Sequence[str], regulator: bool) -> str:
    """Return the C header that declares the FMUs' functions and lists them."""
    lines, rows = [], []
    for name in names:
        lines += [f"extern __typeof__(*((Fmu *)0)->{field}) {name}_fmi2{f};" for field, f in _FUNCTIONS.items()]
        rows.append(f'    {{"{name}", {", ".join(f"{name}_fmi2{f}" for f in _FUNCTIONS.values())}}},')
    text = "\n".join([*lines, "static const Fmu fmus[] = {", *rows, "};"])
    return text + (_EXPORTED if regulator else "\n")


__all__ = ["FmuError", "live_module"]
