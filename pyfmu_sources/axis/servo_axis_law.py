"""The FMU ``ServoAxis`` with a law that was learned from a record."""

from __future__ import annotations

from typing import ClassVar

from ..adapters.learned_plant import LawValues, Pushes, WithLaw
from ..laws.learned_law import L_DRY, Motion
from ..laws.parameter_rows import Parameter
from . import servo_axis
from .axis_equations import PARAMETERS, AxisParameters
from .servo_axis import State
from .servo_axis_modes import UNDECIDED
from .servo_axis_slave import FIRST_START, T_L, ServoAxis


class ServoAxisWithLaw(WithLaw, ServoAxis):
    """One inertia behind the lag of its drive, and a learned torque against it."""

    plant_parameters: ClassVar[tuple[Parameter, ...]] = PARAMETERS

    _rubbing: AxisParameters
    _law: LawValues
    _now: float
    _piece: float

    def _begin_with(self, p: AxisParameters) -> None:
        real = self.real
        self._p = p
        self._x = servo_axis.start(real[FIRST_START], real[FIRST_START + 1], real[FIRST_START + 2], p)
        self._mode = UNDECIDED

    def _rubbed(self, p: AxisParameters) -> AxisParameters:
        return p._replace(coulomb_friction_motor_torque=p.coulomb_friction_motor_torque + self._law[L_DRY])

    def _inertias(self) -> tuple[float, float, float]:
        return (self._p.J, self._p.J, 1.0)

    def _motion(self, x: State, u: float) -> Motion:
        return (x[1], x[1], x[0], 0.0, servo_axis.drive_torque(x, self._p, u))

    def _mode_of(self, x: State, mode: int, p: AxisParameters, u: float) -> int:
        return servo_axis.initial_mode(x, p, u)

    def _pushed(
        self, x: State, mode: int, p: AxisParameters, u: float, against: Pushes, step: float
    ) -> tuple[State, int]:
        """Return state and mode after a piece of a step with torques held against the one body."""
        T_l = self.real[T_L] + against[0] + against[1]
        if mode == UNDECIDED:
            mode = servo_axis.initial_mode(x, p, u - against[0] - against[1])
        return servo_axis.advance(x, mode, p, u, T_l, step)
