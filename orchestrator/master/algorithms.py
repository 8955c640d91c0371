"""Which master algorithm runs a system, with its settings."""

import math
from dataclasses import dataclass
from typing import Any, Protocol

from orchestrator.errors import ScenarioError
from orchestrator.master.iterated import Iterated
from orchestrator.master.wiring import Slots, Wiring
from orchestrator.shared.arrays import Array


@dataclass(frozen=True, slots=True)
class GaussSeidel:
    """Instances one after the other in execution order, each with the newest values there are. Fixed step [s]."""

    step: float  # communication step [s]
    compiled: bool = True  # run the loop in machine code where all slaves allow it


@dataclass(frozen=True, slots=True)
class Jacobi:
    """All instances side by side, with the values of the start of the step. Fixed step [s]; ``compiled`` as above."""

    step: float
    compiled: bool = True


@dataclass(frozen=True, slots=True)
class Adaptive:
    """Error-controlled communication step with rollback, for continuous loops; see ``adaptive``."""

    step: float  # distance of the recorded points [s]
    # largest error of an exchanged value per communication step, relative to ``max(1, |value|)``
    tolerance: float = 1e-9
    first: float = 1e-4  # first communication step tried [s]
    smallest: float = 1e-11  # below this step [s] the run is given up
    largest: float = 0.02  # largest communication step [s]


class FixedStepLoop(Protocol):
    """A further algorithm: a frozen dataclass with a fixed step, which runs the loop itself."""

    @property
    def step(self) -> float:
        """Communication step [s]."""

    def run(self, wiring: Wiring, table: Array, start: float, steps: int, rows: Array, record: Slots) -> int:
        """Run on the grid; see ``fixed_step.run_fixed_step`` for the arguments. Return the number of passes."""


Algorithm = GaussSeidel | Jacobi | Adaptive | FixedStepLoop

# Dataclasses; their fields behind `step` are the settings that a scenario may give.
ALGORITHMS: dict[str, type[Any]] = {
    "gauss_seidel": GaussSeidel,
    "jacobi": Jacobi,
    "iterated": Iterated,
    "adaptive": Adaptive,
}

MAXIMUM_STEPS = 100_000_000


def step_count(start: float, stop: float, step: float) -> int:
    """Return the number of steps of the communication grid ``start + n * step`` from ``start`` to ``stop`` [s]."""
    if not (math.isfinite(step) and step > 0.0):
        raise ScenarioError(f"`step` must be finite and positive, but is {step!r}")
    if not (math.isfinite(start) and math.isfinite(stop) and stop > start):
        raise ScenarioError(f"`stop` must be finite and after `start`, but they are {stop!r} and {start!r}")
    ratio = (stop - start) / step
    if ratio > MAXIMUM_STEPS:
        raise ScenarioError(f"`step` must leave at most {MAXIMUM_STEPS:,} steps, but {step!r} leaves {ratio:.3g}")
    count = round(ratio)
    if count < 1 or abs(ratio - count) > 1e-6:
        raise ScenarioError(f"`stop` must be a whole number of steps after `start`, but is {ratio!r} steps after it")
    return count
