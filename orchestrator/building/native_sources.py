"""The C sources of a native FMU: one file made from the slave's Python, and the runtime around it."""

from __future__ import annotations

import importlib
import re
import textwrap
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, get_type_hints

from orchestrator.building.arrays import arrays
from orchestrator.building.fmi3_description import INDICATOR
from orchestrator.building.sources import Recipe
from orchestrator.building.starts import default_starts
from orchestrator.building.translation.kinds import Tuple, kind_of
from orchestrator.building.translation.slave import has_states, translate_slave
from orchestrator.errors import FmuError
from orchestrator.shared.equation_files import members
from pyfmu_sources.adapters.fmu_variables import FmuVariable

RUNTIME = Path(__file__).parent / "native_fmu"
_CORE = ("log_categories.h", "slave_core.h", "slave_states.h", "slave_exchange.h")
HEADERS = ("translated.h", "pairs.h", "slave_types.h", *_CORE)
_OF_VERSION = {
    2: ("fmi2_types.h", "fmi2_slave.h", "fmi2_model_exchange.h"),
    3: (
        "fmi3_types.h",
        "fmi3_modes.h",
        "fmi3_slave.h",
        "fmi3_clock.h",
        "fmi3_steps.h",
        "fmi3_updates.h",
        "fmi3_absent.h",
    ),
}
_FILE = """/* {name}: {title}
 *
 * Made by backlash-cosim from {files}:
 * the physics below is those Python files, function by function. Compile this one file; it needs the C library only.
 * Without contraction of products and sums (-ffp-contract=off) it computes the same bits as Python does. */

#include "translated.h"

{types}

{constants}

{prototypes}

{definitions}

/* {line} */
/* What the runtime has to know of this slave. */

#include "slave_types.h"

{tables}

#define GUID "{guid}"

#include "fmi{fmi}_slave.h"
"""


def slave_class(recipe: Recipe, fmi: int = 2, real_outputs: bool = False) -> Any:
    """Return the adapter of a recipe with the recipe's name and start values, as a class of its own.

    Args:
        fmi: version of FMI, 2 or 3; in the latter event indicators are variables too.
        real_outputs: outputs that are no real numbers become local variables.
    """
    try:
        base = getattr(importlib.import_module(f"pyfmu_sources.{recipe.module}"), recipe.class_name)
        cls: Any = type(base.__name__, (base,), {"__module__": base.__module__, "__doc__": base.__doc__})
        cls.customise(recipe.name, "native", default_starts(recipe.class_name) | dict(recipe.starts))
    except ValueError as error:
        raise FmuError(str(error)) from None
    except Exception as error:  # whatever is wrong in a source of the user's own
        raise FmuError(f"cannot build {recipe.name}: {type(error).__name__}: {error}") from None
    if real_outputs:
        cls.table = tuple(_hide_whole_output(variable) for variable in cls.table)
    cls.table = (*cls.table, *_state_variables(cls), *(_indicators(cls) if fmi == 3 else ()))
    cls._index()
    return cls


def _hide_whole_output(variable: FmuVariable) -> FmuVariable:
    whole = variable.causality == "output" and variable.type != "Real"
    return variable._replace(causality="local") if whole else variable


def _state_variables(cls: Any) -> Iterator[FmuVariable]:
    """Yield the variables by which model exchange names states and derivatives."""
    states = getattr(cls, "continuous_states", ())
    jumping = getattr(cls, "jumping_states", ())
    for name, unit, nominal, text in states:
        yield FmuVariable(name, "local", unit, None, text, nominal=nominal, reinit=name in jumping)
    for name, unit, _, text in states:
        rate = {"rad": "rad/s", "rad/s": "rad/s2", "N.m": "N.m/s", "1": "1/s"}.get(unit, f"{unit}/s")
        yield FmuVariable(f"der({name})", "local", rate, None, f"Rate of: {text}", derivative_of=name)


def indicator_total(cls: Any) -> int:
    """Return how many event indicators a slave has."""
    if not hasattr(cls, "indicators"):
        return 0
    kind = kind_of(get_type_hints(cls.indicators, include_extras=True)["return"])
    assert isinstance(kind, Tuple)
    return len(kind.items)


def _indicators(cls: Any) -> Iterator[FmuVariable]:
    for n in range(1, indicator_total(cls) + 1):
        yield FmuVariable(f"{INDICATOR}[{n}]", "local", description="Positive until an event ends the mode")


def c_sources(recipe: Recipe, cls: Any, guid: str, fmi: int = 2) -> dict[str, bytes]:
    """Return the members of ``sources/`` for a version of FMI, 2 or 3: file name to content."""
    translated = translate_slave(cls, _runtime_names(), fmi)
    files = ", ".join(name for name in sorted(members(recipe.module)) if Path(name).stem not in _PYTHON_ONLY)
    text = _FILE.format(
        name=recipe.name,
        title=cls.title,
        files="\n * ".join(textwrap.wrap(files, 110)),
        line="-" * 110,
        guid=guid,
        fmi=fmi,
        types=translated.types,
        constants=translated.constants,
        prototypes=translated.prototypes,
        definitions=translated.definitions,
        tables=translated.tables + (f"\n\n{_count_tables(cls)}" if fmi == 3 else ""),
    )
    needed = [name for name in (*HEADERS, *_OF_VERSION[fmi]) if _is_needed(name, cls, translated.types)]
    headers = {name: (RUNTIME / name).read_bytes() for name in needed}
    return {f"{recipe.name}.c": text.encode("utf-8"), **headers}


def _is_needed(header: str, cls: Any, types: str) -> bool:
    if header in ("slave_exchange.h", "fmi2_model_exchange.h", "fmi3_updates.h"):
        return has_states(cls)
    return header != "pairs.h" or '"pairs.h"' in types


def _count_tables(cls: Any) -> str:
    """Return the C tables that ``fmi3_slave.h`` asks for, and where event indicators stand."""
    counts, scalars = [0] * len(cls.table), [0] * len(cls.table)
    indicators = ""
    for array in arrays(cls.table):
        counts[array.first] = len(array.variables)
        if array.name == INDICATOR:
            indicators = f"\n#define FIRST_INDICATOR {array.first}"
        first = array.variables[0]
        if len(array.variables) == 1 and first.type == "Real":
            scalars[array.first] = _SCALARS.get(first.causality, 0)
    return _numbers("unsigned short counts", counts) + "\n" + _numbers("unsigned char scalars", scalars) + indicators


_SCALARS = {"output": 1, "input": 1 | 2, "parameter": 1 | 4}


def _numbers(declared: str, values: list[int]) -> str:
    lines = textwrap.fill(", ".join(map(str, values)), 110, initial_indent="    ", subsequent_indent="    ")
    return f"static const {declared}[] = {{\n{lines}}};"


_PYTHON_ONLY = ("slave_base", "sampled_slave", "fmu_variables", "hidden_state", "model_xml", "__init__")


@cache
def _runtime_names() -> frozenset[str]:
    """Return every identifier in the runtime's code, so that translated names keep clear of them."""
    names: set[str] = set()
    for file in (*HEADERS, *_OF_VERSION[2], *_OF_VERSION[3]):
        text = re.sub(r"/\*.*?\*/|\"[^\"\n]*\"", " ", (RUNTIME / file).read_text(encoding="utf-8"), flags=re.DOTALL)
        names |= set(re.findall(r"[A-Za-z_]\w*", text))
    return frozenset(names)
