"""The FMU ``TwoStageTrain``: adapter from FMI to :mod:`train_steps`, without any physics of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Any, ClassVar

from ..adapters.fmu_variables import LARGEST, FmuVariable, Terminals
from ..adapters.plant_slave import KNOWN_STEPS, T_L, PlantSlave, input_variables, parameter_variable, start_variable
from ..adapters.slave_base import TOO_STIFF, StepRefusedError
from ..hybrid.event_numbers import NO_EVENT
from . import train_steps, train_transition
from .train_equations import PARAMETERS, Mode, State, TrainParameters, contact_outputs, initial_mode
from .train_modes import Indicators, Outputs, after_events, indicators, output_rates, rates_and_outputs, state_rates
from .train_transition import Table

FIRST_OUTPUT = T_L + 1
CONTACT_1, CONTACT_2 = FIRST_OUTPUT + 11, FIRST_OUTPUT + 12
FIRST_PARAMETER = CONTACT_2 + 1
FIRST_START = FIRST_PARAMETER + len(PARAMETERS)
# A rate [1/s] that power series follow in bearable time: at 1 kHz they take ten thousand for a step.
FASTEST = 1e7
# Angles [rad] beyond which neighbouring numbers are over 2 mrad apart: a gap and most motion are lost in rounding.
FARTHEST = 1e13

KnownStep = tuple[float, Table]
KnownSteps = Annotated[list[KnownStep], KNOWN_STEPS]

_STARTS = (
    ("theta_m_start", "rad", "Initial motor angle"),
    ("omega_m_start", "rad/s", "Initial motor speed"),
    ("theta_s_start", "rad", "Initial angle of the intermediate shaft"),
    ("omega_s_start", "rad/s", "Initial speed of the intermediate shaft"),
    ("theta_l_start", "rad", "Initial load angle"),
    ("omega_l_start", "rad/s", "Initial load speed"),
    ("T_m_start", "N.m", "Initial motor torque"),
)
_TWIST_1 = ("theta_m_start", "theta_s_start", "i_1")
_TWIST_2 = ("theta_s_start", "theta_l_start", "i_2")

_prepare = lru_cache(maxsize=256)(train_transition.prepare)


def _output(name: str, unit: str, description: str, nominal: float, *starts_from: str) -> FmuVariable:
    return FmuVariable(name, "output", unit, None, description, nominal=nominal, starts_from=starts_from)


def _contact(name: str, stage: int, starts_from: tuple[str, ...]) -> FmuVariable:
    text = f"Flank of stage {stage} that touches: -1, 0 (none) or 1"
    return FmuVariable(name, "output", "", None, text, -1, 1, type="Integer", starts_from=starts_from)


class TwoStageTrain(PlantSlave):
    """Motor with lag, intermediate shaft and load, two elastic stages with gaps; inputs are held over a step."""

    title = "Drivetrain of two stages: motor with lag, intermediate shaft, load, a gap in either stage or both"
    table: ClassVar[tuple[FmuVariable, ...]] = (
        *input_variables("motor ", "load"),
        _output(
            "theta_m", "rad", "Motor angle as measured", 1.0, "theta_m_start", "effects.sensor_offset.motor.offset"
        ),
        _output("theta_s", "rad", "Angle of the intermediate shaft", 1.0, "theta_s_start"),
        _output("theta_l", "rad", "Load angle as measured", 1.0, "theta_l_start", "effects.sensor_offset.load.offset"),
        _output("omega_m", "rad/s", "Motor speed", 10.0, "omega_m_start"),
        _output("omega_s", "rad/s", "Speed of the intermediate shaft", 10.0, "omega_s_start"),
        _output("omega_l", "rad/s", "Load speed", 10.0, "omega_l_start"),
        _output("T_m", "N.m", "Motor torque", 100.0, "T_m_start"),
        _output("T_1", "N.m", "Torque of stage 1 on the intermediate shaft", 100.0, *_TWIST_1, "omega_m_start",
                "omega_s_start", "k_1", "c_1", "alpha_1"),
        _output("T_2", "N.m", "Torque of stage 2 on the load", 100.0, *_TWIST_2, "omega_s_start", "omega_l_start",
                "k_2", "c_2", "alpha_2"),
        _output("twist_1", "rad", "Twist of stage 1 from mid-gap, at the intermediate shaft", 0.1, *_TWIST_1),
        _output("twist_2", "rad", "Twist of stage 2 from mid-gap, at the load", 0.1, *_TWIST_2),
        _contact("contact_1", 1, (*_TWIST_1, "alpha_1")),
        _contact("contact_2", 2, (*_TWIST_2, "alpha_2")),
        *(parameter_variable(row) for row in PARAMETERS),
        *(start_variable(*start) for start in _STARTS),
    )  # fmt: skip
    terminals: ClassVar[Terminals] = {
        "shaft": {"angle": "theta_l", "speed": "omega_l", "torque": "T_l"},
        "encoder": {"motor": "theta_m", "load": "theta_l"},
    }

    _x: State
    _mode: Mode
    _p: TrainParameters
    _known: KnownSteps

    continuous_states: ClassVar[tuple[tuple[str, str, float, str], ...]] = (
        ("state.theta_m", "rad", 1.0, "Motor angle"),
        ("state.omega_m", "rad/s", 10.0, "Motor speed"),
        ("state.theta_s", "rad", 1.0, "Angle of the intermediate shaft"),
        ("state.omega_s", "rad/s", 10.0, "Speed of the intermediate shaft"),
        ("state.theta_l", "rad", 1.0, "Load angle"),
        ("state.omega_l", "rad/s", 10.0, "Load speed"),
        ("state.T_m", "N.m", 100.0, "Motor torque"),
    )
    jumping_states: ClassVar[tuple[str, ...]] = ("state.omega_m", "state.omega_s", "state.omega_l")

    response: ClassVar[Callable[..., Any]] = rates_and_outputs
    response_outputs: ClassVar[tuple[str, ...]] = (
        "theta_m", "theta_s", "theta_l", "omega_m", "omega_s", "omega_l", "T_m", "T_1", "T_2", "twist_1", "twist_2",
    )  # fmt: skip

    def initialise(self) -> None:
        """Read the parameters and start at the initial state; refuse a train that is too stiff at any step."""
        real = self.real
        n = FIRST_START
        self._p = TrainParameters._make(real[m] for m in range(FIRST_PARAMETER, FIRST_START))
        rate = train_transition.fastest_rate((1, 1, 1, 1, 1), self._p)
        if rate > FASTEST:
            raise ValueError(
                f"the fastest rate of the train must be at most 1e7 1/s, but is {rate!r}: make the inertias (`J_m`, "
                "`J_s`, `J_l`) larger, or the stiffness, damping and friction that act on the lightest of them smaller"
            )
        self._x = (real[n], real[n + 1], real[n + 2], real[n + 3], real[n + 4], real[n + 5], real[n + 6])
        self._mode = initial_mode(self._x, self._p, real[T_L])
        self._known = []
        self._start_requests()
        self._write()

    def _prepared(self, step: float) -> Table:
        return _prepare(self._p, step)

    def _moved(self, x: State, mode: Mode, u: float, time: float, step: float) -> tuple[State, Mode]:
        known = self._known
        number = self._step_number(time, step)
        return train_steps.advance(x, mode, self._p, u, self.real[T_L], known[number][0], known[number][1])

    def _moved_to_event(
        self, x: State, mode: Mode, u: float, time: float, step: float
    ) -> tuple[State, Mode, float, int]:
        known = self._known
        number = self._step_number(time, step)
        return train_steps.advance_to_event(x, mode, self._p, u, self.real[T_L], known[number][0], known[number][1])

    def _take(self, x: State, mode: Mode, acting: float, step: float) -> None:
        if x[0] != x[0]:
            raise StepRefusedError(f"the step of {step!r} s {TOO_STIFF}")
        if not (abs(x[0]) <= FARTHEST and abs(x[2]) <= FARTHEST and abs(x[4]) <= FARTHEST):
            raise StepRefusedError(
                "all angles must stay within 1e13 rad, beyond which rounding leaves nothing of a gap, but are "
                f"{x[0]!r}, {x[2]!r} and {x[4]!r} after this step: make the torques `u` and `T_l` or the initial "
                "speeds smaller, the inertias larger or the run shorter"
            )
        if not -LARGEST <= x[1] + x[3] + x[5] + x[6] <= LARGEST:
            raise StepRefusedError(f"the state must stay finite, but is {x!r} after a step of {step!r} s")
        self._x = x
        self._mode = mode
        self._acting = acting
        self._write()

    def derivatives(self) -> State:
        """Return the derivatives of the state."""
        return state_rates(self._x, self._mode, self._p, self._acting_request(), self.real[T_L])

    def output_rates(self) -> Outputs:
        """Return the derivatives of the outputs that ``response_outputs`` names, inputs held, SI units per second."""
        return output_rates(self._x, self._mode, self._p, self._acting_request(), self.real[T_L])

    def indicators(self) -> Indicators:
        """Return the event indicators, for model exchange."""
        return indicators(self._x, self._mode, self._p, self.real[T_L])

    def update(self, time: float) -> None:
        """Give an event at ``time`` [s] its effect, and settle state and mode at the inputs of the moment."""
        x, mode = after_events(self._x, self._mode, self._event, self._p, self.real[T_L])
        self._x = x
        self._mode = mode
        self._event = NO_EVENT
        self._write()

    def begin_exchange(self) -> None:
        """Refuse a dead time, which needs time events, in model exchange."""
        self._require_no_dead_time()

    def observe(self) -> None:
        """Write the outputs at the inputs of the moment, for model exchange."""
        self._write()

    def _write(self) -> None:
        _, outputs = rates_and_outputs(self._x, self._mode, self._p, 0.0, 0.0)
        for n in range(len(outputs)):
            self.real[FIRST_OUTPUT + n] = outputs[n]
        contact_1, contact_2 = contact_outputs(self._x, self._mode, self._p)
        self.integer[CONTACT_1] = contact_1
        self.integer[CONTACT_2] = contact_2
