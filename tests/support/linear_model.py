"""A residual model that is linear in everything, for tests of the engine: a slope and effects of known columns."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.inference.problem import FitProblem, fit_problem
from orchestrator.diagnosis.model.interface import CandidateEffect, ModelPoint, NoiseSources, UncertainParameter, Values
from orchestrator.diagnosis.settings import FitSettings

Array = NDArray[np.float64]


class LinearModel:
    """Residual ``data - slope * ramp - sum of amplitude * column``, white noise of a known level beside it.

    Args:
        data: (n,) what is measured.
        ramp: (n,) column of the only parameter, ``slope``, nominally 1.
        columns: label -> column of an effect.
        noise: standard deviation of a row.
        kinds: label -> kind; default: "speed".
    """

    channels = ("motor",)
    edges = 0.0

    def __init__(
        self,
        data: Array,
        ramp: Array,
        columns: Mapping[str, Array],
        noise: float,
        kinds: Mapping[str, str] | None = None,
    ) -> None:
        self.data, self.ramp, self.columns, self.noise = data, ramp, columns, noise
        self.step, self.size = 0.01, data.size
        self.cutoffs = (0.35 / self.step,)
        self.parameters = (UncertainParameter("slope", 1.0, 0.5),)
        self.active = np.ones((1, data.size))
        self.effects = {
            label: CandidateEffect(
                label, (kinds or {}).get(label, "speed"), ("size",), (0.1,), ((0.0,),), amplitudes=(0,), fitted=(0,)
            )
            for label in columns
        }

    def residuals(self, points: Sequence[ModelPoint]) -> list[Array]:
        return [
            (
                self.data
                - point.parameters[0] * self.ramp
                - sum(values[0] * self.columns[label] for label, values in point.effects.items())
            )[None, :]
            for point in points
        ]

    def noise_sources(self, frequencies: Array) -> NoiseSources:
        one = np.ones((frequencies.size, 1, 1), dtype=complex)
        return NoiseSources(one, np.array([2.0 * self.step * self.noise**2]), one, np.array([1e-12]))

    def approximate_changes(self, point: ModelPoint, trials: Sequence[tuple[str, Values]]) -> list[Array | None]:
        return [None] * len(trials)

    def is_possible(self, label: str, point: ModelPoint) -> bool:
        return True

    def reference_signals(self, point: ModelPoint) -> Array:
        return self.data[None, :]

    def inertia_shares(self) -> Mapping[str, float]:
        return {}

    def without_priors(self, spread: float) -> "LinearModel":
        return self


def linear_problem(
    sizes: Mapping[str, float], *, noise: float = 0.1, seed: int = 0, size: int = 2000, slope: float = 1.1,
    alike: Mapping[str, str] | None = None, kinds: Mapping[str, str] | None = None,
) -> FitProblem:  # fmt: skip
    """Return the problem of a model that lacks effects of some sizes.

    Args:
        sizes: label -> true size; zero: a candidate that is not there.
        noise: standard deviation of a row.
        seed: of noise and columns.
        size: rows.
        slope: the true one.
        alike: label -> label whose column it has too.
        kinds: label -> kind; default: "speed".

    Returns:
        The problem.
    """
    rng = np.random.default_rng(seed)
    ramp = rng.standard_normal(size)
    columns = {label: rng.standard_normal(size) for label in sizes}
    for label, other in (alike or {}).items():
        columns[label] = columns[other] + 1e-3 * columns[label]
    data = slope * ramp + sum(value * columns[label] for label, value in sizes.items())
    model = LinearModel(data + noise * rng.standard_normal(size), ramp, columns, noise, kinds)
    return fit_problem([model], FitSettings())
