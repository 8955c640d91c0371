"""The FMU ``ServoAxis``: adapter from FMI to :mod:`servo_axis`, without any physics of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from ..adapters.fmu_variables import LARGEST, FmuVariable, Terminals
from ..adapters.plant_slave import T_L, PlantSlave, input_variables, parameter_variable, start_variable
from ..adapters.slave_base import TOO_STIFF, StepRefusedError
from ..hybrid.event_numbers import NO_EVENT
from . import servo_axis
from .axis_equations import PARAMETERS, AxisParameters
from .servo_axis import UNDECIDED, Indicators, Outputs, State, decided, machine, rates_and_outputs

THETA_M, OMEGA_M, T_M = range(T_L + 1, T_L + 4)
FIRST_PARAMETER = T_M + 1
FIRST_START = FIRST_PARAMETER + len(PARAMETERS)

_OFFSET = "effects.sensor_offset.motor.offset"


class ServoAxis(PlantSlave):
    """One inertia behind the lag of its drive; the inputs are held over a communication step."""

    title = "Single axis: one inertia behind the torque lag of its drive"
    table: ClassVar[tuple[FmuVariable, ...]] = (
        *input_variables("", "axis"),
        FmuVariable("theta_m", "output", "rad", None, "Position as measured", starts_from=("theta_m_start", _OFFSET)),
        FmuVariable("omega_m", "output", "rad/s", None, "Speed", starts_from=("omega_m_start",)),
        FmuVariable("T_m", "output", "N.m", None, "Torque of the drive", starts_from=("T_m_start",)),
        *map(parameter_variable, PARAMETERS),
        start_variable("theta_m_start", "rad", "Initial position"),
        start_variable("omega_m_start", "rad/s", "Initial speed"),
        start_variable("T_m_start", "N.m", "Initial torque of the drive"),
    )
    terminals: ClassVar[Terminals] = {
        "shaft": {"angle": "theta_m", "speed": "omega_m", "torque": "T_l"},
        "encoder": {"angle": "theta_m"},
    }

    _x: State
    _mode: int
    _p: AxisParameters
    _end_stop: int

    continuous_states: ClassVar[tuple[tuple[str, str, float, str], ...]] = (
        ("state.theta_m", "rad", 1.0, "Position"),
        ("state.omega_m", "rad/s", 10.0, "Speed"),
        ("state.T_m", "N.m", 100.0, "Torque behind the drive's lag"),
        ("state.z", "rad", 1e-3, "Bristles of the friction"),
        ("state.y", "N.m", 100.0, "Filtered torque request"),
    )
    jumping_states: ClassVar[tuple[str, ...]] = ("state.omega_m", "state.z")
    response: ClassVar[Callable[..., Any]] = rates_and_outputs
    response_outputs: ClassVar[tuple[str, ...]] = ("theta_m", "omega_m", "T_m")
    # Outputs that follow inputs at once in model exchange; in co-simulation they follow at the end of a step.
    exchange_depends_on: ClassVar[dict[str, tuple[str, ...]]] = {"T_m": ("u",)}

    def initialise(self) -> None:
        """Read the parameters and start at the initial state."""
        self._p = AxisParameters._make(self.real[n] for n in range(FIRST_PARAMETER, FIRST_START))
        real = self.real
        self._x = servo_axis.start(real[FIRST_START], real[FIRST_START + 1], real[FIRST_START + 2], self._p)
        self._mode = UNDECIDED
        self._end_stop = 0
        self._start_requests()
        self._write()

    def _moved(self, x: State, mode: int, u: float, time: float, step: float) -> tuple[State, int]:
        if mode == UNDECIDED:
            mode = servo_axis.initial_mode(x, self._p, u)
        return servo_axis.advance(x, mode, self._p, u, self.real[T_L], step)

    def _moved_to_event(self, x: State, mode: int, u: float, time: float, step: float) -> tuple[State, int, float, int]:
        if mode == UNDECIDED:
            mode = servo_axis.initial_mode(x, self._p, u)
        return servo_axis.advance_to_event(x, mode, self._p, u, self.real[T_L], step)

    def _take(self, x: State, mode: int, acting: float, step: float) -> None:
        if x[0] != x[0]:
            raise StepRefusedError(f"the step of {step!r} s {TOO_STIFF}")
        if not -LARGEST <= x[0] + x[1] + x[2] <= LARGEST:
            raise StepRefusedError(f"the state must stay finite, but is {x!r} after a step of {step!r} s")
        self._x = x
        self._mode = mode
        self._acting = acting
        self._write()

    def derivatives(self) -> State:
        """Return the derivatives of the state."""
        u = self._acting_request()
        mode = decided(self._x, self._mode, self._p, u)
        return servo_axis.mode_rates(self._x, (mode, self._end_stop), self._p, u, self.real[T_L])

    def output_rates(self) -> Outputs:
        """Return the derivatives of the outputs, SI units per second; a drive without a lag holds its torque."""
        r = self.derivatives()
        return (r[0], r[1], r[2] if self._p.tau > 0.0 else 0.0)

    def indicators(self) -> Indicators:
        """Return the event indicators, for model exchange."""
        mode = (self._mode, self._end_stop)
        return machine.indicators(self._x, mode, self._p, self._request(), self.real[T_L])

    def update(self, time: float) -> None:
        """Settle state and mode at an event at ``time`` [s], at the inputs of the moment."""
        u = self._acting_request()
        x, mode = servo_axis.after_events(self._x, self._mode, self._end_stop, self._p, u, self.real[T_L])
        self._x = x
        self._mode = mode[0]
        self._end_stop = mode[1]
        self._event = NO_EVENT
        self.observe()

    def begin_exchange(self) -> None:
        """Settle the drive at what is asked first; effects that need time events are refused in model exchange."""
        self._require_no_time_events()
        x = self._x
        self._x = (x[0], x[1], x[2], x[3], self._request())

    def observe(self) -> None:
        """Write the outputs at the inputs of the moment."""
        self._acting = self._acting_request()
        self._write()

    def _write(self) -> None:
        self.real[THETA_M] = self._x[0] + self._p.sensor_offset_motor_offset
        self.real[OMEGA_M] = self._x[1]
        self.real[T_M] = servo_axis.drive_torque(self._x, self._p, self._acting)
