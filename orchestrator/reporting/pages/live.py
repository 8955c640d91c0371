"""The live part of pages: what the results hold, as a simulation that the reader moves by sliders."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace

from orchestrator.building.live_module import live_module
from orchestrator.building.live_system import LiveInstance, LiveSystem, hold_row
from orchestrator.errors import FmuError
from orchestrator.paired.cosimulation import MACHINE, RECORDED, TWIN
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.live import pair_system, regulator_design
from orchestrator.plants.known import plants
from orchestrator.reporting.model import Control, Live, LiveCurve, LivePlot, LiveRegulator, LiveRun, Section, Text
from orchestrator.reporting.pages.record import metric_words
from orchestrator.reporting.source import ResultDocument, numbers
from orchestrator.shared.results import LiveFound, PairFound
from pyfmu_sources.drivetrain_parameters import BIG

TITLE = "Simulate it here"
NEEDS_ZIG = "With zig (`pip install 'backlash-cosim[native]'`) this page simulates the model live, moved by sliders."
LONGEST = 30.0
"""Seconds of a record that are simulated; more would make the page slow to move."""
MOST_NUMBERS = 45_000
"""Numbers of requests and measured signals in a page, eleven bytes each: half a megabyte."""
WIDEST = 2.5
"""A slider reaches from none of an effect to this times what was found."""
FRICTION = 0.2
"""An offered friction reaches this part of the largest request: more would hold most machines at rest."""
NO_GAP = 0.01
"""rad, half-gap that the slider reaches where none was found."""
MOST_FACTOR = 100.0
"""A weight reaches this many times above and below its value: two decades either way turn a regulator round."""
NO_MODEL = 1.0
"""Number of the backlash model `none`, with which a loop without a gap runs."""
WEIGHTS = ("motor angle", "motor speed", "load angle", "load speed", "motor torque", "torque request")
# Columns of `simulate.csv` that the live curves are drawn beside.
COMPARED = ("theta_l", "u", "theta_l_hat", f"{TWIN}theta_l_hat")
ANGLES = {"theta_m": "Motor angle", "theta_l": "Load angle"}


def pair_section(source: ResultDocument, results: PairFound) -> list[Section]:
    """Return the paired loops, live."""
    if not results.experiment or results.alpha is None:
        return []
    known = {name: results.experiment[name] for name in Experiment.__dataclass_fields__ if name in results.experiment}
    experiment = _experiment(known)
    seed = int(source.document.get("seed") or 0)
    start = (source.document.get("arguments") or {}).get("start") or {}
    # With a gap, so that the plan names its model; its size is put in below.
    system = pair_system(experiment, results.alpha or experiment.smallest, seed, _with_effects(start))
    module = _module(system.models, regulator=True)
    if not isinstance(module, bytes):
        return [module]
    system = _shorten(system)
    plan, places = system.plan()
    plan[places["plant.alpha"]] = results.alpha
    table = source.columns("simulate.csv")
    names = [f"{prefix}{name}" for prefix in (MACHINE, TWIN) for name in RECORDED]
    recorded = tuple(_row(numbers(table.get(name, ()))[: system.steps + 1]) for name in COMPARED)
    if any(len(row) != system.steps + 1 for row in recorded):
        return []
    run = LiveRun(0.0, system.steps, (), system.table().tolist())
    design = regulator_design(experiment)
    gains = tuple(tuple(places[f"{prefix}controller.K[{n}]"] for n in range(1, 6)) for prefix in (MACHINE, TWIN))
    note = "Both loops again, by the same equations as in the FMUs, compiled for the browser. Nothing leaves the page."
    return [
        Live(
            TITLE,
            note,
            module,
            tuple(plan),
            system.step,
            len(system.record),
            (run,),
            recorded,
            tuple(_pair_controls(experiment, results.alpha, places, start)),
            tuple(_pair_plots(names)),
            LiveRegulator((*design.matrix, *design.column), design.weights, design.sample_time, gains),
        )
    ]


def _module(names: Sequence[str], regulator: bool = False) -> bytes | Text:
    """Return the module, or one line on why there is none: a page is made all the same."""
    try:
        module = live_module(names, regulator)
    except FmuError as error:
        return Text(TITLE, (f"The simulation could not be compiled: {error}",))
    return Text(TITLE, (NEEDS_ZIG,)) if module is None else module


def _shorten(system: LiveSystem) -> LiveSystem:
    """Return the beginning of a system's run that a page has room for."""
    columns = len(COMPARED) + len({id(values) for values in system.signals.values()})
    steps = min(system.steps, round(LONGEST / system.step), MOST_NUMBERS // columns)
    signals = {target: values[: steps + 1] for target, values in system.signals.items()}
    return dataclasses.replace(system, steps=steps, signals=signals)


def _experiment(data: Mapping[str, Any]) -> Experiment:
    return msgspec.convert(data, Experiment)


# Effects that the paired plant can be given, and how large, as parts of the torque limit at the motor.
PAIR_EFFECTS = {
    "effects.coulomb_friction.motor.torque": ("dry friction of the motor", 0.03, False),
    "effects.coulomb_friction.load.torque": ("dry friction of the load", 0.03, True),
    "effects.load_torque.torque": ("load torque", 0.1, True),
}


def _with_effects(start: Mapping[str, float | str]) -> dict[str, float | str]:
    return {f"plant.{name}": 0.0 for name in PAIR_EFFECTS} | dict(start)


def _pair_controls(
    experiment: Experiment, alpha: float, places: Mapping[str, int], start: Mapping[str, Any]
) -> Sequence[Control]:
    model = places["plant.backlash_model"]
    high = max(experiment.largest, 2.0 * alpha)
    controls = [Control("half-gap", "rad", alpha, 0.0, high, (places["plant.alpha"],), ((model, NO_MODEL),))]
    for name, (label, part, geared) in PAIR_EFFECTS.items():
        value = float(start.get(f"plant.{name}", 0.0))
        most = max(part * experiment.torque_limit * (experiment.values.i if geared else 1.0), WIDEST * value)
        controls.append(Control(label, "N.m", value, 0.0, most, (places[f"plant.{name}"],)))
    weights = (*experiment.state_weights, experiment.torque_weight)
    for n, (label, weight) in enumerate(zip(WEIGHTS, weights, strict=True)):
        if weight > 0.0:
            ends = (weight / MOST_FACTOR, weight * MOST_FACTOR)
            controls.append(Control(f"weight of the {label}", "", weight, *ends, log=True, weight=n))
    return controls


def _pair_plots(names: Sequence[str]) -> Sequence[LivePlot]:
    def curves(signal: str) -> tuple[LiveCurve, ...]:
        return (
            LiveCurve("this run, with backlash", ((-1 - COMPARED.index(signal), 1.0),)),
            LiveCurve("live, with backlash", ((names.index(signal), 1.0),)),
            LiveCurve("live, without", ((names.index(f"{TWIN}{signal}"), 1.0),)),
        )

    estimated = ("theta_l_hat", f"{TWIN}theta_l_hat")
    own, twin = (COMPARED.index(name) for name in estimated)
    live, live_twin = (names.index(name) for name in estimated)
    difference = (
        LiveCurve("this run", ((-1 - own, 1.0), (-1 - twin, -1.0))),
        LiveCurve("live", ((live, 1.0), (live_twin, -1.0))),
    )
    return (
        LivePlot("Load angle, live", "angle [rad]", curves("theta_l")),
        LivePlot("Difference of the loops, live", "difference [rad]", difference),
        LivePlot("Requested torque, live", "torque [N.m]", curves("u")),
    )


def plant_section(
    source: ResultDocument, name: str, data: LiveFound | None, offered: Sequence[str] = (), metric: bool = False
) -> list[Section]:
    """Return a model beside its record, live.

    Args:
        offered: effects [N.m] that get a slider although the model has none of them.
        metric: the axis moves in metres.
    """
    if data is None:
        return []
    own = {entry.name for entry in plants()[data.fmu].table}
    data = replace(data, values={name: 0.0 for name in ("alpha", *offered) if name in own} | data.values)
    table = source.columns(name)
    u = numbers(table.get("u", ()))
    signals = [signal for signal in ANGLES if signal in table]
    if len(u) < 2 or not data.rows or not signals or None in u:
        return []
    module = _module((data.fmu,))
    if not isinstance(module, bytes):
        return [module]
    largest = max(abs(value) for value in u if value is not None)
    runs = _spans(data, min(len(u), MOST_NUMBERS // (1 + len(signals))))
    begun, ended = runs[0][0], runs[-1][1]
    values = {**dict.fromkeys(data.starts[0], 0.0), **data.values}
    outputs = tuple(f"plant.{signal}" for signal in signals)
    plant = LiveInstance("plant", data.fmu, values)
    request = np.array([float(value or 0.0) for value in u])
    system = LiveSystem((plant,), (), {"plant.u": request}, outputs, data.step, len(u) - 1)
    plan, places = system.plan()
    made = tuple(
        LiveRun(
            float(numbers(table["time"])[first] or 0.0),
            last - first - 1,
            tuple((places[f"plant.{k}"], v) for k, v in start.items()),
            hold_row(request[first:last]).tolist(),
        )
        for first, last, start in runs
    )
    recorded = tuple(_row(numbers(table[signal])[begun:ended]) for signal in signals)
    often = " The model starts anew, from the state that fits best, where the curves jump." if len(made) > 1 else ""
    note = f"The model with the requests of the record, by the same equations as in its FMU.{often}"
    return [
        Live(
            TITLE,
            note,
            module,
            tuple(plan),
            data.step,
            len(outputs),
            made,
            recorded,
            tuple(_plant_controls(data, places, largest)),
            tuple(_plant_plots(signals, metric)),
        )
    ]


def _spans(data: LiveFound, size: int) -> list[tuple[int, int, Mapping[str, float]]]:
    """Return first row, row behind the last, and starts of each run, as far as the page simulates."""
    most = min(size, data.rows[0] + math.ceil(LONGEST / data.step) + 1)
    ends = [*data.rows[1:], most]
    spans = zip(data.rows, ends, data.starts, strict=True)
    return [(first, min(end, most), start) for first, end, start in spans if min(end, most) - first > 1]


def _plant_controls(data: LiveFound, places: Mapping[str, int], largest: float) -> Sequence[Control]:
    controls: list[Control] = []
    table = {entry.name: entry for entry in plants()[data.fmu].table}
    for name, value in data.values.items():
        entry = table.get(name)
        place = (places[f"plant.{name}"],)
        if name == "alpha":
            controls.insert(0, Control("half-gap", "rad", value, 0.0, WIDEST * value or NO_GAP, place))
        elif entry is not None and name.startswith("effects."):
            label = name.removeprefix("effects.").replace(".", " ").replace("_", " ")
            low, high, log = _reach(name, value, entry.default)
            if value == 0.0:
                high = FRICTION * largest * (table["i"].default if "load" in name else 1.0)
            controls.append(Control(label, "" if entry.unit == "1" else entry.unit, value, low, high, place, log=log))
    return controls


def _reach(name: str, value: float, default: float) -> tuple[float, float, bool]:
    """Return the ends of an effect's slider, and whether it moves by factors."""
    if name.endswith("phase"):
        return value - math.pi, value + math.pi, False
    if default == 0.0:
        return min(0.0, WIDEST * value), max(0.0, WIDEST * value), False
    if value > 0.0 and value < BIG:
        return value / WIDEST, value * WIDEST, True
    return value - abs(value), value + abs(value), False


def _plant_plots(signals: Sequence[str], metric: bool) -> Sequence[LivePlot]:
    plots, unit = [], metric_words("rad", metric)
    for n, signal in enumerate(signals):
        title = metric_words(ANGLES[signal], metric)
        gap = LiveCurve("live", ((n, 1.0), (-1 - n, -1.0)))
        plots.append(LivePlot(f"{title}: live minus measured", f"difference [{unit}]", (gap,)))
        both = (LiveCurve("measured", ((-1 - n, 1.0),)), LiveCurve("live", ((n, 1.0),)))
        plots.append(LivePlot(f"{title}, live", f"{signal} [{unit}]", both))
    return plots


def _row(values: Sequence[float | None]) -> Sequence[float]:
    return [math.nan if value is None else value for value in values]
