"""Laws that resist a body in proportion to one value, wherever a body is: a row for the plants and any FMU's port."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from orchestrator.effects.effect import BOTH_PLANTS, Effect, PlaceScales, SignalScales
from pyfmu_sources.laws import body


@dataclass(frozen=True)
class BodyLaw:
    """A law of :mod:`pyfmu_sources.laws.body`, at the load of plants, and at a port."""

    name: str
    kind: str  # what sort of law it is
    value: str  # short name of its coefficient, ``effects.NAME.VALUE`` in the plants' tables
    unit: str  # of the coefficient at a port, where "effort" and "flow" stand for the units there
    small: Callable[[float, float], float]  # (typical torque, typical speed) -> a small change of the coefficient
    number: int  # of the law at a port
    motion: str  # what it does to the motion, in words of a drive engineer
    plants: tuple[str, ...] = BOTH_PLANTS  # on which it stands


LAWS = (
    BodyLaw(
        "quadratic_drag", "speed", "coefficient", "effort.s2/flow2", lambda torque, speed: 0.01 * torque / speed**2,
        body.QUADRATIC, "a braking torque in proportion to the square of the speed",
    ),
)  # fmt: skip


def _at_load(law: BodyLaw) -> Effect:
    def small(scales: SignalScales) -> dict[str, float]:
        return {law.value: law.small(scales.torque_at("load"), scales.rms_speed("load"))}

    return Effect(
        law.name, "load", law.kind, {law.value: f"effects.{law.name}.{law.value}"}, law.value, small,
        amplitudes=(law.value,), signed=False, against="speed", motion=law.motion, plants=law.plants,
    )  # fmt: skip


def is_positive(values: Mapping[str, float], scales: Any) -> bool:
    """Tell whether the first of the ``values`` is above zero, whatever the ``scales``."""
    del scales
    return next(iter(values.values())) > 0.0


def _at_port(law: BodyLaw) -> Effect:
    def small(scales: PlaceScales) -> dict[str, float]:
        return {law.value: law.small(scales.size, scales.speed)}

    return Effect(
        law.name, "port", law.kind, {law.value: law.unit}, law.value, small, amplitudes=(law.value,), law=law.number,
        signed=False, possible=is_positive,
    )  # fmt: skip


AT_LOAD = tuple(map(_at_load, LAWS))
AT_PORT = tuple(map(_at_port, LAWS))
