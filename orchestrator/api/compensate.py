"""The same plants under the plain LQR, the LQR shifted by the half-gap, and the compensator of the gap."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orchestrator.api.machine import read_fitted_model, require_machine
from orchestrator.api.plotted import PlottedResult
from orchestrator.api.regulator import five
from orchestrator.api.shown import Block
from orchestrator.building.fastest import ensure_fastest
from orchestrator.building.starts import SAMPLE_TIME
from orchestrator.control.loops import COMPENSATOR, FMUS, LQR, SHIFTED, ControlTask, make_loop, make_task
from orchestrator.control.machine import thesis_machine
from orchestrator.control.measures import (
    LoopMeasures,
    least_time,
    measure_loop,
    quickest_landing,
    quickest_path,
)
from orchestrator.control.standstill import forecast_rest
from orchestrator.control.take_away import file_names, write_loop
from orchestrator.control.weights import choose_weights
from orchestrator.errors import ScenarioError
from orchestrator.records.model_file import Model, read_model
from orchestrator.scenarios.scenario import simulate
from orchestrator.shared.numbers import within
from orchestrator.shared.output import write_columns
from orchestrator.shared.results.compensate import HARD, UPPER, CompensateFound, LawFound, laws_tables
from orchestrator.shared.results.fields import copy_fields
from orchestrator.shared.results.regulator import ForecastFound

# Least and largest value of each argument: rad, s, rad/s, N.m, N.m, s, plants, seed.
RANGES = {
    "alpha": (1e-6, 0.5),
    "tau": (1e-3, 2.0),
    "impact_speed": (1e-3, 10.0),
    "friction": (0.0, 100.0),
    "torque_limit": (1e-6, 1e6),
    "sample_time": (1e-4, 0.05),
    "plants": (1, 1000),
    "seed": (0, 2**32),
}
# Where no machine is given.
BENCHMARK = {"alpha": 0.02, "tau": 5e-3, "impact_speed": 0.1, "friction": 2.0, "plants": 5}
PLANTS = 100  # that a machine's controller is judged on
NOTABLE = 0.8  # standard deviations, by which the mean of wrong plants lies off in what makes them so
CURE = "Log a record that determines the machine better (`estimate` with `design` proposes one)"
ALL_ALIKE = "All plants are alike in this, so a better record does not help: judge the controller by the table"
CYCLES = (
    "No weights were found with which the loop comes to rest without friction: the chosen ones have the smallest limit "
    "cycle. The table states whether friction stops it; `state_weights` sets other weights."
)
HARD_SHARE = 0.05  # of the plants that may land harder than ``HARD``
LAWS = (LQR, SHIFTED, COMPENSATOR)
MEDIANS = ("impact", "error", "rest", "contacts")
_BOUND_SPEEDS = np.geomspace(0.02, 2.0, 30)  # of the curve beside the traversals [rad/s]


@dataclass(frozen=True, repr=False)
class CompensateResult(PlottedResult):
    """Each law on the same plants, medians over these.

    Attributes:
        laws: what was measured of each law.
        bound: least time [s] of a traversal from rest that lands at the speed asked for, without torque.
        task: move, gap and limits.
        forecast: what the plain LQR does at rest without friction and load, with its margins.
    """

    command: ClassVar[str] = "compensate"
    laws: tuple[LawFound, ...]
    bound: float
    task: ControlTask
    forecast: ForecastFound
    doubts: tuple[str, ...] = ()
    name: str = ""

    @property
    def seed(self) -> int:
        """Seed of plants and noise."""
        return int(self.arguments["seed"])

    def blocks(self) -> Sequence[Block]:
        """Return the table of the laws, the bound, what the loop does at rest, and doubts."""
        task = self.task
        title = f"A move of {task.height:.4g} rad in {task.duration:g} s, half-gap {task.machine.alpha:.4g} rad"
        speed = f"{task.impact_speed:.3g} rad/s"
        bound = f"Shortest possible traversal from rest with an impact speed of {speed}: {self.bound:.4f} s."
        weights = ", ".join(f"{weight:.4g}" for weight in task.state_weights)
        chosen = f"Weights of the LQR: states {weights}; torque request {task.torque_weight:g}. Gains: "
        chosen += ", ".join(f"{gain:.6g}" for gain in task.gains)
        return [
            *laws_tables(f"{title}: medians over {self.arguments['plants']} plants", self.laws),
            bound,
            chosen,
            self.forecast.rest_text("the plain LQR"),
            self.forecast.margins_text(),
            *self.doubts,
        ]

    def results(self, place: Path | None = None) -> CompensateFound:
        times, path = quickest_path(self.task, self.task.impact_speed)
        bounds = {speed: least_time(self.task, speed) for speed in _BOUND_SPEEDS.tolist()}
        bounds = {speed: time for speed, time in bounds.items() if time > 0.0}
        return copy_fields(
            CompensateFound,
            self,
            alpha=self.task.machine.alpha,
            tau=self.task.nominal.tau,
            impact_speed=self.task.impact_speed,
            bound_speeds=tuple(bounds),
            bound_times=tuple(bounds.values()),
            path_times=tuple(times.tolist()),
            path=tuple(path.tolist()),
            machine=self.name or None,
            plants=int(self.arguments["plants"]),
            weights=self.task.state_weights,
            gains=self.task.gains,
        )

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files of a machine's controller; none without a machine."""
        return file_names(self.name) if self.name else ()

    def write_files(self, folder: Path) -> None:
        """Write the controllers of a machine beside the data: FMUs, scenario, SSP, settings and plain C."""
        super().write_files(folder)
        if self.name:
            write_loop(folder, self.name, self.task, bool(self.arguments["native"]), int(self.arguments["fmi"]))

    def write_data(self, folder: Path) -> None:
        count = [len(law.times) for law in self.laws]
        write_columns(
            folder / "traversals.csv",
            {
                "law": np.repeat([law.law for law in self.laws], count),
                "time [s]": np.concatenate([np.array(law.times) for law in self.laws]),
                "impact [rad/s]": np.concatenate([np.array(law.impacts) for law in self.laws]),
            },
        )


