"""The FMU ``Drivetrain``: adapter from FMI to :mod:`drivetrain`, without any physics of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Any, ClassVar

from ..adapters.fmu_variables import LARGEST, FmuVariable, Terminals
from ..adapters.plant_slave import KNOWN_STEPS, T_L, PlantSlave, input_variables, parameter_variable, start_variable
from ..adapters.slave_base import TOO_STIFF, StepRefusedError
from ..hybrid.event_numbers import NO_EVENT
from ..laws.backlash_models import GRADUAL, NONE
from ..laws.parameter_rows import Parameter
from . import drivetrain
from .drivetrain import Mode, Parameters, State, Table
from .drivetrain_modes import QUIET, Indicators, Outputs, output_rates, rates_and_outputs, state_rates
from .equations import NAMES, PARAMETERS, is_rigid
from .hybrid_plant import asked
from .smooth_mode import after_events, indicators

THETA_M, THETA_L, OMEGA_M, OMEGA_L, T_M, T_SHAFT, CONTACT = range(T_L + 1, T_L + 8)
FIRST_PARAMETER = CONTACT + 1
FIRST_START = FIRST_PARAMETER + len(PARAMETERS)
MODEL = FIRST_PARAMETER + NAMES.index("backlash_model")
# Angles [rad] beyond which neighbouring numbers are over 2 mrad apart: a gap and most motion are lost in rounding.
FARTHEST = 1e13
TOO_FAR = (
    "must stay within 1e13 rad, beyond which rounding leaves nothing of a gap: make the torques `u` and `T_l` "
    "or the initial speed smaller, the inertias larger or the run shorter"
)

KnownStep = tuple[float, Table]
KnownSteps = Annotated[list[KnownStep], KNOWN_STEPS]

_STARTS = (
    start_variable("theta_m_start", "rad", "Initial motor angle"),
    start_variable("omega_m_start", "rad/s", "Initial motor speed"),
    start_variable("theta_l_start", "rad", "Initial load angle"),
    start_variable("omega_l_start", "rad/s", "Initial load speed"),
    start_variable("T_m_start", "N.m", "Initial motor torque"),
)
_OFFSET = "effects.sensor_offset"
_SHAFT = (
    *(name for name in NAMES if not name.startswith(("effects.input", "effects.sensor"))), *(v.name for v in _STARTS)
)  # fmt: skip
# Rigid models move a load that would be wound beyond its gap to the flank, so its angle depends on these as well.
_LOAD = ("alpha", "i", "backlash_model", "theta_m_start", "theta_l_start", f"{_OFFSET}.load.offset")
_GEAR = ("J_m", "J_l", "i", "alpha", "backlash_model", "theta_m_start", "theta_l_start", "omega_m_start")

_prepare = lru_cache(maxsize=256)(drivetrain.prepare)


def _variable(row: Parameter) -> FmuVariable:
    if row.name != "backlash_model":
        return parameter_variable(row)
    return FmuVariable(
        row.name, "parameter", "", int(row.default) + 1, row.description, 1, int(row.maximum) + 1, type="Enumeration",
        declared_type="BacklashModel",
    )  # fmt: skip


def _output(name: str, unit: str, description: str, nominal: float, *starts_from: str) -> FmuVariable:
    return FmuVariable(name, "output", unit, None, description, nominal=nominal, starts_from=starts_from)


class Drivetrain(PlantSlave):
    """Motor with lag, gear with play, elastic shaft and load; the inputs are held over a communication step."""

    title = "Geared drivetrain with backlash: motor with lag, gear with play, elastic shaft, load"
    feedthrough = True
    table: ClassVar[tuple[FmuVariable, ...]] = (
        *input_variables("motor ", "load"),
        _output("theta_m", "rad", "Motor angle as measured", 1.0, "theta_m_start", f"{_OFFSET}.motor.offset"),
        _output("theta_l", "rad", "Load angle as measured", 1.0, *_LOAD),
        _output("omega_m", "rad/s", "Motor speed", 10.0, *_GEAR, "omega_l_start"),
        _output("omega_l", "rad/s", "Load speed", 10.0, *_GEAR, "omega_l_start"),
        _output("T_m", "N.m", "Motor torque", 100.0, "T_m_start"),
        _output("T_shaft", "N.m", "Torque of the shaft on the load", 100.0, *_SHAFT, "T_l")._replace(
            depends_on=("T_l",)
        ),
        FmuVariable(
            "contact", "output", "", None, "Flank that touches: -1, 0 (none) or 1", -1, 1, type="Integer",
            starts_from=_SHAFT,
        ),
        *map(_variable, PARAMETERS),
        *_STARTS,
    )  # fmt: skip
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
    jumping_states: ClassVar[tuple[str, ...]] = (
        "state.omega_m", "state.theta_l", "state.omega_l", "state.s", "state.z_m", "state.z_l", "state.w",
    )  # fmt: skip

    response: ClassVar[Callable[..., Any]] = rates_and_outputs
    response_outputs: ClassVar[tuple[str, ...]] = ("theta_m", "theta_l", "omega_m", "omega_l", "T_m", "T_shaft")

    def initialise(self) -> None:
        """Read the parameters and start at the initial state."""
        real = self.real
        self._p = Parameters._make(
            float(self.integer[n] - 1) if n == MODEL else real[n] for n in range(FIRST_PARAMETER, FIRST_START)
        )
        self._require_usable()
        theta_l, omega_l = real[FIRST_START + 2], real[FIRST_START + 3]
        x = (real[FIRST_START], real[FIRST_START + 1], theta_l, omega_l, real[FIRST_START + 4], theta_l, omega_l, 0.0)
        self._x = drivetrain.consistent_start(x, self._p)
        self._mode = drivetrain.initial_mode(self._x, self._p)
        self._known = []
        self._start_requests()
        self._events = 0
        self._event_time = 0.0
        self._write()

    def _require_usable(self) -> None:
        """Refuse effects that the backlash model would leave out; without a gap, that of the teeth is allowed."""
        p = self._p
        model = int(p.backlash_model)
        elastic = (
            abs(p.presliding_motor_distance) + abs(p.presliding_load_distance) + abs(p.hardening_stiffness_cubic)
            + abs(p.load_dependent_friction_motor_coefficient) + abs(p.load_dependent_friction_load_coefficient)
            + abs(p.varying_stiffness_amplitude) + abs(p.shaft_hysteresis_torque)
        )  # fmt: skip
        if is_rigid(p) and elastic > 0.0:
            raise ValueError(
                "`effects.presliding`, `effects.load_dependent_friction`, `effects.hardening_stiffness`, "
                "`effects.varying_stiffness` and `effects.shaft_hysteresis` must be off where `backlash_model` is "
                "hysteresis or rigid_impact: rigid teeth have no shaft torque; use dead_zone, nordin or elastic_impact"
            )
        if p.impact_damping_depth > 0.0 and model != NONE and model not in GRADUAL:
            raise ValueError("`effects.impact_damping.depth` must be 0 unless `backlash_model` is dead_zone")

    def _moved(self, x: State, mode: Mode, u: float, time: float, step: float) -> tuple[State, Mode]:
        number = self._step_number(time, step)
        known = self._known
        return drivetrain.advance(x, mode, self._p, u, self.real[T_L], known[number][0], known[number][1])

    def _moved_to_event(
        self, x: State, mode: Mode, u: float, time: float, step: float
    ) -> tuple[State, Mode, float, int]:
        number = self._step_number(time, step)
        known = self._known
        return drivetrain.advance_to_event(x, mode, self._p, u, self.real[T_L], known[number][0], known[number][1])

    def _take(self, x: State, mode: Mode, acting: float, step: float) -> None:
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

    def _prepared(self, step: float) -> Table:
        return _prepare(self._p, step)

    def derivatives(self) -> State:
        """Return the derivatives of the state."""
        return state_rates(self._x, self._mode, self._p, self._acting_request(), self.real[T_L])

    def output_rates(self) -> Outputs:
        """Return the derivatives of the outputs, inputs held, SI units per second."""
        return output_rates(self._x, self._mode, self._p, self._acting_request(), self.real[T_L])

    def indicators(self) -> Indicators:
        """Return the event indicators, for model exchange."""
        return indicators(self._x, self._mode, self._p, self._request(), self.real[T_L])

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
        self._require_no_time_events()
        self._x = asked(self._x, self._request())

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
