"""One paired run: the loop with a gap beside the loop without one."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from orchestrator.api.sampled import SampledResult
from orchestrator.api.shown import Block, table
from orchestrator.building.fastest import ensure_fastest
from orchestrator.errors import ScenarioError
from orchestrator.master.protocol import Value
from orchestrator.paired import pair
from orchestrator.paired.apart import run_pair_within
from orchestrator.paired.calibration import GapEstimate
from orchestrator.paired.cosimulation import FMUS, LoopRun
from orchestrator.paired.experiment import Experiment, choose_experiment
from orchestrator.paired.pair import PairRun
from orchestrator.shared.arrays import Array
from orchestrator.shared.numbers import not_negative
from orchestrator.shared.play import Play
from orchestrator.shared.results import GapFound, PairFound


@dataclass(frozen=True, repr=False)
class PairResult(SampledResult):
    """A paired run.

    Attributes:
        alpha: actual half-gap [rad] at the load.
        experiment: what both loops share.
        seed: of the encoder noise.
        run: both loops, the metric and the estimate.
    """

    command: ClassVar[str] = "simulate"
    replaces: ClassVar[tuple[str, ...]] = ("simulate.png",)
    alpha: float
    experiment: Experiment
    run: PairRun
    seed: int | None = 0

    @property
    def total(self) -> float:
        """The metric S [rad]: sum of the absolute differences of the estimated load angles."""
        return self.run.total

    @property
    def estimate(self) -> GapEstimate | None:
        """The half-gap [rad] that S stands for, with its 95 % interval; None outside the calibration."""
        return self.run.estimate

    @property
    def machine(self) -> LoopRun:
        """The loop with the gap: ``time`` [s] and signals by name, each of shape (n,)."""
        return self.run.machine

    @property
    def twin(self) -> LoopRun:
        """The loop without a gap, as ``machine``."""
        return self.run.twin

    @property
    def crossings(self) -> int:
        """How often the teeth went from one flank to the other."""
        flank = self.machine["contact"][self.machine["contact"] != 0]
        return int(np.sum(flank[1:] != flank[:-1]))

    def signals(self) -> dict[str, Array]:
        """Return reference [rad] and signals of both loops, those of the twin as ``twin_NAME``."""
        signals = {"time": self.machine.time, "reference": self.experiment.reference()[0]}
        signals |= self.machine.signals
        return signals | {f"twin_{name}": values for name, values in self.twin.signals.items()}

    def blocks(self) -> Sequence[Block]:
        machine, twin = self.machine, self.twin
        apart = np.abs(machine["theta_l"] - twin["theta_l"]).max()
        rows = [
            ["actual half-gap", f"{self.alpha:.6g}", "rad"],
            ["S, sum of differences", f"{self.total:.6g}", "rad"],
            ["largest difference of the load angles", f"{apart:.6g}", "rad"],
            ["time in the gap", f"{100.0 * np.mean(machine['contact'] == 0):.1f}", "%"],
            ["crossings of the gap", str(self.crossings), ""],
            ["largest torque request", f"{np.abs(machine['u']).max():.4g}", "N.m"],
        ]
        found = self.estimate
        said = [f"Actual: {self._play(self.alpha)}"]
        if found is None:
            rows.append(["estimate", f"none: {self.run.no_estimate}", ""])
        else:
            interval = f"(95 %: {found.lower:.8g} .. {found.upper:.8g})"
            rows.append(["estimated half-gap", f"{found.alpha:.8g}  {interval}", "rad"])
            said.append(f"Estimated: {self._play(found.alpha)}")
            if self.alpha > 0.0 and math.isfinite(found.alpha):
                rows.append(["error", f"{100.0 * abs(found.alpha - self.alpha) / self.alpha:.4f}", "%"])
        return [table("Paired run", ("", "value", "unit"), rows), *said]

    def _play(self, alpha: float) -> Play:
        return Play(alpha, self.experiment.values.i)

    def results(self, place: Path | None = None) -> PairFound:
        return PairFound(
            alpha=self.alpha,
            play={
                "actual": self._play(self.alpha).to_result(),
                "estimated": None if self.estimate is None else self._play(self.estimate.alpha).to_result(),
            },
            S=self.total,
            estimate=None if self.estimate is None else GapFound(**asdict(self.estimate)),
            no_estimate=self.run.no_estimate,
            crossings=self.crossings,
            experiment=asdict(self.experiment),
        )


def run_pair(
    alpha: float = 0.02,
    *,
    noise: float = 0.0,
    seed: int = 0,
    experiment: str | Experiment = "default",
    backlash_model: str | None = None,
    start: Mapping[str, Value] | None = None,
    time_limit: float | None = None,
) -> PairResult:
    """Co-simulate the loop with a half-gap and its twin without one, and estimate the half-gap from their difference.

    Args:
        alpha: half-gap [rad] at the load.
        noise: standard deviation of the encoder noise of the loop with a gap [rad].
        seed: of the encoder noise of both loops.
        experiment: "default", "thesis" or an ``Experiment``.
        backlash_model: "dead_zone", "nordin", "hysteresis", "rigid_impact" or "elastic_impact" (default: the
            experiment's).
        start: further start values by ``instance.variable``, in the FMUs' units.
        time_limit: wall time that the run may take [s]; it is done in a process of its own then.

    Returns:
        Both loops, the metric S and the estimate.

    Raises:
        ScenarioError: an argument is out of its range, or names nothing.
        SimulationError: the run went wrong.

    Examples:
        >>> pair = oc.run_pair(alpha=0.02)
        >>> round(pair.estimate.alpha, 4)
        0.02
    """
    not_negative("alpha", alpha)
    not_negative("noise", noise)
    if seed < 0:
        raise ScenarioError(f"`seed` must not be negative, but is {seed}", "seed")
    chosen = replace(choose_experiment(experiment, backlash_model), encoder_noise=noise)
    given = {"alpha": alpha, "noise": noise, "experiment": chosen.name, "backlash_model": chosen.backlash_model}
    given |= {"start": dict(start)} if start else {}
    fmus = ensure_fastest(FMUS).paths
    if time_limit is None:
        run = pair.run_pair(chosen, fmus, alpha, seed, start)
    else:
        run = run_pair_within(time_limit, chosen, fmus, alpha, seed, start)
    return PairResult(alpha, chosen, run, seed, arguments=given)
