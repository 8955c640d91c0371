"""The excitation that would show a gap."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orchestrator.api.estimable import require_linear
from orchestrator.api.sampled import SampledResult
from orchestrator.api.shown import Block
from orchestrator.errors import ScenarioError
from orchestrator.estimation import design as designing
from orchestrator.estimation.apply import UNSEEN
from orchestrator.estimation.design import LONGEST, SHORTEST, Excitation, MachineLimits
from orchestrator.estimation.protocol import DEFAULT_SIZE
from orchestrator.records.columns import Column, scale_of, unit_of
from orchestrator.records.formats.heads import head_of
from orchestrator.records.model_file import Model, read_model
from orchestrator.records.plausibility import LONGEST_STEP, natural_frequency
from orchestrator.records.record import MINIMUM_ROWS
from orchestrator.shared.numbers import within
from orchestrator.shared.results.estimate import EstimateFound, ExcitationFound
from orchestrator.shared.results.fields import fields_table

# Least and largest value of each argument: rad, N.m, rad/s, s, Hz.
RANGES = {
    "size": (1e-5, 0.5),
    "torque_limit": (1e-3, 1e6),
    "speed_limit": (1e-3, 1e5),
    "duration": (SHORTEST, 1e4),
    "rate": (1.0, 1e5),
}


@dataclass(frozen=True)
class RequestUnit:
    """How a drive takes its request: ``label`` names it with its unit; numbers are of the log's column of ``u``."""

    label: str
    scale: float
    factor: float
    offset: float

    def number(self, torque: Any) -> Any:
        """Return the number that asks for a torque [N.m], or those of an array."""
        return (torque / self.scale - self.offset) / self.factor


@dataclass(frozen=True, repr=False)
class DesignResult(SampledResult):
    """Excitations for one gap, the best first.

    Attributes:
        size: half-gap that is to be seen [rad].
        time: the grid [s], shape (n,).
        candidates: what was judged: torque ``u`` [N.m] of shape (n,), and the bound on the half-gap [rad].
        request: the unit in which the model file says that the drive takes its request; None: N.m, or volts.
    """

    command: ClassVar[str] = "estimate"
    csv_name: ClassVar[str] = "design"
    digits: ClassVar[int | None] = 9
    replaces: ClassVar[tuple[str, ...]] = ("estimate.png",)
    size: float
    time: NDArray[np.float64]
    candidates: tuple[Excitation, ...]
    request: RequestUnit | None = None

    @property
    def best(self) -> Excitation:
        """The excitation with the smallest bound."""
        return self.candidates[0]

    @property
    def shows(self) -> bool:
        """Whether the best excitation shows a gap of this size: its bound is below half of it."""
        return self.best.bound <= 0.5 * self.size

    def signals(self) -> Mapping[str, NDArray[np.float64]]:
        """Return the best record: ``u`` [N.m], and the request as the drive takes it where that differs."""
        columns = {"time": self.time, "u": self.best.u}
        request = self.request
        return columns if request is None else columns | {request.label: request.number(self.best.u)}

    def blocks(self) -> Sequence[Block]:
        request, best = self.request, self.best
        duration = float(self.arguments["duration"])
        title = f"To see a half-gap of {self.size:g} rad in {duration:g} s"
        rows = [_entry(c, " (design.csv)" if c is best else "") for c in self.candidates]
        shown: list[Block] = [fields_table(title, rows)]
        if request is not None:
            peak = max(abs(request.number(best.torque)), abs(request.number(-best.torque)))
            shown.append(f"design.csv has the request in `{request.label}` too, at most {peak:.4g}.")
        return shown

    def entries(self) -> tuple[ExcitationFound, ...]:
        """List the candidates that see anything, as ``estimate.json`` does.

        Returns:
            Name, bound [rad], peak torque [N.m] and peak motor speed [rad/s] of each.
        """
        return tuple(_entry(c) for c in self.candidates if c.bound < UNSEEN)

    def results(self, place: Path | None = None) -> EstimateFound:
        return EstimateFound(design=self.entries())


def _entry(c: Excitation, more: str = "") -> ExcitationFound:
    return ExcitationFound(c.name + more, c.bound if c.bound < UNSEEN else None, c.torque, c.speed)


def check_design(
    model: Model, size: float | None, torque_limit: float, speed_limit: float, duration: float, rate: float
) -> None:
    """Refuse a design that cannot be made.

    Args:
        size: half-gap that is to be seen [rad], or None where it is not known yet.
        torque_limit: [N.m].
        speed_limit: [rad/s] of the motor.
        duration: [s].
        rate: samples per second [Hz].
    """
    given = {"torque_limit": torque_limit, "speed_limit": speed_limit, "duration": duration, "rate": rate}
    for name, value in (({} if size is None else {"size": size}) | given).items():
        within(name, value, *RANGES[name])
    rows = duration * rate
    if not MINIMUM_ROWS <= round(rows) <= LONGEST:
        text = f"`duration` times `rate` must be {MINIMUM_ROWS} to {LONGEST} samples, but is {rows:g}"
        raise ScenarioError(text, "duration", "rate")
    own = natural_frequency(model)
    if rate * LONGEST_STEP < own:
        raise ScenarioError(
            f"`rate` must be at least {math.ceil(own / LONGEST_STEP)} to show a shaft that oscillates at {own:.3g} "
            f"rad/s, but is {rate:g}",
            "rate",
        )


def design(
    model: Model | None = None,
    size: float = DEFAULT_SIZE,
    *,
    torque_limit: float = 250.0,
    speed_limit: float = 50.0,
    duration: float = 10.0,
    rate: float = 200.0,
    motor_only: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> DesignResult:
    """Propose the torque record that shows a gap best.

    Args:
        model: of the machine (default: ``read_model()``).
        size: half-gap that is to be seen [rad].
        torque_limit: largest torque to ask for [N.m].
        speed_limit: largest speed of the motor [rad/s].
        duration: length of the record [s].
        rate: its samples per second [Hz].
        motor_only: whether there is no load encoder.
        progress: called with (candidates done, in all).

    Returns:
        All candidates, the best first, each with the bound on the half-gap that its record would give.

    Raises:
        ScenarioError: a number is out of its range, or the model has effects that estimators would not see.

    Examples:
        >>> plan = oc.design(size=0.005, duration=2.0)
        >>> plan.shows
        True
        >>> plan.write_csv("excitation.csv")
    """
    model = read_model(None) if model is None else model
    require_linear(model)
    check_design(model, size, torque_limit, speed_limit, duration, rate)
    limits = MachineLimits(torque_limit, speed_limit)
    time, candidates = designing.design(model, size, limits, duration, rate, motor_only, progress)
    given = {"size": size, "torque_limit": torque_limit, "speed_limit": speed_limit, "duration": duration}
    given |= {"rate": rate, "motor_only": motor_only}
    return DesignResult(size, time, tuple(candidates), _request_unit(model), arguments=given)


def _request_unit(model: Model) -> RequestUnit | None:
    """Return the unit of the drive's request as the model file has it."""
    column = model.columns.get("u", Column())
    head = head_of(column.name)
    unit = unit_of("u", column, head.unit, column.name, model.source)
    if unit is None or unit.kind == "voltage" or (unit.factor, column.factor, unit.kind) == (1.0, 1.0, "torque"):
        return None
    scale = scale_of("u", column, unit, column.name, model.source)
    return RequestUnit(f"{head.name or 'request'} [{column.unit or head.unit}]", scale, column.factor, column.offset)
