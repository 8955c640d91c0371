"""A model that is run over parts of a record from given states, by the cheapest of three ways that are exact enough.

Without effects the plant is linear, and each sample's motion is a matrix. Two bodies that rub vibrate against stiction
at every oscillation of their shaft: to locate each of these events, and to follow other nonlinear effects to twelve
digits, costs up to a hundred times what steps without events do, which run in the exact plant's place there. Where
teeth meet, and whatever else there is, the exact, event-located plant itself runs.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.report.run_signals import RunSignals
from orchestrator.plants.coarse_run import FINER, coarse_runner_of, coarse_steps, runs_coarsely
from orchestrator.plants.description import Plant
from orchestrator.plants.linear_run import is_linear, linear_run_of
from pyfmu_sources.drive_request import UNASKED

Array = NDArray[np.float64]
Kernel = Callable[[Array, Array, Array, Array], None]
"""``kernel(start, early, late, out)``: requests in both pieces of each sample; fills the angles (n, 2)."""


@dataclass(frozen=True)
class Simulation:
    """A model, ready to be run: what does not depend on where a run starts is done once.

    Attributes:
        signals: of the record; requests before a part matter when there is a dead time.
        history: requests before a part are still under way in a dead time; False: there were none, as in an FMU that
            starts with the part.
    """

    plant: Plant
    p: Array
    signals: RunSignals
    history: bool = True

    def run(self, start: Array, part: slice) -> Array:
        """Return the simulated encoder angles (n, 2) of a part of the record.

        Args:
            start: (8,) state at the part's first sample.
            part: samples to simulate.

        Returns:
            The angles [rad].
        """
        begin, end, _ = part.indices(self.signals.size)
        acting, followed = self._requests
        whole, _ = self._dead_time
        known = 0 if self.history else begin
        late, early = (_requests(acting, begin - back, end - begin, known) for back in (whole, whole + 1))
        out = np.empty((end - begin, 2))
        if self._kernel is not None:
            self._kernel(start, early, late, out)
        else:
            self._run_exactly(
                start, float(followed[min(max(begin - whole, 0), self.signals.size - 1)]), early, late, out
            )
        for channel, name in enumerate(self.plant.offsets):
            out[:, channel] += self.p[self.plant.index(name)]
        return out

    @cached_property
    def measured(self) -> Array:
        """The angles (n, channels) as they were, from how the log has them."""
        return self.signals.aligned_angles(self.plant, self.p)

    @cached_property
    def _requests(self) -> tuple[Array, Array]:
        """What is requested in each sample (n,), and what is at its beginning (n,)."""
        limit = self.p[self.plant.index(self.plant.drive.limit)]
        u = np.clip(self.signals.requests, -limit, limit)
        mean, followed = self.plant.followed(self.p, u, self.signals.step)
        return (u if self._kernel is None else mean), followed

    @cached_property
    def _dead_time(self) -> tuple[int, float]:
        """Whole samples of it, and what is left [s]."""
        delay, h = self.signals.lateness(self.plant, self.p), self.signals.step
        whole = int(np.floor(delay / h + 1e-9))
        return whole, max(delay - whole * h, 0.0)

    @cached_property
    def _kernel(self) -> Kernel | None:
        """What runs in the exact plant's place; None where nothing does."""
        plant, p, h = self.plant, self.p, self.signals.step
        _, first = self._dead_time
        if self.history and is_linear(plant, p):
            return linear_run_of(plant, p, first, h)
        if not (self.history and runs_coarsely(plant, p)):
            return None
        steps = coarse_steps(plant, p, h, self.signals.turn)
        coarse = coarse_runner_of(plant, p)
        return lambda start, early, late, out: coarse(
            tuple(start.tolist()), p, early, late, first, h, (steps, FINER * steps), out
        )

    def _run_exactly(self, start: Array, asked: float, early: Array, late: Array, out: Array) -> None:
        _, first = self._dead_time
        memory = (float(start[7]), asked) if self.history else (0.0, UNASKED)
        own = self.plant.own(self.p)
        self.plant.runner()((*start[:7].tolist(), *memory), own, early, late, first, self.signals.step, out)


def simulate(plant: Plant, p: Array, start: Array, signals: RunSignals, part: slice, history: bool = True) -> Array:
    """Return one run (n, 2) of a model over a part of a record.

    Args:
        start: (8,) state at the part's first sample.
        part: samples to simulate.

    Returns:
        The angles [rad].
    """
    return Simulation(plant, p, signals, history).run(start, part)


def _requests(u: Array, begin: int, count: int, first: int) -> Array:
    """Return the requests at ``count`` samples from ``begin`` on; there were none before ``first``, the last one
    stays.
    """
    rows = np.arange(begin, begin + count)
    found = u[np.clip(rows, 0, u.size - 1)]
    found[rows < first] = u[0] if first == 0 else 0.0
    return found
