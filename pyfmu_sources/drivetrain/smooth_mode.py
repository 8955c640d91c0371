"""The drivetrain with nonlinear effects, moved by the hybrid machine that is bound to it."""

from collections.abc import Callable

from ..hybrid import machine as template
from ..hybrid.binding import bind
from . import hybrid_plant
from .equations import Mode, Parameters, State

machine = bind(template, hybrid_plant)
Moved = tuple[State, Mode]
Located = tuple[State, Mode, float, int]

advance_smooth: Callable[[State, Mode, Parameters, float, float, float], Moved] = machine.advance
smooth_to_event: Callable[[State, Mode, Parameters, float, float, float], Located] = machine.advance_to_event
after_events: Callable[..., tuple[State, Mode, int]] = machine.after_events
indicators: Callable[[State, Mode, Parameters, float, float], tuple[float, ...]] = machine.indicators
refused: Callable[[State], State] = machine.refused
