"""The FMU ``LoadHalf``: adapter from FMI to :mod:`load_half`.

In all functions: ``time`` [s]; ``step`` [s].
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from ..adapters.fmu_variables import LARGEST, FmuVariable, Terminals
from ..adapters.slave_base import SlaveBase, StepRefusedError
from ..hybrid.event_numbers import NO_EVENT
from . import load_half
from .load_half import Motion, Outputs, Parameters, State, cubic_motion, held_motion, rates_and_outputs

THETA_M, OMEGA_M, T_L, THETA_L, OMEGA_L, T_SHAFT, CONTACT, FIRST_PARAMETER = range(8)
FIRST_START = FIRST_PARAMETER + 6
MOST_PIECES = 1e6

Node = tuple[float, float]
_DRIVING = ("theta_m", "omega_m")
_SHAFT = (*_DRIVING, "k", "c", "i", "alpha", "theta_l_start", "omega_l_start")


class LoadHalf(SlaveBase):
    """Gap, shaft and load, driven by the motion of a motor that is another FMU.

    Without intermediate updates the inputs are held over a communication step; with them the motor moves on cubics
    through the angles and speeds at the step's begin, middle and end.
    """

    title = "Load's half of a drivetrain: gear with play, elastic shaft and load, driven by a motor's motion"
    feedthrough = True
    follows_inputs: ClassVar[bool] = True
    table: ClassVar[tuple[FmuVariable, ...]] = (
        FmuVariable("theta_m", "input", "rad", 0.0, "Motor angle"),
        FmuVariable("omega_m", "input", "rad/s", 0.0, "Motor speed", nominal=10.0),
        FmuVariable("T_l", "input", "N.m", 0.0, "External torque against the load", nominal=100.0),
        FmuVariable("theta_l", "output", "rad", None, "Load angle", starts_from=("theta_l_start",)),
        FmuVariable("omega_l", "output", "rad/s", None, "Load speed", nominal=10.0, starts_from=("omega_l_start",)),
        FmuVariable(
            "T_shaft", "output", "N.m", None, "Torque of the shaft on the load", None, None, 100.0,
            depends_on=_DRIVING, starts_from=_SHAFT,
        ),
        FmuVariable(
            "contact", "output", "", None, "Flank that touches: -1, 0 (none) or 1", -1, 1, type="Integer",
            starts_from=("theta_m", "i", "alpha", "theta_l_start"),
        ),
        FmuVariable("J_l", "parameter", "kg.m2", 5.6, "Load inertia", 1e-9, 1e9),
        FmuVariable("k", "parameter", "N.m/rad", 3300.0, "Shaft stiffness, load side", 0.0, 1e12),
        FmuVariable("c", "parameter", "N.m.s/rad", 1.0, "Shaft damping, load side", 0.0, 1e12),
        FmuVariable("b_l", "parameter", "N.m.s/rad", 1.0, "Viscous friction of the load", 0.0, 1e9),
        FmuVariable("i", "parameter", "1", 3.984, "Gear ratio: motor angle over load angle", 1e-6, 1e6),
        FmuVariable("alpha", "parameter", "rad", 0.01, "Half-gap at the load", 0.0, 1e6),
        FmuVariable("theta_l_start", "parameter", "rad", 0.0, "Initial load angle", -1e12, 1e12),
        FmuVariable("omega_l_start", "parameter", "rad/s", 0.0, "Initial load speed", -1e12, 1e12),
    )  # fmt: skip
    terminals: ClassVar[Terminals] = {
        "shaft": {"angle": "theta_m", "speed": "omega_m", "torque": "T_shaft"},
        "encoder": {"angle": "theta_l"},
    }

    _x: State
    _contact: int
    _p: Parameters
    _event: int
    _begin: Node
    _middle: Node
    _end: Node

    state_attribute: ClassVar[str] = "_x"
    continuous_states: ClassVar[tuple[tuple[str, str, float, str], ...]] = (
        ("state.theta_l", "rad", 1.0, "Load angle"),
        ("state.omega_l", "rad/s", 10.0, "Load speed"),
    )
    response: ClassVar[Callable[..., Any]] = rates_and_outputs
    response_outputs: ClassVar[tuple[str, ...]] = ("theta_l", "omega_l", "T_shaft")

    def initialise(self) -> None:
        """Read the parameters and start at the initial state."""
        real = self.real
        n = FIRST_PARAMETER
        self._p = Parameters(real[n], real[n + 1], real[n + 2], real[n + 3], real[n + 4], real[n + 5])
        self._x = (real[FIRST_START], real[FIRST_START + 1])
        self._contact = self._settled(0)
        self._event = NO_EVENT
        for node in range(3):
            self.take_node(node)
        self._write()

    def advance(self, time: float, step: float) -> None:
        """Move on with the inputs held."""
        self._check(step)
        motion = held_motion(self.real[THETA_M], self.real[OMEGA_M])
        x, contact = load_half.advance(self._x, self._contact, self._p, motion, self.real[T_L], 0.0, step)
        self._take(x, contact, NO_EVENT, step)

    def advance_to_event(self, time: float, step: float) -> float:
        """Move on with the inputs held, up to the first event, and return how far it is [s]."""
        self._check(step)
        motion = held_motion(self.real[THETA_M], self.real[OMEGA_M])
        x, taken, event = load_half.advance_to_event(self._x, self._contact, self._p, motion, self.real[T_L], 0.0, step)
        self._take(x, self._contact, event, step)
        return taken

    def take_node(self, node: int) -> None:
        """Take the inputs of the moment for the begin (0), the middle (1) or the end (2) of the next step."""
        motion = (self.real[THETA_M], self.real[OMEGA_M])
        if node == 0:
            self._begin = motion
        elif node == 1:
            self._middle = motion
        else:
            self._end = motion

    def advance_along(self, time: float, step: float, to_event: bool) -> float:
        """Move on along the motion through the three nodes, leave its end as the inputs, return how far it is [s]."""
        self._check(step)
        half = 0.5 * step
        first = cubic_motion(self._begin[0], self._begin[1], self._middle[0], self._middle[1], half)
        second = cubic_motion(self._middle[0], self._middle[1], self._end[0], self._end[1], half)
        p, T_l = self._p, self.real[T_L]
        contact = self._contact
        if not to_event:
            x, contact = load_half.advance(self._x, contact, p, first, T_l, 0.0, half)
            x, contact = load_half.advance(x, contact, p, second, T_l, 0.0, half)
            self._arrive(second, half)
            self._take(x, contact, NO_EVENT, step)
            return step
        x, taken, event = load_half.advance_to_event(self._x, contact, p, first, T_l, 0.0, half)
        if event != NO_EVENT:
            self._arrive(first, taken)
            self._take(x, contact, event, step)
            return taken
        x, taken, event = load_half.advance_to_event(x, contact, p, second, T_l, 0.0, half)
        self._arrive(second, taken)
        self._take(x, contact, event, step)
        return step if event == NO_EVENT else half + taken

    def _arrive(self, motion: Motion, time: float) -> None:
        """Leave a point of the motion as the inputs."""
        there = load_half.moved(motion, time)
        self.real[THETA_M] = there[0]
        self.real[OMEGA_M] = there[4]

    def _settled(self, contact: int) -> int:
        """Return the flank that touches at the inputs of the moment."""
        theta_m, omega_m = self.real[THETA_M], self.real[OMEGA_M]
        return load_half.settled(self._x, contact, self._p, theta_m, omega_m / self._p.i - self._x[1])

    def _check(self, step: float) -> None:
        """Refuse a step that is far too long."""
        if step * load_half.fastest(self._p) > MOST_PIECES:
            raise StepRefusedError(f"a step must take at most {MOST_PIECES!r} pieces, but is {step!r} s long")

    def _take(self, x: State, contact: int, event: int, step: float) -> None:
        """Take over a state that is finite, or refuse the step."""
        if not -LARGEST <= x[0] + x[1] <= LARGEST:
            raise StepRefusedError(f"the state must stay finite, but is {x!r} after a step of {step!r} s")
        self._x = x
        self._contact = contact
        self._event = event
        self._write()

    def derivatives(self) -> State:
        """Return the derivatives of the state."""
        real = self.real
        r, _ = rates_and_outputs(self._x, self._contact, self._p, real[THETA_M], real[OMEGA_M], real[T_L])
        return r

    def output_rates(self) -> Outputs:
        """Return the derivatives of the outputs, while the motor keeps its speed, SI units per second."""
        r = self.derivatives()
        p = self._p
        rate = p.k * (self.real[OMEGA_M] / p.i - self._x[1]) - p.c * r[1] if self._contact != 0 else 0.0
        return (r[0], r[1], rate)

    def indicators(self) -> tuple[float, float]:
        """Return the event indicators: the rooms at both flanks."""
        theta_m = self.real[THETA_M]
        one, other = load_half.guards(self._x, self._contact, self._p, theta_m)
        room = 2.0 * load_half.rounding(self._x, self._p, theta_m)
        return (one + room, other + room)

    def update(self, time: float) -> None:
        """Give an event its effect, and settle the contact at the inputs of the moment."""
        if self._event != NO_EVENT:
            self._contact = load_half.after(self._contact, self._event)
            self._event = NO_EVENT
        self._contact = self._settled(self._contact)
        self._write()

    def observe(self) -> None:
        """Write the outputs at the inputs of the moment."""
        self._write()

    def refresh(self) -> None:
        """Recompute the torque, which follows the motor at once."""
        real = self.real
        contact = self._settled(self._contact)
        real[T_SHAFT] = load_half.shaft_torque(self._x, contact, self._p, real[THETA_M], real[OMEGA_M])

    def _write(self) -> None:
        real = self.real
        real[THETA_L] = self._x[0]
        real[OMEGA_L] = self._x[1]
        real[T_SHAFT] = load_half.shaft_torque(self._x, self._contact, self._p, real[THETA_M], real[OMEGA_M])
        self.integer[CONTACT] = self._contact
