"""The declarative table of an FMU's variables, and what its units mean in SI base units."""

from __future__ import annotations

import re
from typing import NamedTuple

LARGEST = 1.7976931348623157e308
LARGEST_INTEGER = 2147483647

Exponents = dict[str, int]
# Variables by their names in a terminal, by terminal: what belongs to one connection.
Terminals = dict[str, dict[str, str]]
SYMBOLS: dict[str, Exponents] = {
    "1": {},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
}


class FmuVariable(NamedTuple):
    """One scalar variable; its place in the table is its value reference.

    ``minimum`` and ``maximum`` are closed bounds, and finiteness is demanded where there are none. ``depends_on``
    names the inputs from which an output is computed at the same communication point; ``starts_from``
    names what determines its initial value; ``derivative_of`` the state whose derivative it is. ``reinit`` marks a
    state that an event may change.
    """

    name: str
    causality: str
    unit: str = ""
    start: float | int | None = None
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    variability: str = ""
    type: str = "Real"
    declared_type: str = ""
    depends_on: tuple[str, ...] = ()
    starts_from: tuple[str, ...] = ()
    derivative_of: str = ""
    reinit: bool = False

    @property
    def bounds(self) -> tuple[float, float]:
        """The closed interval of values that may be set."""
        largest = LARGEST if self.type == "Real" else LARGEST_INTEGER
        low = -largest if self.minimum is None else self.minimum
        return (low, largest if self.maximum is None else self.maximum)


def with_starts(variables: tuple[FmuVariable, ...], starts: dict[str, float]) -> tuple[FmuVariable, ...]:
    """Return the table with other start values."""
    table = {variable.name: variable for variable in variables}
    for name, value in starts.items():
        variable = table.get(name)
        if variable is None or variable.causality != "parameter":
            raise ValueError(f"`{name}` must be a parameter, but is not one of this FMU")
        low, high = variable.bounds
        if not low <= value <= high:
            raise ValueError(f"`{name}` must be within [{low:g}, {high:g}], but is {value!r}")
        table[name] = variable._replace(start=float(value) if variable.type == "Real" else int(value))
    return tuple(table.values())


def unit_exponents(unit: str) -> Exponents:
    """Return the exponents of the SI base units (and rad) in a unit such as ``N.m.s2/rad2`` or ``rad/(N.m)``."""
    total: Exponents = {}
    for position, part in enumerate(unit.split("/")):
        sign = 1 if position == 0 else -1
        for factor in part.strip("()").split("."):
            match = re.fullmatch(r"(1|[A-Za-z]+)(-?\d+)?", factor)
            if match is None or match[1] not in SYMBOLS:
                raise ValueError(f"unit {unit!r} must be made of {', '.join(SYMBOLS)}, but has {factor!r}")
            power = sign * int(match[2] or 1)
            for base, exponent in SYMBOLS[match[1]].items():
                total[base] = total.get(base, 0) + power * exponent
    return {base: exponent for base, exponent in total.items() if exponent}
