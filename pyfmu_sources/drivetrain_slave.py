"""The FMU ``Drivetrain``: adapter from FMI to :mod:`drivetrain`, without any physics of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Any, ClassVar

from . import drivetrain
from .drivetrain import Mode, Parameters, State, Table
from .drivetrain_modes import (
    QUIET,
    Indicators,
    Outputs,
    after_events,
    asked_first,
    indicators,
    output_rates,
    rates_and_outputs,
    state_rates,
)
from .equations import NAMES, PARAMETERS
from .event_numbers import NO_EVENT
from .fmu_variables import LARGEST, FmuVariable, Terminals
from .laws.drive import saturated
from .parameter_rows import BIG, Parameter
from .plant_slave import PlantSlave
from .slave_base import TOO_STIFF, StepRefusedError

U, T_L, THETA_M, THETA_L, OMEGA_M, OMEGA_L, T_M, T_SHAFT, CONTACT = range(9)
FIRST_PARAMETER = CONTACT + 1
FIRST_START = FIRST_PARAMETER + len(PARAMETERS)
MODEL = FIRST_PARAMETER + NAMES.index("backlash_model")
KNOWN_STEPS = 16
# The work of a step grows with its length; a host that asks for more than this has mistaken the unit.
LONGEST_STEP = 100.0
# Angles [rad] beyond which neighbouring numbers are over 2 mrad apart: a gap and most motion are lost in rounding.
FARTHEST = 1e13
TOO_FAR = (
    "must stay within 1e13 rad, beyond which rounding leaves nothing of a gap: make the torques `u` and `T_l` "
    "or the initial speed smaller, the inertias larger or the run shorter"
)

KnownStep = tuple[float, Table]
KnownSteps = Annotated[list[KnownStep], KNOWN_STEPS]

_STARTS = (
    ("theta_m_start", "rad", "Initial motor angle"),
    ("omega_m_start", "rad/s", "Initial motor speed"),
    ("theta_l_start", "rad", "Initial load angle"),
    ("omega_l_start", "rad/s", "Initial load speed"),
    ("T_m_start", "N.m", "Initial motor torque"),
)
_START_NAMES = tuple(name for name, _, _ in _STARTS)
_SHAFT = (*(name for name in NAMES if not name.startswith(("effects.input", "effects.sensor"))), *_START_NAMES)
# Rigid models move a load that would be wound beyond its gap to the flank, so its angle depends on these as well.
_LOAD = ("alpha", "i", "backlash_model", "theta_m_start", "theta_l_start", "effects.sensor_offset.load.offset")
_GEAR = ("J_m", "J_l", "i", "alpha", "backlash_model", "theta_m_start", "theta_l_start", "omega_m_start")

_prepare = lru_cache(maxsize=256)(drivetrain.prepare)


def _variable(parameter: Parameter) -> FmuVariable:
    name, unit, default, minimum, maximum, description, _ = parameter
    if name == "backlash_model":
        return FmuVariable(
            name,
            "parameter",
            "",
            int(default) + 1,
            description,
            1,
            int(maximum) + 1,
            type="Enumeration",
            declared_type="BacklashModel",
        )
    return FmuVariable(name, "parameter", unit, default, description, minimum, maximum)


def _output(name: str, unit: str, description: str, nominal: float, starts_from: tuple[str, ...]) -> FmuVariable:
    depends_on = ("T_l",) if name == "T_shaft" else ()
    return FmuVariable(
        name, "output", unit, None, description, nominal=nominal, depends_on=depends_on, starts_from=starts_from
    )


class Drivetrain(PlantSlave):
    """Motor with lag, gear with play, elastic shaft and load; the inputs are held over a communication step."""

    title = "Geared drivetrain with backlash: motor with lag, gear with play, elastic shaft, load"
    feedthrough = True
    table: ClassVar[tuple[FmuVariable, ...]] = (
        FmuVariable("u", "input", "N.m", 0.0, "Requested motor torque", -BIG, BIG, nominal=100.0),
        FmuVariable("T_l", "input", "N.m", 0.0, "External torque against the load", -BIG, BIG, nominal=100.0),
        _output(
            "theta_m", "rad", "Motor angle as measured", 1.0, ("theta_m_start", "effects.sensor_offset.motor.offset")
        ),
        _output("theta_l", "rad", "Load angle as measured", 1.0, _LOAD),
        _output("omega_m", "rad/s", "Motor speed", 10.0, (*_GEAR, "omega_l_start")),
        _output("omega_l", "rad/s", "Load speed", 10.0, (*_GEAR, "omega_l_start")),
        _output("T_m", "N.m", "Motor torque", 100.0, ("T_m_start",)),
        _output("T_shaft", "N.m", "Torque of the shaft on the load", 100.0, (*_SHAFT, "T_l")),
        FmuVariable(
            "contact",
            "output",
            "",
            None,
            "Flank that touches: -1, 0 (none) or 1",
            -1,
            1,
            type="Integer",
            starts_from=_SHAFT,
        ),
        *(_variable(parameter) for parameter in PARAMETERS),
        *(FmuVariable(name, "parameter", unit, 0.0, text, -1e12, 1e12) for name, unit, text in _STARTS),
    )
    terminals: ClassVar[Terminals] = {
        "shaft": {"angle": "theta_l", "speed": "omega_l", "torque": "T_l"},
        "encoder": {"motor": "theta_m", "load": "theta_l"},
    }

    _x: State
    _mode: Mode
    _p: Parameters
    _events: int
    _event_time: float
    _known: KnownSteps

    # The hidden attribute that model exchange integrates, and its items: name, unit, nominal value, meaning.
    state_attribute: ClassVar[str] = "_x"
    continuous_states: ClassVar[tuple[tuple[str, str, float, str], ...]] = (
        ("state.theta_m", "rad", 1.0, "Motor angle"),
        ("state.omega_m", "rad/s", 10.0, "Motor speed"),
        ("state.theta_l", "rad", 1.0, "Load angle"),
        ("state.omega_l", "rad/s", 10.0, "Load speed"),
        ("state.T_m", "N.m", 100.0, "Motor torque"),
        ("state.theta_r", "rad", 1.0, "Angle of the extra inertia"),
        ("state.omega_r", "rad/s", 10.0, "Speed of the extra inertia"),
        ("state.s", "rad", 1e-2, "Twist left in a parted shaft"),
        ("state.z_m", "rad", 1e-3, "Bristles of the motor's friction"),
        ("state.z_l", "rad", 1e-3, "Bristles of the load's friction"),
        ("state.w", "1", 1.0, "Memory of the shaft's hysteresis"),
        ("state.y", "N.m", 100.0, "Filtered torque request"),
    )

    # What directional derivatives are of: a function of hidden attributes and inputs by their names, which returns the
    # derivatives of the states and these outputs.
    response: ClassVar[Callable[..., Any]] = rates_and_outputs
    response_outputs: ClassVar[tuple[str, ...]] = ("theta_m", "theta_l", "omega_m", "omega_l", "T_m", "T_shaft")

    def initialise(self) -> None:
        """Read the parameters and start at the initial state."""
        real = self.real
        self._p = Parameters._make(
            float(self.integer[n] - 1) if n == MODEL else real[n] for n in range(FIRST_PARAMETER, FIRST_START)
        )
        theta_l, omega_l = real[FIRST_START + 2], real[FIRST_START + 3]
        x = (real[FIRST_START], real[FIRST_START + 1], theta_l, omega_l, real[FIRST_START + 4], theta_l, omega_l, 0.0)
        self._x = drivetrain.consistent_start(x, self._p)
        self._mode = drivetrain.initial_mode(self._x, self._p)
        self._known = []
        self._start_requests()
        self._events = 0
        self._event_time = 0.0
        self._write()

    def _request(self) -> float:
        """Return the requested torque within its limit [N.m]."""
        return saturated(self.real[U], self._p.torque_saturation_limit)

    def _dead_time(self) -> float:
        """Return how late a request acts [s]."""
        return self._p.input_delay_delay

    def _moved(self, x: State, mode: Mode, u: float, time: float, step: float) -> tuple[State, Mode]:
        """Return state and mode after a piece of a step."""
        number = self._step_number(time, step)
        known = self._known
        return drivetrain.advance(x, mode, self._p, u, self.real[T_L], known[number][0], known[number][1])

    def _moved_to_event(
        self, x: State, mode: Mode, u: float, time: float, step: float
    ) -> tuple[State, Mode, float, int]:
        """Return state and mode at the first event of a piece, how far it is, and the guard that ends the mode."""
        number = self._step_number(time, step)
        known = self._known
        return drivetrain.advance_to_event(x, mode, self._p, u, self.real[T_L], known[number][0], known[number][1])

    def _take(self, x: State, mode: Mode, acting: float, step: float) -> None:
        """Take over a state that is finite and not too far away to be told from its neighbours, or refuse the step."""
        if x[0] != x[0]:
            raise StepRefusedError(f"the step of {step!r} s {TOO_STIFF}")
        if not (-FARTHEST <= x[0] <= FARTHEST and -FARTHEST <= x[2] <= FARTHEST):
            raise StepRefusedError(f"`theta_m` and `theta_l`, {x[0]!r} and {x[2]!r} after this step, {TOO_FAR}")
        if not -LARGEST <= x[1] + x[3] + x[4] <= LARGEST:
            raise StepRefusedError(f"the state must stay finite, but is {x!r} after a step of {step!r} s")
        self._x = x
        self._mode = mode
        self._acting = acting
        self._write()

    def _step_number(self, time: float, step: float) -> int:
        """Return which of the known steps this one is, after preparing for it if it is new.

        Hosts compute step sizes as differences of time stamps, so that equal sizes differ by rounding; they
        count as equal. Which sizes are known is part of the saved state, so that a restored run repeats bit for bit.
        """
        for n in range(len(self._known)):
            if self._known[n][0] == step:
                return n
        noise = 1e-15 * (1.0 + abs(time))
        for n in range(len(self._known)):
            if abs(self._known[n][0] - step) <= noise:
                return n
        if step > LONGEST_STEP:
            raise StepRefusedError(f"a step must be at most {LONGEST_STEP!r} s long, but is {step!r} s")
        table = _prepare(self._p, step)
        if len(self._known) == KNOWN_STEPS:
            self._known[KNOWN_STEPS - 1] = (step, table)
        else:
            self._known.append((step, table))
        return len(self._known) - 1

    def derivatives(self) -> State:
        """Return the derivatives of the state."""
        return state_rates(self._x, self._mode, self._p, self._acting_request(), self.real[T_L])

    def output_rates(self) -> Outputs:
        """Return the derivatives of the outputs that ``response_outputs`` names, with the inputs held.

        Returns:
            The derivatives, SI units per second.
        """
        return output_rates(self._x, self._mode, self._p, self._acting_request(), self.real[T_L])

    def indicators(self) -> Indicators:
        """Return the event indicators, for model exchange."""
        u = self._request()
        return indicators(self._x, self._mode, self._p, u, self.real[T_L])

    def update(self, time: float) -> None:
        """Give an event at ``time`` [s] its effect, and settle state and mode at the inputs of the moment."""
        u = self._acting_request()
        events = 0 if time - self._event_time > QUIET else self._events
        x, mode, events = after_events(self._x, self._mode, self._event, events, self._p, u, self.real[T_L])
        if events > 0:
            self._event_time = time
        self._x = x
        self._mode = mode
        self._event = NO_EVENT
        self._events = events
        self._write()

    def begin_exchange(self) -> None:
        """Settle the drive at what is asked first; effects that need time events are refused in model exchange."""
        if self._p.input_delay_delay > 0.0:
            raise ValueError("`effects.input_delay.delay` must be 0 in model exchange, which has no dead time")
        if self._p.rate_limit_rate < BIG:
            raise ValueError("`effects.rate_limit.rate` must be its default in model exchange")
        self._x = asked_first(self._x, self._request())

    def observe(self) -> None:
        """Write the outputs at the inputs of the moment, for model exchange."""
        self._write()

    def _write(self) -> None:
        real = self.real
        x = self._x
        real[THETA_M] = x[0] + self._p.sensor_offset_motor_offset
        real[THETA_L] = x[2] + self._p.sensor_offset_load_offset
        real[OMEGA_M] = x[1]
        real[OMEGA_L] = x[3]
        real[T_M] = x[4]
        self.refresh()
        self.integer[CONTACT] = drivetrain.reported_contact(x, self._mode, self._p)

    def refresh(self) -> None:
        """Recompute the shaft torque, which a rigid gear passes on from the load torque at once."""
        self.real[T_SHAFT] = drivetrain.shaft_torque(self._x, self._mode, self._p, self.real[T_L])
