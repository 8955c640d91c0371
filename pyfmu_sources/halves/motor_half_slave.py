"""The FMU ``MotorHalf``: adapter from FMI to :mod:`motor_half`.

In all functions: ``time`` [s]; ``step`` [s].
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from ..adapters.fmu_variables import LARGEST, FmuVariable, Terminals
from ..adapters.slave_base import SlaveBase, StepRefusedError
from ..hybrid.event_numbers import NO_EVENT
from . import motor_half
from .motor_half import Outputs, Parameters, State, rates_and_outputs

U, T_SHAFT, THETA_M, OMEGA_M, T_M, FIRST_PARAMETER = range(6)
FIRST_START = FIRST_PARAMETER + 4
MOST_PIECES = 1e6


class MotorHalf(SlaveBase):
    """A motor with its lag, which a gear's other half loads; the inputs are held over a communication step."""

    title = "Motor's half of a drivetrain: the torque of its shaft comes from the other half"
    table: ClassVar[tuple[FmuVariable, ...]] = (
        FmuVariable("u", "input", "N.m", 0.0, "Requested motor torque", nominal=100.0),
        FmuVariable("T_shaft", "input", "N.m", 0.0, "Torque of the shaft on the load", nominal=100.0),
        FmuVariable("theta_m", "output", "rad", None, "Motor angle", starts_from=("theta_m_start",)),
        FmuVariable("omega_m", "output", "rad/s", None, "Motor speed", nominal=10.0, starts_from=("omega_m_start",)),
        FmuVariable("T_m", "output", "N.m", None, "Motor torque", nominal=100.0, starts_from=("T_m_start",)),
        FmuVariable("J_m", "parameter", "kg.m2", 0.4, "Motor inertia", 1e-9, 1e9),
        FmuVariable("b_m", "parameter", "N.m.s/rad", 0.1, "Viscous friction of the motor", 0.0, 1e9),
        FmuVariable("i", "parameter", "1", 3.984, "Gear ratio: motor angle over load angle", 1e-6, 1e6),
        FmuVariable("tau", "parameter", "s", 0.05, "Time constant of the motor's torque", 1e-6, 1e6),
        FmuVariable("theta_m_start", "parameter", "rad", 0.0, "Initial motor angle", -1e12, 1e12),
        FmuVariable("omega_m_start", "parameter", "rad/s", 0.0, "Initial motor speed", -1e12, 1e12),
        FmuVariable("T_m_start", "parameter", "N.m", 0.0, "Initial motor torque", -1e12, 1e12),
    )
    terminals: ClassVar[Terminals] = {
        "shaft": {"angle": "theta_m", "speed": "omega_m", "torque": "T_shaft"},
        "encoder": {"angle": "theta_m"},
    }

    _x: State
    _p: Parameters
    _event: int

    state_attribute: ClassVar[str] = "_x"
    continuous_states: ClassVar[tuple[tuple[str, str, float, str], ...]] = (
        ("state.theta_m", "rad", 1.0, "Motor angle"),
        ("state.omega_m", "rad/s", 10.0, "Motor speed"),
        ("state.T_m", "N.m", 100.0, "Motor torque"),
    )
    response: ClassVar[Callable[..., Any]] = rates_and_outputs
    response_outputs: ClassVar[tuple[str, ...]] = ("theta_m", "omega_m", "T_m")

    def initialise(self) -> None:
        """Read the parameters and start at the initial state."""
        real = self.real
        n = FIRST_PARAMETER
        self._p = Parameters(real[n], real[n + 1], real[n + 2], real[n + 3])
        self._x = (real[FIRST_START], real[FIRST_START + 1], real[FIRST_START + 2])
        self._event = NO_EVENT
        self._write()

    def advance(self, time: float, step: float) -> None:
        """Move on with the inputs held."""
        p = self._p
        if step * (p.b_m / p.J_m + 1.0 / p.tau) > MOST_PIECES:
            raise StepRefusedError(f"a step must take at most {MOST_PIECES!r} pieces, but is {step!r} s long")
        x = motor_half.advance(self._x, p, self.real[U], self.real[T_SHAFT], step)
        if not -LARGEST <= x[0] + x[1] + x[2] <= LARGEST:
            raise StepRefusedError(f"the state must stay finite, but is {x!r} after a step of {step!r} s")
        self._x = x
        self._write()

    def advance_to_event(self, time: float, step: float) -> float:
        """Move on, and return how far it is [s]: nothing happens to a motor by itself."""
        self.advance(time, step)
        return step

    def derivatives(self) -> State:
        """Return the derivatives of the state."""
        r, _ = rates_and_outputs(self._x, self._p, self.real[U], self.real[T_SHAFT])
        return r

    def output_rates(self) -> Outputs:
        """Return the derivatives of the outputs, inputs held, SI units per second."""
        return self.derivatives()

    def update(self, time: float) -> None:
        """Write the outputs at an event, which leaves the state as it is."""
        self._write()

    def observe(self) -> None:
        """Write the outputs."""
        self._write()

    def _write(self) -> None:
        self.real[THETA_M] = self._x[0]
        self.real[OMEGA_M] = self._x[1]
        self.real[T_M] = self._x[2]
