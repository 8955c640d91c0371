"""What a live page simulates, as the numbers that ``native_fmu/live.c`` takes."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.sources import recipe_of
from orchestrator.errors import FmuError
from pyfmu_sources.model_xml import ENUMERATIONS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LiveInstance:
    """One FMU: its name in the system, its model, and the values that it starts with."""

    name: str
    fmu: str
    values: Mapping[str, float | str]


@dataclass(frozen=True)
class LiveSystem:
    """FMUs that are stepped one after the other, in this order.

    Attributes:
        instances: FMUs of the system, at most 8.
        connections: output to input, ``instance.variable``; several inputs may have one output.
        signals: what is added to an input from outside, shape (steps + 1,): at initialisation, then in each step.
        step: communication step [s].
    """

    instances: tuple[LiveInstance, ...]
    connections: tuple[tuple[str, str], ...]
    signals: Mapping[str, Array]
    record: tuple[str, ...]
    step: float
    steps: int

    @property
    def models(self) -> tuple[str, ...]:
        """The FMUs of the module, in the order in which a plan numbers them."""
        return tuple(dict.fromkeys(instance.fmu for instance in self.instances))

    def plan(self) -> tuple[list[float], dict[str, int]]:
        """Write the system as numbers. Return the plan, and where in it the value of each ``instance.variable`` is."""
        numbers: list[float] = [self.step, self.steps, len(self.instances)]
        places: dict[str, int] = {}
        for instance in self.instances:
            numbers += [self.models.index(instance.fmu), len(instance.values)]
            for variable, value in instance.values.items():
                reference, whole = _variable(instance.fmu, variable)
                numbers += [reference, float(whole), _number(value)]
                places[f"{instance.name}.{variable}"] = len(numbers) - 1
        sources = {target: source for source, target in self.connections}
        rows = self._rows()
        inputs = list(dict.fromkeys([*sources, *self.signals]))
        numbers.append(len(inputs))
        for target in inputs:
            from_, output = self._place(sources[target])[:2] if target in sources else (-1, 0)
            row = rows.index(self.signals[target].tobytes()) if target in self.signals else -1
            numbers += [*self._place(target)[:2], from_, output, row]
        numbers.append(len(self.record))
        for address in self.record:
            numbers += self._place(address)
        return numbers, places

    def table(self) -> Array:
        """Write the outer signals as numbers. Return row after row, flat; equal signals are one row."""
        return np.concatenate([np.frombuffer(row) for row in self._rows()] or [np.zeros(1)])

    def _rows(self) -> list[bytes]:
        return list(dict.fromkeys(np.asarray(row, dtype=np.float64).tobytes() for row in self.signals.values()))

    def _place(self, address: str) -> tuple[int, int, int]:
        """Return instance, value reference and whether the variable is whole."""
        name, _, variable = address.partition(".")
        number = next((n for n, instance in enumerate(self.instances) if instance.name == name), None)
        if number is None:
            raise FmuError(f"`{address}` must belong to an instance of the system, but does not")
        return (number, *_variable(self.instances[number].fmu, variable))


def hold_row(values: Array) -> Array:
    """Return samples that are held over a step as the row of a signal."""
    return np.concatenate([values[:1], values[:-1]])


@cache
def _references(fmu: str) -> dict[str, tuple[int, int]]:
    recipe = recipe_of(fmu)
    cls: Any = getattr(importlib.import_module(f"pyfmu_sources.{recipe.module}"), recipe.class_name)
    return {variable.name: (n, int(variable.type != "Real")) for n, variable in enumerate(cls.table)}


def _variable(fmu: str, name: str) -> tuple[int, int]:
    try:
        return _references(fmu)[name]
    except KeyError:
        raise FmuError(f"`{fmu}` must have a variable `{name}`, but has none") from None


def _number(value: float | str) -> float:
    """Return a value; of a choice by name its number, from 1 on."""
    if not isinstance(value, str):
        return float(value)
    for choices in ENUMERATIONS.values():
        names = [name for name, _ in choices]
        if value in names:
            return float(names.index(value) + 1)
    raise FmuError(f"`{value}` must be one of the choices of an enumeration, but is not")
