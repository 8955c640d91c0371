"""Running a slave over a grid of time, and what to feed it with."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.child.binding import Library, Slave, StatusError

_BASES = ("Real", "Integer", "Boolean", "String")


@dataclass(frozen=True)
class Variable:
    """A variable as the parent described it."""

    name: str
    reference: int
    base: str
    causality: str
    variability: str
    initial: str | None
    start: Any
    minimum: float | None
    maximum: float | None
    nominal: float | None


@dataclass(frozen=True)
class Job:
    """What the parent wants to be run.

    Attributes:
        start, stop, step: the experiment in s; ``stop`` is None when the FMU does not say.
        steps: number of communication steps of a test run.
        budget: seconds that a test run may take.
        flags: capability flags that are true.
        reference: names, rows of the reference result, or None.
    """

    library: str
    guid: str
    resources: str
    variables: tuple[Variable, ...]
    start: float
    stop: float | None
    step: float
    tolerance: float | None
    steps: int
    budget: float
    flags: frozenset[str]
    reference: dict[str, Any] | None

    def outputs(self) -> list[Variable]:
        """What a run records: the outputs, or all local variables when there are none."""
        chosen = [v for v in self.variables if v.causality == "output"]
        return chosen or [v for v in self.variables if v.causality == "local"]

    def inputs(self) -> list[Variable]:
        """Real inputs."""
        return [v for v in self.variables if v.causality == "input" and v.base == "Real"]


class Bench:
    """One loaded FMU and the job: makes instances that are freed whatever happens.

    Attributes:
        excited: whether inputs are moved in runs that are compared.
    """

    def __init__(self, job: Job, library: Library, beat: Callable[[], None]) -> None:
        self.job = job
        self.library = library
        self.beat = beat
        self.excited = True
        self._beaten = time.monotonic()

    def beat_sometimes(self) -> None:
        """Tell the parent every half second that this process lives."""
        if time.monotonic() - self._beaten > 0.5:
            self._beaten = time.monotonic()
            self.beat()

    @contextmanager
    def instance(self, initialised: bool = True, name: str = "instance") -> Iterator[Slave]:
        """An instance, in step mode when ``initialised``.

        Raises:
            StatusError: it cannot be made or initialised.
        """
        slave = self.library.instantiate(name, self.job.guid, self.job.resources)
        if slave is None:
            said = f" ({'; '.join(self.library.messages)})" if self.library.messages else ""
            raise StatusError("fmi2Instantiate", 0, f"fmi2Instantiate must return an instance, but returned null{said}")
        try:
            if initialised:
                self.initialise(slave)
            yield slave
        finally:
            slave.free()

    def initialise(self, slave: Slave) -> None:
        """Bring a new or reset instance into step mode."""
        slave.setup(self.job.start, self.job.stop, self.job.tolerance)
        slave.call("fmi2EnterInitializationMode")
        slave.call("fmi2ExitInitializationMode")

    def read(self, slave: Slave, variables: Sequence[Variable], when: str = "") -> list[Any]:
        """Values of ``variables``, in their order."""
        values: dict[int, Any] = {}
        for base in _BASES:
            group = [(i, v) for i, v in enumerate(variables) if v.base == base]
            read = slave.get(base, [v.reference for _, v in group], when)
            values.update(zip((i for i, _ in group), read, strict=True))
        return [values[i] for i in range(len(variables))]

    def excite(self, slave: Slave, t: float, phase: float = 0.0) -> None:
        """Set the Real inputs to a smooth signal inside their bounds, so that something happens."""
        inputs = self.job.inputs() if self.excited else []
        values = [excitation(v, t - self.job.start, self.duration, phase) for v in inputs]
        slave.set("Real", [v.reference for v in inputs], values, f"at t = {t:g}")

    @property
    def duration(self) -> float:
        """Seconds of simulated time of a test run."""
        return self.job.step * self.job.steps

    def run(self, slave: Slave, first: int = 0, last: int | None = None, excited: bool = True) -> list[list[Any]]:
        """Do the steps ``first`` to ``last`` and return the outputs after each one, [step][output]."""
        outputs = self.job.outputs()
        rows = []
        for n in range(first, self.job.steps if last is None else last):
            t = self.job.start + n * self.job.step
            if excited:
                self.excite(slave, t)
            slave.step(t, self.job.step, f"at t = {t:g} (step {n + 1})")
            rows.append(self.read(slave, outputs, f"at t = {t + self.job.step:g}"))
            self.beat_sometimes()
        return rows


def excitation(v: Variable, t: float, duration: float, phase: float = 0.0) -> float:
    """A sine of two periods over the run around the start value, a tenth of the nominal value high."""
    start = float(v.start or 0.0)
    height = 0.1 * (v.nominal or max(abs(start), 1.0))
    value = start + height * math.sin(4.0 * math.pi * t / duration + phase + 0.3)
    low = -math.inf if v.minimum is None else v.minimum
    high = math.inf if v.maximum is None else v.maximum
    return min(max(value, low), high)


def same(a: Any, b: Any) -> bool:
    """Equal bit for bit; NaN equals NaN."""
    if isinstance(a, float) and isinstance(b, float):
        return a == b or (math.isnan(a) and math.isnan(b))
    return bool(a == b)


@dataclass(frozen=True)
class Difference:
    """How two runs differ.

    Attributes:
        text: where they first do, in words.
        relative: the largest difference of a signal over the range of that signal.
    """

    text: str
    relative: float

    def __str__(self) -> str:
        return self.text


def compare(a: list[list[Any]], b: list[list[Any]], names: Sequence[str]) -> Difference | None:
    """Hold run ``b`` against run ``a``, both [step][output]; None when they are equal bit for bit."""
    for n, (x, y) in enumerate(zip(a, b, strict=True)):
        for name, p, q in zip(names, x, y, strict=True):
            if not same(p, q):
                return Difference(f"`{name}` in step {n + 1} is {q!r} instead of {p!r}", _largest(a, b))
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
