"""The FMU ``ServoAxis``: adapter from FMI to :mod:`servo_axis`, without any physics of its own."""

from __future__ import annotations

from typing import Annotated, ClassVar

from . import servo_axis
from .dead_time import MOST_REQUESTS, ROUNDING, Requests, is_new, request_at
from .drivetrain_parameters import BIG
from .effects import saturated
from .fmu_variables import LARGEST, FmuVariable
from .servo_axis import State
from .servo_axis_parameters import COUNT, P_DELAY, P_LIMIT, P_OFFSET, PARAMETERS
from .slave_base import TOO_STIFF, SlaveBase, StepRefusedError

U, T_L, THETA_M, OMEGA_M, T_M = range(5)
FIRST_PARAMETER = T_M + 1
FIRST_START = FIRST_PARAMETER + len(PARAMETERS)

Values = Annotated[tuple[float, ...], COUNT]
UNDECIDED = 2  # direction of sliding before the first step, whose request decides

_OFFSET = "effects.sensor_offset.motor.offset"


class ServoAxis(SlaveBase):
    """One inertia behind the lag of its drive; the inputs are held over a communication step."""

    title = "Single axis: one inertia behind the torque lag of its drive"
    table: ClassVar[tuple[FmuVariable, ...]] = (
        FmuVariable("u", "input", "N.m", 0.0, "Requested torque", -BIG, BIG, nominal=100.0),
        FmuVariable("T_l", "input", "N.m", 0.0, "External torque against the axis", -BIG, BIG, nominal=100.0),
        FmuVariable("theta_m", "output", "rad", None, "Position as measured", starts_from=("theta_m_start", _OFFSET)),
        FmuVariable("omega_m", "output", "rad/s", None, "Speed", starts_from=("omega_m_start",)),
        FmuVariable("T_m", "output", "N.m", None, "Torque of the drive", starts_from=("T_m_start",)),
        *(FmuVariable(p.name, "parameter", p.unit, p.default, p.description, p.minimum, p.maximum) for p in PARAMETERS),
        FmuVariable("theta_m_start", "parameter", "rad", 0.0, "Initial position", -1e12, 1e12),
        FmuVariable("omega_m_start", "parameter", "rad/s", 0.0, "Initial speed", -1e12, 1e12),
        FmuVariable("T_m_start", "parameter", "N.m", 0.0, "Initial torque of the drive", -1e12, 1e12),
    )

    _x: State
    _mode: int
    _p: Values
    _acting: float
    _requests: Requests

    def initialise(self) -> None:
        """Read the parameters and start at the initial state."""
        self._p = tuple(self.real[FIRST_PARAMETER + n] for n in range(COUNT))
        real = self.real
        self._x = servo_axis.start(real[FIRST_START], real[FIRST_START + 1], real[FIRST_START + 2], self._p)
        self._mode = UNDECIDED
        self._requests = []
        self._acting = 0.0
        self._write()

    def advance(self, time: float, step: float) -> None:
        """Integrate with the inputs held; a dead time splits the step where an older request takes over.

        Args:
            time: [s].
            step: [s].
        """
        u = saturated(self.real[U], self._p[P_LIMIT])
        if self._p[P_DELAY] == 0.0:
            x, mode = self._moved(self._x, self._mode, u, step)
            self._take(x, mode, u, step)
        else:
            self._advance_delayed(u, time, step)

    def _advance_delayed(self, u: float, time: float, step: float) -> None:
        """Advance piece by piece; before the first request acts, the torque is zero."""
        x, mode = self._x, self._mode
        new = is_new(self._requests, u)
        count = len(self._requests) + new
        if count > MOST_REQUESTS:
            raise StepRefusedError(f"at most {MOST_REQUESTS} requests may be under way, but this one is one more")
        end = time + step
        least = ROUNDING * step
        begin, acting, first = time, 0.0, 0
        for n in range(count):
            asked, value = request_at(self._requests, n, u, time)
            change = asked + self._p[P_DELAY]
            if change >= end - least:
                break
            if change <= time + least:
                first = n
            else:
                x, mode = self._moved(x, mode, acting, change - begin)
                begin = change
            acting = value
        x, mode = self._moved(x, mode, acting, end - begin)
        self._take(x, mode, acting, step)
        if new:
            self._requests.append((time, u))
        del self._requests[:first]

    def _moved(self, x: State, mode: int, u: float, step: float) -> tuple[State, int]:
        """Return state and direction of sliding after a piece of a step."""
        if mode == UNDECIDED:
            mode = servo_axis.initial_mode(x, self._p, u)
        return servo_axis.advance(x, mode, self._p, u, self.real[T_L], step)

    def _take(self, x: State, mode: int, acting: float, step: float) -> None:
        """Take over a state that is finite, or refuse the step."""
        if x[0] != x[0]:
            raise StepRefusedError(f"the step of {step!r} s {TOO_STIFF}")
        if not -LARGEST <= x[0] + x[1] + x[2] <= LARGEST:
            raise StepRefusedError(f"the state must stay finite, but is {x!r} after a step of {step!r} s")
        self._x = x
        self._mode = mode
        self._acting = acting
        self._write()

    def _write(self) -> None:
        self.real[THETA_M] = self._x[0] + self._p[P_OFFSET]
        self.real[OMEGA_M] = self._x[1]
        self.real[T_M] = servo_axis.drive_torque(self._x, self._p, self._acting)
