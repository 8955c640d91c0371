"""Running an FMU over a grid of time, and what to feed it with.

In all functions: ``t``: time [s]; ``phase``: of the signal [rad].
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.binding import Library
from orchestrator.checking.probing.cosimulation2 import CoSimulation2
from orchestrator.checking.probing.cosimulation3 import CoSimulation3
from orchestrator.checking.probing.driver import Driver, Habits
from orchestrator.checking.probing.events import ScheduledExecution
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.model_exchange import ModelExchange
from orchestrator.checking.probing.movement import Movement, moved
from orchestrator.checking.probing.statuses import SkippedError, StatusError
from orchestrator.checking.probing.variables import ProbedVariable, shown

_SWITCHED = (0.2, 0.55, 0.7, 0.85)
"""Shares of a run at which inputs change that are not continuous: away from the start value, and back."""
_DRIVERS: dict[tuple[str, str], type[Driver]] = {
    ("2.0", "CoSimulation"): CoSimulation2,
    ("2.0", "ModelExchange"): ModelExchange,
    ("3.0", "CoSimulation"): CoSimulation3,
    ("3.0", "ModelExchange"): ModelExchange,
    ("3.0", "ScheduledExecution"): ScheduledExecution,
}


class Bench:
    """One loaded FMU and the job: makes instances that are freed whatever happens.

    Attributes:
        report: called with rule, message, path and the time of the first one in words (``when``).
        excited: whether floating point inputs are moved in runs that are compared.
        held: what is not moved for once, by type and value reference.
        movement: what else is changed in them; nothing before the probe ``inputs`` has found what the FMU takes.
    """

    def __init__(self, job: ProbeJob, library: Library, report: Callable[..., None]) -> None:
        self.job = job
        self.library = library
        self.report = report
        self.excited = True
        self.movement = Movement()
        self.held: frozenset[tuple[str, int]] = frozenset()
        self._once = "canBeInstantiatedOnlyOncePerProcess" in job.flags
        self._used = False
        self._alive = 0

    def prepare(self, second: bool = False) -> None:
        """Make sure that an instance can be made: in another process where one has been made and only one may be.

        Raises:
            SkippedError: If another instance is alive, and this one is not meant to be a ``second`` one or must not be.
        """
        if self._alive and (self._once or not second):
            raise SkippedError("a second instance beside the first is needed")
        if self._once and self._used:
            self.library.renew()
        self._used = True

    @property
    def driver(self) -> type[Driver]:
        return _DRIVERS[self.job.version, self.job.interface]

    @contextmanager
    def instance(
        self,
        initialised: bool = True,
        name: str = "instance",
        moved: bool = True,
        second: bool = False,
        habits: Habits | None = None,
        **options: bool,
    ) -> Iterator[Driver]:
        """An instance, at its first communication point when ``initialised``.

        Args:
            moved: whether it starts from the values of ``movement``, not from those of the file.
            habits: of the importer (default: the usual ones).
            second: whether another instance may be alive; no other probe can have two, by mistake or on purpose.
        """
        self.prepare(second)
        number = self.driver.make(self.library, name, self.job.token, self.job, **options)
        if number is None:
            said = f" ({'; '.join(self.library.messages)})" if self.library.messages else ""
            function = f"{self.library.names.prefix}Instantiate"
            raise StatusError(function, 0, f"{function} must return an instance, but returned null{said}")
        made = self.driver(self.library, number, self.job, self.report)
        made.options(**options)
        self._alive += 1
        try:
            if habits is not None:
                made.habits = habits
                if habits.quiet:
                    made.quieten()
            if initialised:
                self.begin(made, moved)
            yield made
        finally:
            self._alive -= 1
            made.free()

    def begin(self, driver: Driver, moved: bool = True) -> None:
        """Bring a new or reset instance to the first communication point."""
        driver.driven = moved
        if moved:
            self.enter_moved(driver)
        else:
            driver.enter_initialisation(self.job.start, self.job.stop)
        driver.exit_initialisation()

    def enter_moved(self, driver: Driver) -> None:
        """Bring a new or reset instance into initialisation mode, with the values of the movement."""
        self.place(driver, inputs=False)
        driver.enter_initialisation(self.job.start, self.job.stop)
        self.place(driver, inputs=True)

    def place(self, driver: Driver, inputs: bool) -> None:
        """Set the values of the movement, those of inputs or all others, a type at a time."""
        values = self.movement.values
        for base in dict.fromkeys(v.base for v in values):
            group = self.movement.of_type(base, inputs)
            driver.set(group, [x for v in group for x in values[v]], "to values within their limits")

    def excite(self, driver: Driver, t: float, phase: float = 0.0) -> None:
        """Set the inputs to signals inside their bounds, so that something happens.

        Floating point ones are smooth; the others change in the middle of the run.
        """
        inputs = [v for v in self.job.inputs() if v.key not in self.held] if self.excited else []
        for base in dict.fromkeys(v.base for v in inputs):
            group = [v for v in inputs if v.base == base]
            share = self.movement.share
            values = [x for v in group for x in excitation(v, t - self.job.start, self.duration, phase, share)]
            driver.set(group, values, f"at t = {t:g}")
        self._switch(driver, t, phase)

    def _switch(self, driver: Driver, t: float, phase: float) -> None:
        """Set the inputs of other types where they change."""
        share = (t - self.job.start) / self.duration
        turns = [n for n, at in enumerate(_SWITCHED) if abs(share - at) * self.job.steps < 0.5]
        if not driver.driven or not self.movement.inputs or not turns:
            return
        which = turns[0] + (phase != 0.0)
        chosen = {v: moved(v, v.start or (), which // 2) if which % 2 == 0 else v.start for v in self.movement.inputs}
        driver.set_discrete({v: x for v, x in chosen.items() if x is not None}, t)

    @property
    def duration(self) -> float:
        """Seconds of simulated time of a test run."""
        return self.job.step * self.job.steps

    def run(
        self, driver: Driver, first: int = 0, last: int | None = None, excited: bool = True, read: bool = True
    ) -> list[list[Any]]:
        """Do the steps ``first`` to ``last`` and return the outputs after each one, [step][value].

        ``first``: first step, from 0. ``read``: whether the outputs are read; otherwise nothing is returned.
        """
        outputs = self.job.outputs()
        rows = []
        for n in range(first, self.job.steps if last is None else last):
            t = self.job.start + n * self.job.step
            if excited:
                self.excite(driver, t)
            driver.advance(t, self.job.step, f"at t = {t:g} (step {n + 1})")
            driver.pause(t + self.job.step)
            if read:
                rows.append(driver.read(outputs, f"at t = {t + self.job.step:g}"))
        return rows


def excitation(v: ProbedVariable, t: float, duration: float, phase: float = 0.0, share: float = 1.0) -> list[float]:
    """A sine of nearly two periods over the run beside each start value, a tenth of the nominal value high.

    It is beside the start value so that what integrates an input is not back where it began at any time. ``duration``:
    of the run [s]; ``share``: of the usual height.
    """
    low, high = v.limits
    wave = share * (0.4 + math.sin(3.7 * math.pi * t / duration + phase + 0.3))
    if low >= high:
        return [low] * v.size
    starts = [float(x) for x in v.start or (0.0,) * v.size]
    return [min(max(x + 0.1 * (v.nominal or max(abs(x), 1.0)) * wave, low), high) for x in starts]


def same(a: Any, b: Any) -> bool:
    """Equal bit for bit; NaN equals NaN. Return true when they are equal."""
    if isinstance(a, float) and isinstance(b, float):
        return a == b or (math.isnan(a) and math.isnan(b))
    return bool(a == b)


@dataclass(frozen=True)
class Difference:
    """How two runs differ."""

    text: str  # where they first do, in words
    relative: float  # the largest difference of a signal over the range of that signal

    def __str__(self) -> str:
        return self.text


def compare(a: list[list[Any]], b: list[list[Any]], names: Sequence[str]) -> Difference | None:
    """Hold run ``b`` against run ``a``, both [step][output]; None when they are equal bit for bit."""
    for n, (x, y) in enumerate(zip(a, b, strict=True)):
        for name, p, q in zip(names, x, y, strict=True):
            if not same(p, q):
                return Difference(f"`{name}` in step {n + 1} is {shown(q)} instead of {shown(p)}", _largest(a, b))
    return None


def _largest(a: list[list[Any]], b: list[list[Any]]) -> float:
    worst = 0.0
    for x, y in zip(zip(*a, strict=True), zip(*b, strict=True), strict=True):
        if all(map(same, x, y)):
            continue
        if not all(isinstance(v, float) and math.isfinite(v) for v in (*x, *y)):
            return math.inf
        size = max(max(x) - min(x), 1e-6 * max(map(abs, x)), 1e-300)
        worst = max(worst, max(abs(p - q) for p, q in zip(x, y, strict=True)) / size)
    return worst
