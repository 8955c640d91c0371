"""A first map, from what an FMU says of itself: causality, units and names, and the columns of the record."""

from collections.abc import Mapping, Sequence

from orchestrator.diagnosis.fmu.subject import Subject
from orchestrator.master.protocol import Unit, Variable
from orchestrator.master.units import resolve

POWER, ENERGY = (1, 2, -3, 0, 0, 0, 0), (1, 2, -2, 0, 0, 0, 0)
"""Exponents (kg, m, s, A, K, mol, cd) of an effort times a flow, and of an effort times a position."""
SPREAD = "5 %"
MOST_PARAMETERS = 12
NO_PORT = (
    "# By its units no input is an effort whose product with an output is a power or an energy: no port is drafted.",
    "# Where one is, add [ports.NAME] with input = ..., and position = ..., velocity = ... or both.",
)


def drafted(subject: Subject, columns: Sequence[str], time: str = "time") -> str:
    """Return a map as TOML, to be looked over by its user."""
    model = subject.model
    reals = [v for v in model.variables.values() if v.type == "Real"]
    taken = {c.target for c in subject.connections}
    inputs = [v for v in reals if v.causality == "input" and v.name not in taken]
    outputs = [v for v in reals if v.causality == "output"]
    lines = [f"# Draft for {model.name}: look over columns, uncertainties and ports.", "[inputs]"]
    found = {v.name: _column(v, columns, time) for v in (*inputs, *outputs)}
    lines += [_entry(v, found[v.name], 'hold = "zero"') for v in inputs]
    lines += ["", "[outputs]"]
    lines += [_entry(v, found[v.name], "") for v in outputs]
    lines += ["", "[parameters]"]
    tuned = [v for v in reals if v.causality == "parameter" and isinstance(v.start, int | float) and v.start != 0.0]
    for k, v in enumerate(tuned):
        comment = "" if k < MOST_PARAMETERS else "# "
        lines.append(f'{comment}{_key(v.name)} = {{ uncertainty = "{SPREAD}" }}  # {v.start:g} {v.unit or ""}'.rstrip())
    for name, effort, position, velocity in _ports(inputs, outputs, model.units, found):
        lines += ["", f"[ports.{name}]", f'input = "{effort}"']
        lines += [f'position = "{position}"'] if position else []
        lines += [f'velocity = "{velocity}"'] if velocity else []
    if "[ports.port_1]" not in lines:
        lines += ["", *NO_PORT]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if name.replace("_", "a").isalnum() and name.isascii() else '"' + name.replace('"', '\\"') + '"'


def _entry(variable: Variable, column: str | None, further: str) -> str:
    parts = [f'column = "{column or "?"}"'] + ([further] if further else [])
    unit = f"  # {variable.unit}" if variable.unit else ""
    return f"{'' if column else '# '}{_key(variable.name)} = {{ {', '.join(parts)} }}{unit}"


def _column(variable: Variable, columns: Sequence[str], time: str) -> str | None:
    plain = {c.lower(): c for c in columns if c != time}
    short = variable.name.rpartition(".")[2].lower()
    return plain.get(variable.name.lower()) or plain.get(short)


def _ports(
    inputs: Sequence[Variable], outputs: Sequence[Variable], units: Mapping[str, Unit], measured: dict[str, str | None]
) -> list[tuple[str, str, str, str]]:
    """Return name, input, position and velocity of the pairs of input and outputs that are conjugate by their units."""

    def exponents(v: Variable) -> tuple[int, ...] | None:
        unit = None if v.unit is None else resolve(v.unit, units)
        return None if unit is None or unit.exponents is None else tuple(unit.exponents[:7])

    def partner(effort: Variable, product: tuple[int, ...], near: str) -> Variable | None:
        """The output whose product with an input is ``product``; of several one that is measured, or called alike."""
        own = exponents(effort)
        found = [v for v in outputs if own and (e := exponents(v)) and all(map(_adds_up, own, e, product))]
        ranked = sorted(found, key=lambda v: (v.name[-1:] != near, not measured[v.name]))
        return ranked[0] if ranked else None

    ports: list[tuple[str, str, str, str]] = []
    for effort in inputs:
        position = partner(effort, ENERGY, effort.name[-1:])
        velocity = partner(effort, POWER, (position or effort).name[-1:])
        if position or velocity:
            pair = position.name if position else "", velocity.name if velocity else ""
            ports.append((f"port_{len(ports) + 1}", effort.name, *pair))
    return ports


def _adds_up(one: int, other: int, both: int) -> bool:
    return one + other == both
