"""Rows that describe the parameters of a plant, and how its named tuple ``p`` comes of them."""

from collections.abc import Callable
from functools import wraps
from typing import Any, NamedTuple, TypeVar

BIG = 1e12
TINY = 1e-9
R = TypeVar("R")


class Parameter(NamedTuple):
    """One parameter: name as in the FMU, unit, default, closed bounds and a one-line description.

    ``linear``: whatever its value, the plant stays linear while no other parameter is off its default.
    """

    name: str
    unit: str
    default: float
    minimum: float
    maximum: float
    description: str
    linear: bool = False


def field_name(name: str) -> str:
    """Return what the equations call a parameter: ``effects.load_torque.torque`` is ``p.load_torque_torque``."""
    return name.removeprefix("effects.").replace(".", "_")


def mark_linear(*rows: Parameter) -> tuple[Parameter, ...]:
    """Return rows that leave the plant linear: of the plant without effects, and of what only shapes an effect."""
    return tuple(row._replace(linear=True) for row in rows)


def with_values(p: Any, values: dict[str, float]) -> Any:
    """Return parameters, of any plant, with those named in ``values`` (names as in the FMU) replaced."""
    for name in values:
        if field_name(name) not in p._fields:
            raise KeyError(name)
    return p._replace(**{field_name(name): float(value) for name, value in values.items()})


def keep_last(function: Callable[[Any], R]) -> Callable[[Any], R]:
    """Return a function of parameters that computes once while it is asked for the same ones."""
    kept: list[tuple[Any, Any]] = [(None, None)]

    @wraps(function)
    def ask(p: Any) -> R:
        asked, found = kept[0]
        if asked is not p:
            found = function(p)
            kept[0] = (p, found)
        return found

    return ask
