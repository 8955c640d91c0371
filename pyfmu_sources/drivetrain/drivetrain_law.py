"""The FMU ``Drivetrain`` with a law that was learned from a record."""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar

from ..adapters.learned_plant import LawValues, Pushes, WithLaw
from ..laws.drive import UNASKED
from ..laws.learned_law import L_DRY, LOAD_SPEED, TWIST, Motion, kind_of
from ..laws.parameter_rows import Parameter
from . import drivetrain
from .drivetrain import Mode, State
from .drivetrain_slave import T_L, T_SHAFT, Drivetrain, Parameters
from .equations import PARAMETERS

_prepare = lru_cache(maxsize=256)(drivetrain.prepare)
DIGITS = 12  # of a piece's length: equal pieces differ by rounding


class DrivetrainWithLaw(WithLaw, Drivetrain):
    """Motor with lag, gear with play, elastic shaft, load, and a learned torque on one of them."""

    plant_parameters: ClassVar[tuple[Parameter, ...]] = PARAMETERS

    _rubbing: Parameters
    _law: LawValues
    _now: float
    _piece: float

    def _begin_with(self, p: Parameters) -> None:
        x = self._x
        self._p = p
        self._x = drivetrain.consistent_start((x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]), p)
        self._mode = drivetrain.initial_mode(self._x, p)

    def _rubbed(self, p: Parameters) -> Parameters:
        dry = self._law[L_DRY]
        if kind_of(self._law) == LOAD_SPEED:
            return p._replace(coulomb_friction_load_torque=p.coulomb_friction_load_torque + dry)
        return p._replace(coulomb_friction_motor_torque=p.coulomb_friction_motor_torque + dry)

    def _inertias(self) -> tuple[float, float, float]:
        return (self._p.J_m, self._p.J_l, self._p.i)

    def _motion(self, x: State, u: float) -> Motion:
        return (x[1], x[3], x[2], x[0] / self._p.i - x[2], x[4])

    def _mode_of(self, x: State, mode: Mode, p: Parameters, u: float) -> Mode:
        _, slip_m, slip_l = drivetrain.initial_mode(x, p)
        return (mode[0], slip_m, slip_l)

    def _pushed(
        self, x: State, mode: Mode, p: Parameters, u: float, against: Pushes, step: float
    ) -> tuple[State, Mode]:
        """Return state and mode after a piece of a step with torques held against motor and load.

        A torque against the motor is a drive that gives so much less: its lag and its filter are linear.
        """
        less, load = against
        table = _prepare(p, float(f"{step:.{DIGITS}g}"))
        moved, mode = drivetrain.advance(_with_less(x, less), mode, p, u - less, self.real[T_L] + load, step, table)
        return _with_less(moved, -less), mode

    def refresh(self) -> None:
        """Recompute the shaft torque; that of a law on the shaft is part of it."""
        if not self._acts():
            super().refresh()
            return
        less, load = self._pushes(self._x, 0.0, self._clock())
        T_l = self.real[T_L] + load if kind_of(self._law) != TWIST else self.real[T_L]
        torque = drivetrain.shaft_torque(_with_less(self._x, less), self._mode, self._rubbing, T_l)
        self.real[T_SHAFT] = torque - load if kind_of(self._law) == TWIST else torque


def _with_less(x: State, less: float) -> State:
    """Return a state whose drive delivers so much less [N.m]."""
    filtered = x[11] if x[11] == UNASKED else x[11] - less
    return (x[0], x[1], x[2], x[3], x[4] - less, x[5], x[6], x[7], x[8], x[9], x[10], filtered)
