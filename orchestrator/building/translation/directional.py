"""Directional derivatives of a slave: its response translated to pairs of value and derivative (forward mode)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from orchestrator.building.translation.definitions import Function, Owner
from orchestrator.building.translation.functions import translate
from orchestrator.building.translation.kinds import REAL, WHOLE, Kind, Tuple
from orchestrator.building.translation.program import Program
from orchestrator.errors import FmuError


@dataclass(frozen=True)
class Directional:
    """The program of pairs, and the C function by which the runtime calls it."""

    program: Program
    hook: str


def directional(plain: Program, owner: Owner) -> Directional:
    """Translate the response of a slave: derivatives and outputs as a function of states and inputs."""
    cls = owner.cls
    program = Program(translate, taken=frozenset({cls.__name__}), neighbours=plain)
    function = program.function(None, None, cls.response)
    states, outputs = len(cls.continuous_states), cls.response_outputs
    if function.returns != Tuple((Tuple((REAL,) * states), Tuple((REAL,) * len(outputs)))):
        raise FmuError(f"`{cls.__name__}.response` must return {states} derivatives and {len(outputs)} outputs")
    names = [variable.name for variable in cls.table]
    first = names.index(cls.continuous_states[0][0])
    given = [_argument(program, owner, name, kind, first) for name, kind in function.parameters]
    arguments = [_pass_argument(function, name) for name, _ in function.parameters] + (
        ["fault"] if function.faults else []
    )
    lines = [line for part in given for line in part]
    lines += [] if function.faults else ["(void)fault;"]
    lines.append(f"const {program.names.c(function.returns)} found = {function.c}({', '.join(arguments)});")
    fields = ("v[0]", "v[1]") if function.returns.uniform else ("first", "second")
    for field, start, count in zip(fields, (0, states), (states, len(outputs)), strict=True):
        place = f"directional_unknowns[{start} + n]" if start else "directional_unknowns[n]"
        lines += [f"for (int n = 0; n < {count}; n++)", f"    sensitivities[{place}] = found.{field}.v[n].d;"]
    body = "\n".join(f"    {line}" for line in lines)
    references = [*range(first + states, first + 2 * states), *(names.index(name) for name in outputs)]
    table = f"static const Reference directional_unknowns[] = {{{', '.join(map(str, references))}}};"
    parameters = f"{cls.__name__} *self, const double seeds[], double sensitivities[], Fault *fault"
    head = f"#define DIRECTIONAL {len(references)}\n{table}\n\nstatic void slave_directional({parameters})"
    return Directional(program, f"{head}\n{{\n{body}\n}}")


def _argument(program: Program, owner: Owner, name: str, kind: Kind, first_state: int) -> list[str]:
    """Return the statements that make a pair of an attribute or an input."""
    cls: Any = owner.cls
    local = program.local_name(name)
    own = owner.attributes.get(f"_{name}")
    attribute = f"self->{program.attribute_name(f'_{name}')}"
    if own is None:
        inputs = [variable.name if variable.causality == "input" else "" for variable in cls.table]
        if name not in inputs or kind != REAL:
            raise FmuError(f"`{name}` of `{cls.__name__}.response` must be a hidden attribute or a Real input")
        place = inputs.index(name)
        return [f"const Pair {local} = {{self->real[{place}], seeds[{place}]}};"]
    if isinstance(own, Tuple) and not own.names and own.items == (REAL,) * len(own.items):
        count = len(own.items)
        seed = f"seeds[{first_state} + n]" if f"_{name}" == cls.state_attribute else "0.0"
        return [
            f"{program.names.c(kind)} {local};",
            f"for (int n = 0; n < {count}; n++)",
            f"    {local}.v[n] = (Pair){{{attribute}.v[n], {seed}}};",
        ]
    if own == kind and isinstance(kind, Tuple) and kind.names:
        return [f"const {program.names.c(kind)} *const {local} = &{attribute};"]
    if own == kind == WHOLE:
        return [f"const {program.names.c(kind)} {local} = {attribute};"]
    if own == kind and isinstance(kind, Tuple) and REAL not in kind.items:
        return [f"{program.names.c(kind)} {local};", f"memcpy(&{local}, &{attribute}, sizeof {local});"]
    raise FmuError(f"`{name}` of `{cls.__name__}.response` must be of floats alone, or of none")


def _pass_argument(function: Function, name: str) -> str:
    kind = dict(function.parameters)[name]
    if isinstance(kind, Tuple) and kind.names:  # a pointer already
        return name if name in function.by_address else f"*{name}"
    return f"&{name}" if name in function.by_address else name
