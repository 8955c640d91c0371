"""The model of a result under sliders: its native FMU runs beside the measured angles, anew for every move.

The FMU is ours, built here (native where there is a C compiler), and it stays instantiated: a move costs a reset and a
run.
"""

import json
import math
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from orchestrator.building.fastest import ensure_fastest
from orchestrator.errors import InputError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.plants.description import Plant
from orchestrator.plants.known import plants
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.arrays import plain_numbers
from orchestrator.shared.results import LiveFound

SPAN = 2.0  # s: what a slider moves at once
LEAST_ROWS = 20
MOST_BYTES = 50_000_000  # of a result file
NAME = "plant"


class SliderModel:
    """A fitted or corrected model that runs under sliders, for one thread at a time; close it after use.

    Args:
        folder: results of ``diagnose`` or ``estimate``, which say the model and where its runs begin.
    """

    def __init__(self, folder: Path) -> None:
        command = folder.name.rpartition("-")[0]
        live = _live(folder / f"{command}.json")
        self._plant: Plant = plants()[live.fmu]
        self._given = {name: float(value) for name, value in live.values.items()}
        # the parameters with a slider: those of the linear plant, and what the model has besides
        shown = {*self._plant.linear, *self._given} - {*self._plant.enumerations}
        self._sliders = {entry.name: entry for entry in self._plant.table if entry.name in shown}
        columns = _columns(folder / f"{command}.csv", live.rows[0], max(round(SPAN / live.step), LEAST_ROWS) + 1)
        self._time = columns["time"] - columns["time"][0]
        self._requests = columns["u"]
        self._measured = {name: columns[name] for name in self._plant.encoders if name in columns}
        builds = ensure_fastest([live.fmu])
        self._kind = builds.kind
        instance = fmu_instance(NAME, builds.paths[live.fmu], {**self._given, **live.starts[0]})
        step = live.step
        asked = Samples(self._requests, step)
        system = System((instance,), (), (SignalSource(f"{NAME}.u", asked),))
        values = {name: self._given.get(name, entry.default) for name, entry in self._sliders.items()}
        self._start = values | live.starts[0]
        self._session = Session(
            system, tuple(f"{NAME}.{name}" for name in self._measured), GaussSeidel(step), (self._time.size - 1) * step
        )
        self._session.__enter__()

    def close(self) -> None:
        """Free the FMU."""
        self._session.__exit__(None, None, None)

    def describe(self) -> dict[str, Any]:
        """Return the sliders, and what was measured."""
        sliders = []
        for name, entry in self._sliders.items():
            value = self._given.get(name, entry.default)
            span = 3.0 * abs(value) or 0.05
            low = value / 20.0 if name in self._plant.linear else -span if entry.minimum < 0.0 else 0.0
            sliders.append({
                "name": name, "unit": entry.unit, "meaning": entry.description, "value": value,
                "low": max(entry.minimum, low), "high": min(span, entry.maximum),
            })  # fmt: skip
        measured = {name: plain_numbers(values, 9) for name, values in self._measured.items()}
        return {"kind": self._kind, "sliders": sliders, "time": plain_numbers(self._time, 9), "measured": measured}

    def run(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Simulate with these values. ``values``: of sliders; the others stay as in the result.

        Returns:
            ``curves`` by encoder [rad] and the ``seconds`` that the run took.

        Raises:
            InputError: a value is none, or is out of its range.
        """
        given = dict(self._start)
        for name, value in values.items():
            if name not in self._sliders or isinstance(value, bool) or not isinstance(value, (int, float)):
                raise InputError(f"`values` must be numbers of the sliders, but `{str(name)[:60]}` is none")
            entry = self._sliders[name]
            if not (math.isfinite(value) and entry.minimum <= value <= entry.maximum):
                raise InputError(f"`{name}` must be in [{entry.minimum:g}, {entry.maximum:g}], but is {value:g}")
            given[name] = float(value)
        begun = time.perf_counter()
        result = self._session.run({f"{NAME}.{name}": value for name, value in given.items()})
        curves = {name: plain_numbers(result[f"{NAME}.{name}"], 9) for name in self._measured}
        return {"curves": curves, "seconds": time.perf_counter() - begun}


class SliderModels:
    """The models under sliders, the latest few of them; for threads."""

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._models: dict[str, SliderModel] = {}

    def use(self, folder: Path, act: Callable[[SliderModel], dict[str, Any]]) -> dict[str, Any]:
        """Return what an act gives of the model of a result, which is opened when it is first asked for.

        One act at a time: no model is closed, or run anew, while another thread runs it.
        """
        with self._lock:
            model = self._models.pop(folder.name, None) or SliderModel(folder)
            self._models[folder.name] = model
            while len(self._models) > self._most:
                self._models.pop(next(iter(self._models))).close()
            return act(model)

    def forget(self, folder: Path) -> None:
        """Free the model of a result, which is about to be removed."""
        with self._lock:
            if model := self._models.pop(folder.name, None):
                model.close()

    def close(self) -> None:
        """Free all of them."""
        with self._lock:
            while self._models:
                self._models.popitem()[1].close()


def _live(path: Path) -> LiveFound:
    """Return what a result says of its model."""
    if not path.is_file() or path.stat().st_size > MOST_BYTES:
        raise InputError(f"the result must be that of a diagnosis or an estimate, but {path.parent.name} has none")
    try:
        live = msgspec.convert(json.loads(path.read_text(encoding="utf-8"))["results"]["live"], LiveFound)
    except (ValueError, KeyError, TypeError, msgspec.ValidationError):
        raise InputError(f"{path.parent.name} has no model to simulate: no plant of ours was fitted") from None
    if live.fmu not in plants() or not live.rows or len(live.starts) != len(live.rows) or not live.step > 0.0:
        raise InputError(f"{path.parent.name} has no model to simulate: its runs have no starts")
    return live


def _columns(path: Path, first: int, count: int) -> dict[str, NDArray[np.float64]]:
    """Return some rows of a result's table, by heading."""
    table = ResultDocument(path.parent, "", {}).signals(path.name)
    columns = {name: values[first : first + count] for name, values in table.items()}
    if not {"time", "u"} <= columns.keys() or columns["u"].size < LEAST_ROWS or not np.isfinite(columns["u"]).all():
        raise InputError(f"{path.parent.name} must have times and torques in {path.name}, but has not")
    return columns
