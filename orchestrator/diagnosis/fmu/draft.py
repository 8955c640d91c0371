"""A first map, from what an FMU says of itself: causality, units and names, and the columns of the record."""

from collections.abc import Mapping, Sequence

from orchestrator.diagnosis.fmu.subject import Subject
from orchestrator.master.protocol import Unit, Variable

CONJUGATE = (
    ((1, 2, -2), (0, 0, 0), "rad"),
    ((1, 1, -2), (0, 1, 0), "m"),
)
"""Exponents (kg, m, s) of effort and position of mechanical ports: torque and angle, force and length."""
SPREAD = "5 %"
MOST_PARAMETERS = 12


def drafted(subject: Subject, columns: Sequence[str], time: str = "time") -> str:
    """Return a map as TOML, to be looked over by its user.

    Args:
        subject: the FMU, or several.
        columns: of the record.
        time: name of the column with the time.

    Returns:
        The text.
    """
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
        lines += ["", f"[ports.{name}]", f'input = "{effort}"', f'position = "{position}"']
        lines += [f'velocity = "{velocity}"'] if velocity else []
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
    inputs: Sequence[Variable], outputs: Sequence[Variable], units: Mapping[str, Unit], found: dict[str, str | None]
) -> list[tuple[str, str, str, str]]:
    """Return name, input, position and velocity of every conjugate pair that units or order suggest."""

    def exponents(v: Variable) -> tuple[int, ...] | None:
        unit = units.get(v.unit or "")
        return None if unit is None or unit.exponents is None else tuple(unit.exponents[:3])

    ports: list[tuple[str, str, str, str]] = []
    for effort in inputs:
        for force, place, symbol in CONJUGATE:
            if exponents(effort) != force:
                continue
            positions = [v for v in outputs if v.unit == symbol or (exponents(v) == place and symbol == "m")]
            same = [v for v in positions if v.name[-1:] == effort.name[-1:]] or positions
            if not same:
                continue
            rates = [v for v in outputs if v.unit == f"{symbol}/s" and v.name[-1:] == same[0].name[-1:]]
            ports.append((f"port_{len(ports) + 1}", effort.name, same[0].name, rates[0].name if rates else ""))
    if not ports and inputs and outputs:  # no units: the first of each, to be looked over
        driven = [v for v in inputs if found[v.name]] or list(inputs)
        seen = [v for v in outputs if found[v.name]] or list(outputs)
        ports.append(("port_1", driven[0].name, seen[0].name, ""))
    return ports
