"""Running a slave over a grid of time, and what to feed it with."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.layered import ReferenceResult
from orchestrator.checking.probing.binding import Library, ProbedSlave, StatusError

_BASES = ("Real", "Integer", "Boolean", "String")


@dataclass(frozen=True)
class ProbedVariable:
    """A variable as the model description has it."""

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
class ProbeJob:
    """What is to be run.

    Attributes:
        start, stop, step: the experiment in s; ``stop`` is None when the FMU does not say.
        steps: number of communication steps of a test run.
        budget: seconds that a test run may take, of a :class:`Stopwatch`.
        flags: capability flags that are true.
        reference: the result to be reproduced, or None.
    """

    library: str
    guid: str
    resources: str
    variables: tuple[ProbedVariable, ...]
    start: float
    stop: float | None
    step: float
    tolerance: float | None
    steps: int
    budget: float
    flags: frozenset[str]
    reference: ReferenceResult | None

    def outputs(self) -> list[ProbedVariable]:
        """What a run records: the outputs, or all local variables when there are none.

        Returns:
            Variables, in the order of the description.
        """
        chosen = [v for v in self.variables if v.causality == "output"]
        return chosen or [v for v in self.variables if v.causality == "local"]

    def inputs(self) -> list[ProbedVariable]:
        """Real inputs.

        Returns:
            Variables, in the order of the description.
        """
        return [v for v in self.variables if v.causality == "input" and v.base == "Real"]


class Bench:
    """One loaded FMU and the job: makes instances that are freed whatever happens.

    Attributes:
        excited: whether inputs are moved in runs that are compared.
    """

    def __init__(self, job: ProbeJob, library: Library) -> None:
        self.job = job
        self.library = library
        self.excited = True

    @contextmanager
    def instance(self, initialised: bool = True, name: str = "instance") -> Iterator[ProbedSlave]:
        """An instance, in step mode when ``initialised``.

        Args:
            initialised: whether it is brought into step mode.
            name: of the instance.

        Yields:
            The instance.

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

    def initialise(self, slave: ProbedSlave) -> None:
        """Bring a new or reset instance into step mode.

        Args:
            slave: the instance.
        """
        slave.setup(self.job.start, self.job.stop, self.job.tolerance)
        slave.call("fmi2EnterInitializationMode")
        slave.call("fmi2ExitInitializationMode")

    def read(self, slave: ProbedSlave, variables: Sequence[ProbedVariable], when: str = "") -> list[Any]:
        """Values of ``variables``, in their order.

        Args:
            slave: the instance.
            variables: what to read, of any type.
            when: words for the message of an error.

        Returns:
            The values.
        """
        values: dict[int, Any] = {}
        for base in _BASES:
            group = [(i, v) for i, v in enumerate(variables) if v.base == base]
            read = slave.get(base, [v.reference for _, v in group], when)
            values.update(zip((i for i, _ in group), read, strict=True))
        return [values[i] for i in range(len(variables))]

    def excite(self, slave: ProbedSlave, t: float, phase: float = 0.0) -> None:
        """Set the Real inputs to a smooth signal inside their bounds, so that something happens.

        Args:
            slave: the instance.
            t: time [s].
            phase: of the signal [rad].
        """
        inputs = self.job.inputs() if self.excited else []
        values = [excitation(v, t - self.job.start, self.duration, phase) for v in inputs]
        slave.set("Real", [v.reference for v in inputs], values, f"at t = {t:g}")

    @property
    def duration(self) -> float:
        """Seconds of simulated time of a test run."""
        return self.job.step * self.job.steps

    def run(self, slave: ProbedSlave, first: int = 0, last: int | None = None, excited: bool = True) -> list[list[Any]]:
        """Do the steps ``first`` to ``last`` and return the outputs after each one, [step][output].

        Args:
            slave: the instance.
            first: first step, from 0.
            last: step to stop before; the job's number of steps when None.
            excited: whether inputs move.

        Returns:
            Outputs, [step][output].
        """
        outputs = self.job.outputs()
        rows = []
        for n in range(first, self.job.steps if last is None else last):
            t = self.job.start + n * self.job.step
            if excited:
                self.excite(slave, t)
            slave.step(t, self.job.step, f"at t = {t:g} (step {n + 1})")
            rows.append(self.read(slave, outputs, f"at t = {t + self.job.step:g}"))
        return rows


def excitation(v: ProbedVariable, t: float, duration: float, phase: float = 0.0) -> float:
    """A sine of two periods over the run around the start value, a tenth of the nominal value high.

    Args:
        v: a Real input.
        t: time [s].
        duration: of the run [s].
        phase: of the signal [rad].

    Returns:
        The value at ``t``, in the input's unit, within its bounds.
    """
    start = float(v.start or 0.0)
    height = 0.1 * (v.nominal or max(abs(start), 1.0))
    value = start + height * math.sin(4.0 * math.pi * t / duration + phase + 0.3)
    low = -math.inf if v.minimum is None else v.minimum
    high = math.inf if v.maximum is None else v.maximum
    return min(max(value, low), high)


def same(a: Any, b: Any) -> bool:
    """Equal bit for bit; NaN equals NaN.

    Args:
        a: the one value.
        b: the other.

    Returns:
        True when they are equal.
    """
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
    """Hold run ``b`` against run ``a``, both [step][output]; None when they are equal bit for bit.

    Args:
        a: the one run.
        b: the other, of as many steps.
        names: of the outputs.

    Returns:
        The first difference.
    """
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
