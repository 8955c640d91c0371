"""Integration of the continuous states of an FMU up to given times and to events.

The methods take one step from one state and know nothing of steps before it: inputs change and states go back at every
communication step, where a method of several steps (CVODE, LSODA) would begin anew at order one each time.
"""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from orchestrator.fmi.equations import Equations

STIFF_FROM = 200
"""Steps of the explicit method towards one stop time from which on the implicit one is likely to cost less."""

CLOSE = 1e-14
"""Width to which the instant of an event is located, as a share of the time or of 1 s."""


BEYOND = 5e-13
"""How far beyond the crossing an event is, as a share of the time or of 1 s. A master that steps all its slaves to the
event once more has roundings in what it feeds: the crossing must not come after it then."""

BLIND = 1e-9
"""Time after an event in which an indicator that is zero there finds its side, as a share of the time or of 1 s."""


class IntegrationError(Exception):
    """The method cannot go on, in its own words."""


class Integrator:
    """States of one FMU on their way: Runge-Kutta of order 8 (DOP853), from stiffness on Radau IIA of order 5.

    Equations: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, II.10, and II, IV.8.

    Attributes:
        time: where it is [s].
        states: there, shape (n,).
        signs: of the event indicators after the last event; who leaves event mode sets them. Where new inputs or
            another state have changed one of them since, a step ends where it begins.
    """

    def __init__(self, equations: Equations) -> None:
        self._equations = equations
        self._stiff = False
        self._solver: Any = None
        self._length: float | None = None  # of the next step [s]
        self._stop, self._steps = np.nan, 0
        self.signs = np.zeros(0)
        self.restart(0.0, np.zeros(0), 1e-6, np.zeros(0))

    def restart(self, time: float, states: NDArray[np.float64], relative: float, nominals: NDArray[np.float64]) -> None:
        """Begin anew.

        Args:
            time: [s].
            states: at this time, shape (n,).
            relative: tolerance, of each state.
            nominals: of the states, by which the tolerance is multiplied where they are small; shape (n,).
        """
        self.time, self.states = time, states
        self._relative, self._nominals = relative, nominals
        self._solver, self._begins = None, True

    def step(self, stop: float) -> bool:
        """Take one step of the method's own length, not beyond ``stop`` [s]; return whether it ends at an event."""
        if self._begins and self._has_event(self.time, self.states):
            return True
        self._begins = False
        length, seeks_side = self._length, bool(np.any(self.signs == 0.0))
        if seeks_side:
            stop = min(stop, self.time + BLIND * max(1.0, abs(self.time)))
        before, states, track = self.time, self.states, self._advance(stop)
        after = self.time
        if seeks_side:
            self._length = length
        if not self._has_event(after, self.states):
            if seeks_side:
                self.signs = np.where(self.signs == 0.0, self._equations.read_signs(), self.signs)
            return False
        path = track() if track else lambda _: states
        while after - before > CLOSE * max(1.0, abs(after)):
            middle = 0.5 * (before + after)
            if self._has_event(middle, path(middle)):
                after = middle
            else:
                before = middle
        after += BEYOND * max(1.0, abs(after))
        if after < self.time:
            self.time, self.states = after, path(after)
        return True

    def _has_event(self, time: float, states: NDArray[np.float64]) -> bool:
        """Tell whether an indicator has come to be above zero, or is so no more."""
        if not len(self.signs):
            return False
        self._equations.place(time, states)
        above = self._equations.read_signs() > 0.0
        return bool(np.any((above != (self.signs > 0.0)) & (self.signs != 0.0)))

    def _advance(self, stop: float) -> Callable[[], Any] | None:
        """Take a step; return what gives the states inside it, as a function of time."""
        if not len(self.states):
            self.time = stop
            return None
        self._steps = self._steps + 1 if stop == self._stop else 1
        self._stop = stop
        if self._steps > STIFF_FROM and not self._stiff:
            self._stiff, self._solver = True, None
        with np.errstate(all="ignore"):
            solver = self._solver = self._solver_to(stop)
            message = solver.step()
        if message:
            raise IntegrationError(f"{type(solver).__name__} of SciPy says: {message}")
        self.time, self.states, self._length = float(solver.t), solver.y, solver.h_abs
        return cast("Callable[[], Any]", solver.dense_output)

    def _solver_to(self, stop: float) -> Any:
        if self._solver is not None:
            self._solver.t_bound, self._solver.status = stop, "running"
            return self._solver
        from scipy.integrate import DOP853, Radau  # costs a third of a second, which only model exchange shall pay

        method = Radau if self._stiff else DOP853
        try:
            return method(
                self._equations.rates,
                self.time,
                self.states,
                stop,
                rtol=self._relative,
                atol=self._relative * self._nominals,
                first_step=None if self._length is None else min(self._length, stop - self.time),
            )
        except ValueError as error:  # of values that are not finite
            raise IntegrationError(f"{method.__name__} of SciPy says: {error}") from None
