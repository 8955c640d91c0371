"""The FMU ``ServoAxis``: adapter from FMI to :mod:`servo_axis`, without any physics of its own."""

from __future__ import annotations

from typing import Any, ClassVar

from . import servo_axis
from .dead_time import Requests, split_step
from .effects import saturated
from .fmu_variables import LARGEST, Variable
from .servo_axis import P_DELAY, P_LIMIT, P_OFFSET, PARAMETERS
from .slave_base import SlaveBase, StepRefusedError

U, T_L, THETA_M, OMEGA_M, T_M = range(5)
FIRST_PARAMETER = T_M + 1
FIRST_START = FIRST_PARAMETER + len(PARAMETERS)

_OFFSET = "effects.sensor_offset.motor.offset"


class ServoAxis(SlaveBase):
    """One inertia behind the lag of its drive; the inputs are held over a communication step."""

    title = "Single axis: one inertia behind the torque lag of its drive"
    table: ClassVar[tuple[Variable, ...]] = (
        Variable("u", "input", "N.m", 0.0, "Requested torque", nominal=100.0),
        Variable("T_l", "input", "N.m", 0.0, "External torque against the axis", nominal=100.0),
        Variable("theta_m", "output", "rad", None, "Position as measured", starts_from=("theta_m_start", _OFFSET)),
        Variable("omega_m", "output", "rad/s", None, "Speed", starts_from=("omega_m_start",)),
        Variable("T_m", "output", "N.m", None, "Torque of the drive", starts_from=("T_m_start",)),
        *(Variable(p.name, "parameter", p.unit, p.default, p.description, p.minimum, p.maximum) for p in PARAMETERS),
        Variable("theta_m_start", "parameter", "rad", 0.0, "Initial position", -1e12, 1e12),
        Variable("omega_m_start", "parameter", "rad/s", 0.0, "Initial speed", -1e12, 1e12),
        Variable("T_m_start", "parameter", "N.m", 0.0, "Initial torque of the drive", -1e12, 1e12),
    )

    def initialise(self) -> None:
        """Read the parameters and start at the initial state."""
        self._p = tuple(self.real[FIRST_PARAMETER + n] for n in range(len(PARAMETERS)))
        self._x = (self.real[FIRST_START], self.real[FIRST_START + 1], self.real[FIRST_START + 2])
        self._mode: int | None = None
        self._requests: Requests = ()
        self._acting = 0.0
        self._write()

    def advance(self, time: float, step: float) -> None:
        """Integrate with the inputs held; a dead time splits the step where an older request takes over."""
        x, mode = self._x, self._mode
        u = saturated(self.real[U], self._p[P_LIMIT])
        requests, pieces = split_step(self._requests, u, self._p[P_DELAY], time, step)
        for u, piece in pieces:
            if mode is None:
                mode = servo_axis.initial_mode(x, self._p, u)
            x, mode = servo_axis.advance(x, mode, self._p, u, self.real[T_L], piece)
        if not -LARGEST <= x[0] + x[1] + x[2] <= LARGEST:
            raise StepRefusedError(f"the state must stay finite, but is {x!r} after a step of {step!r} s")
        self._x, self._mode, self._requests, self._acting = x, mode, requests, u
        self._write()

    def _write(self) -> None:
        self.real[THETA_M] = self._x[0] + self._p[P_OFFSET]
        self.real[OMEGA_M] = self._x[1]
        self.real[T_M] = servo_axis.drive_torque(self._x, self._p, self._acting)

    def saved(self) -> Any:
        """Return state, direction of sliding, torque requests that are still under way and the one that acts."""
        return [self._x, self._mode, self._requests, self._acting]

    def restore(self, saved: Any) -> None:
        """Take over a saved state."""
        x, mode, requests, self._acting = saved
        self._p = tuple(self.real[FIRST_PARAMETER + n] for n in range(len(PARAMETERS)))
        self._x = tuple(x)
        self._mode = mode
        self._requests = tuple((time, u) for time, u in requests)
