"""The same plants under the plain LQR, the LQR shifted by the half-gap, an MPC, and the compensator of the gap."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orchestrator.api.arguments import within
from orchestrator.api.at_rest import margins_text, rest_forecast, rest_text
from orchestrator.api.plotted import PlottedResult
from orchestrator.api.shown import Block, table
from orchestrator.building.fastest import ensure_fastest
from orchestrator.control.loops import COMPENSATOR, FMUS, LQR, MPC, SHIFTED, ControlTask, make_loop
from orchestrator.control.measures import (
    LoopMeasures,
    bound_path,
    bound_time,
    first_path,
    measure_loop,
    quickest_landing,
)
from orchestrator.control.predictive import PredictiveLaw, make_predictive_loop
from orchestrator.errors import ScenarioError
from orchestrator.scenarios.scenario import simulate
from orchestrator.shared.output import write_columns
from orchestrator.shared.results.compensate import CompensateFound, LawFound
from orchestrator.shared.results.regulator import ForecastFound

Array = NDArray[np.float64]

# Least and largest value of each argument: rad, s, rad/s, N.m, plants, seed.
RANGES = {
    "alpha": (1e-4, 0.2),
    "tau": (1e-3, 2.0),
    "impact_speed": (1e-3, 10.0),
    "friction": (0.0, 100.0),
    "plants": (1, 1000),
    "seed": (0, 2**32),
}
HEAD = (
    "law", "traversal [s]", "its impact [rad/s]", "largest impact [rad/s]", "rms error [mrad]", "rest [counts]",
    "contacts at rest [1/s]",
)  # fmt: skip
_BOUND_SPEEDS = np.geomspace(0.02, 2.0, 30)  # of the curve beside the traversals [rad/s]


@dataclass(frozen=True, repr=False)
class CompensateResult(PlottedResult):
    """Each law on the same plants, medians over these.

    Attributes:
        laws: what was measured of each law.
        bound: least time [s] of a traversal from rest that lands at the speed asked for, without torque.
        task: move, gap and limits.
        forecast: what the plain LQR does at rest without friction and load, with its margins.
        arguments: what was asked for.
    """

    command: ClassVar[str] = "compensate"
    laws: tuple[LawFound, ...]
    bound: float
    task: ControlTask
    forecast: ForecastFound
    arguments: Mapping[str, Any] = field(default_factory=dict)

    @property
    def seed(self) -> int:
        """Seed of plants and noise."""
        return int(self.arguments["seed"])

    def blocks(self) -> Sequence[Block]:
        """Return the table of the laws, and the bound."""
        rows = [
            (
                law.law,
                *(f"{np.median(v):.3f}" if v else "none" for v in (law.times, law.impacts)),
                f"{law.impact:.3f}",
                f"{1e3 * law.error:.1f}",
                f"{law.rest:.1f}",
                f"{law.contacts:.1f}",
            )
            for law in self.laws
        ]
        title = f"A move of {self.task.height:g} rad with a half-gap of {self.task.alpha:g} rad: medians over plants"
        bound = (
            f"No traversal from rest that lands at {self.task.impact_speed:g} rad/s takes less than {self.bound:.4f} s."
        )
        return [table(title, HEAD, rows), bound, rest_text(self.forecast, "the plain LQR"), margins_text(self.forecast)]

    def results(self, place: Path | None = None) -> CompensateFound:
        """Return what ``compensate.json`` says."""
        times, path = bound_path(self.task, self.task.impact_speed)
        bounds = {speed: bound_time(self.task, speed) for speed in _BOUND_SPEEDS.tolist()}
        bounds = {speed: time for speed, time in bounds.items() if time > 0.0}
        return CompensateFound(
            alpha=self.task.alpha,
            tau=self.task.tau,
            impact_speed=self.task.impact_speed,
            bound=self.bound,
            forecast=self.forecast,
            laws=self.laws,
            bound_speeds=tuple(bounds),
            bound_times=tuple(bounds.values()),
            path_times=tuple(times.tolist()),
            path=tuple(path.tolist()),
        )

    def write_data(self, folder: Path) -> None:
        """Write ``traversals.csv``."""
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
    alpha: float = 0.02,
    *,
    tau: float = 5e-3,
    impact_speed: float = 0.1,
    friction: float = 2.0,
    plants: int = 5,
    seed: int = 0,
    mpc: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> CompensateResult:
    """Compare control laws on the same plants with a gap: a smooth move of 0.5 rad, then rest.

    These are the plain LQR, the LQR shifted by the half-gap, and the compensator. The plants have parameters up to 5 %
    off, encoders with noise and dry friction at the load that no law knows.
    The half-gap is given to 1 %.

    Args:
        alpha: half-gap [rad].
        tau: time constant of the drive [s].
        impact_speed: at which the compensator shall let the teeth meet [rad/s].
        friction: dry friction at the load [N.m].
        plants: their number, from 1 to 1000.
        seed: of plants and noise.
        mpc: runs a model predictive controller too; needs the extra ``mpc``.
        progress: called with (runs done, in all).

    Returns:
        Times and impacts of all traversals, error of the load, motion and contacts at rest; beside them the bound.

    Raises:
        ScenarioError: a number is out of its range, or no traversal ends with the impact speed.
        DesignError: the extra ``mpc`` is not installed.
        FmuError: an FMU cannot be built.

    Examples:
        >>> found = oc.compensate(plants=1)
        >>> found.laws[2].law
        'compensator'
    """
    given = {"alpha": alpha, "tau": tau, "impact_speed": impact_speed, "friction": friction}
    given |= {"plants": plants, "seed": seed}
    for name, value in given.items():
        within(name, value, *RANGES[name])
    task = ControlTask(alpha=alpha, tau=tau, impact_speed=impact_speed, friction=friction)
    bound = bound_time(task, impact_speed)
    if bound == 0.0:
        most = 0.99 * quickest_landing(task)  # so that the number that is told is possible
        text = f"`impact_speed` must be at most {most:.3g} rad/s, but is {impact_speed:g} rad/s"
        raise ScenarioError(f"{text}: no traversal of this gap from rest ends quicker", "impact_speed")
    predictive = PredictiveLaw(task) if mpc else None
    names = (LQR, SHIFTED, MPC, COMPENSATOR) if mpc else (LQR, SHIFTED, COMPENSATOR)
    fmus = ensure_fastest(FMUS).paths
    laws = []
    for n, law in enumerate(names):
        measured = []
        path = (np.zeros(0), np.zeros(0))
        for plant in range(plants):
            if law == MPC and predictive is not None:
                loop = make_predictive_loop(predictive, fmus, (seed, plant))
            else:
                loop = make_loop(task, fmus, law, (seed, plant))
            run = simulate(loop)
            measured.append(measure_loop(run, task))
            path = first_path(run, task) if not path[0].size else path
            progress(n * plants + plant + 1, len(names) * plants)
        laws.append(_summarise(law, measured, path))
    forecast = rest_forecast(task.nominal, task.gains(), task.sample_time)
    return CompensateResult(tuple(laws), bound, task, forecast, given | {"mpc": mpc})


def _summarise(law: str, measured: Sequence[LoopMeasures], path: tuple[Array, Array]) -> LawFound:
    """Return the medians over plants."""
    return LawFound(
        law,
        impact=float(np.median([m.largest_impact for m in measured])),
        error=float(np.median([m.error for m in measured])),
        rest=float(np.median([m.rest for m in measured])),
        contacts=float(np.median([m.contacts for m in measured])),
        times=tuple(float(t) for m in measured for t in m.times),
        impacts=tuple(float(v) for m in measured for v in m.impacts),
        path_times=tuple(path[0].tolist()),
        path=tuple(path[1].tolist()),
    )