def compensate(
    alpha: float | None = None,
    *,
    model: Model | Path | str | None = None,
    tau: float | None = None,
    impact_speed: float | None = None,
    friction: float | None = None,
    torque_limit: float | None = None,
    state_weights: Sequence[float] | None = None,
    sample_time: float = SAMPLE_TIME,
    plants: int | None = None,
    seed: int = 0,
    native: bool = False,
    fmi: int = 2,
    force: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> CompensateResult:
    """Make a controller that crosses the gap of a machine softly, and say what its loop will do.

    It is judged beside the plain LQR and the LQR shifted by the half-gap, on plants drawn from what the record of the
    machine left open. The loads make a smooth move, then rest. Without a ``model`` the laws run on the thesis's
    drivetrain, known to 5 %, with dry friction at the load that no law knows.

    Args:
        alpha: half-gap [rad] (default: the model's, else 0.02).
        model: of the machine, as ``diagnose`` or ``estimate`` wrote it: ``corrected.toml``, or ``estimate.json``.
        tau: without a model, time constant of the drive [s] (default: 5 ms).
        impact_speed: at which the compensator shall let the teeth meet [rad/s] (default: 0.4 of the mean speed of
            a quick crossing, without a model 0.1).
        friction: without a model, dry friction at the load [N.m] (default: 2).
        torque_limit: of the drive [N.m] (default: the model's, else the largest request of the record).
        state_weights: of the LQR for ``theta_m``, ``omega_m``, ``theta_l``, ``omega_l`` and ``T_m``, at a weight of 1
            for the request (default: searched so that the loop rests).
        sample_time: of the controller [s].
        plants: their number (default: 100 for a model, else 5).
        seed: of plants and noise.
        native: FMUs that are written need no Python; they need a C compiler when they are made.
        fmi: version of FMI of these, 2 or 3; FMUs of FMI 3.0 are native.
        force: go on with a model that cannot be trusted, a half-gap that the record excludes, or unstable plants.
        progress: called with (runs done, in all).

    Returns:
        Times and impacts of all traversals, error of the load, motion and contacts at rest; beside them the bound.
        ``save`` writes FMUs, scenario, SSP and plain C of a machine's controller.

    Raises:
        ScenarioError: a number is out of its range, no traversal ends with the impact speed, the model cannot be
            trusted, or the loop is unstable on a plant that the record allows.
        DesignError: no LQR has the margins that are needed.
        FmuError: an FMU cannot be built.

    Examples:
        >>> found = oc.compensate(plants=1)
        >>> found.laws[2].law
        'compensator'
    """
    given: dict[str, Any] = {
        "alpha": alpha,
        "tau": tau,
        "impact_speed": impact_speed,
        "friction": friction,
        "plants": plants,
    }
    if model is None:
        given |= {name: value for name, value in BENCHMARK.items() if given[name] is None}
    elif tau is not None or friction is not None:
        raise ScenarioError(
            "`tau` and `friction` must be left out beside `model`, but are given", "tau", "friction", "model"
        )
    given |= {"torque_limit": torque_limit, "sample_time": sample_time, "seed": seed}
    given["plants"] = PLANTS if given["plants"] is None else given["plants"]
    for name, value in given.items():
        if value is not None:
            within(name, value, *RANGES[name])
    if fmi not in (2, 3):
        raise ScenarioError(f"`fmi` must be 2 or 3, but is {fmi!r}", "fmi")
    native = native or fmi == 3
    said = None if model is None else model if isinstance(model, Model) else read_fitted_model(Path(model))
    doubts: tuple[str, ...] = ()
    if said is None:
        machine = thesis_machine(read_model(None), given["alpha"], given["tau"], given["friction"])
        machine = machine if torque_limit is None else replace(machine, torque_limit=torque_limit)
        task = ControlTask(machine, given["impact_speed"], sample_time=sample_time)
    else:
        machine, doubts = require_machine(said, alpha, torque_limit, force)
        task = make_task(machine, sample_time, impact_speed)
    if state_weights is not None:
        task = replace(task, state_weights=five("state_weights", state_weights, 0.0), torque_weight=1.0)
    elif said is not None:
        task = replace(task, state_weights=choose_weights(machine, sample_time), torque_weight=1.0)
    bound = least_time(task, task.impact_speed)
    if bound == 0.0:
        most = 0.99 * quickest_landing(task)  # so that the number that is told is possible
        text = f"`impact_speed` must be at most {most:.3g} rad/s, but is {task.impact_speed:g} rad/s"
        raise ScenarioError(f"{text}: no traversal of this gap from rest is faster", "impact_speed")
    laws, measured = _run_laws(task, int(given["plants"]), seed, progress)
    forecast = forecast_rest(task.nominal, task.gains, task.sample_time)
    unstable, more = _judge(task, measured[COMPENSATOR], seed)
    if unstable and said is not None and not force:
        raise ScenarioError(f"{said.source}: {unstable}. {CURE}, or give `force`", "model", "force")
    doubts += (f"Do not run this controller: {unstable}. {CURE}.",) if unstable else ()
    doubts += (*more, *([CYCLES] if forecast.cycles and said is not None else []))
    name = "" if said is None else re.sub(r"\W+", "_", Path(machine.source).stem).strip("_") or "machine"
    asked = given | {"model": None if said is None else said.source, "native": native, "fmi": fmi, "force": force}
    return CompensateResult(laws, bound, task, forecast, doubts, name[:60], arguments=asked)


def _run_laws(
    task: ControlTask, plants: int, seed: int, progress: Callable[[int, int], None]
) -> tuple[tuple[LawFound, ...], dict[str, list[LoopMeasures]]]:
    """Return what was measured of each law, and the measures of each plant."""
    fmus = ensure_fastest(FMUS).paths
    laws, found = [], {}
    for n, law in enumerate(LAWS):
        measured: list[LoopMeasures] = []
        for plant in range(plants):
            measured.append(measure_loop(simulate(make_loop(task, fmus, law, (seed, plant))), task))
            progress(n * plants + plant + 1, len(LAWS) * plants)
        laws.append(summarise_law(law, measured))
        found[law] = measured
    return tuple(laws), found


def summarise_law(law: str, measured: Sequence[LoopMeasures]) -> LawFound:
    """Return medians and 95 % quantiles over plants that are stable."""
    times, path = next((m.path for m in measured if m.path[0].size), measured[0].path)
    stable = [m for m in measured if m.stable]
    every = {
        "time": np.concatenate([np.zeros(0), *(m.times for m in stable)]),
        "landing": np.concatenate([np.zeros(0), *(m.impacts for m in stable)]),
        "impact": np.array([m.largest_impact for m in stable]),
        **{name: np.array([getattr(m, name) for m in stable]) for name in ("error", "rest", "contacts")},
    }
    medians = {name: float(np.median(every[name])) if stable else None for name in MEDIANS}
    return LawFound(
        law,
        **medians,
        unstable=len(measured) - len(stable),
        upper={name: float(np.quantile(every[name], 0.95)) for name in UPPER if every[name].size},
        times=tuple(every["time"].tolist()),
        impacts=tuple(every["landing"].tolist()),
        path_times=tuple(times.tolist()),
        path=tuple(path.tolist()),
    )


def _judge(task: ControlTask, measured: Sequence[LoopMeasures], seed: int) -> tuple[str, list[str]]:
    """Return which plants are unstable, empty where none is, and that too many land harder than they shall."""
    unstable = [not one.stable for one in measured]
    hard = [one.stable and one.impacts.max(initial=0.0) > HARD * task.impact_speed for one in measured]
    text = ""
    if any(unstable):
        text = "the compensator must be stable on every plant that the record allows, but is unstable on "
        text += _describe_difference(task, unstable, seed)
    if sum(hard) <= HARD_SHARE * len(hard):
        return text, []
    told = (
        f"The impact speed is exceeded by a factor of more than {HARD:g} on {_describe_difference(task, hard, seed)}."
    )
    return text, [f"{told} {ALL_ALIKE if all(hard) else CURE}."]


def _describe_difference(task: ControlTask, wrong: Sequence[bool], seed: int) -> str:
    """Return how many plants are wrong, and the parameter in which they differ most from the others, if any does."""
    draws = [task.machine.draw(np.random.default_rng((seed, n))) for n in range(len(wrong))]
    names, bad = list(draws[0]), np.array(wrong)
    values = np.array([[draw[name] for name in names] for draw in draws]).reshape(len(draws), len(names))
    values = np.where((values > 0.0).all(axis=0), np.log(np.maximum(values, 1e-300)), values)  # as they are drawn
    spread = values.std(axis=0)
    off = np.abs(values[bad].mean(axis=0) - values.mean(axis=0)) / np.where(spread > 0.0, spread, np.inf)
    named = f"these differ in `{names[int(off.argmax())]}`" if off.size and off.max() > NOTABLE else ""
    return f"{int(bad.sum())} of {len(wrong)} plants: {named or 'no single parameter distinguishes them'}"
