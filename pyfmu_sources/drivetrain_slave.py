"""The FMU ``Drivetrain``: adapter from FMI to :mod:`drivetrain`, without any physics of its own."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar

from . import drivetrain
from .dead_time import Requests, split_step
from .drivetrain_parameters import P_DELAY, P_LIMIT, P_MODEL, P_OFFSET_L, P_OFFSET_M, PARAMETERS, Parameter
from .effects import saturated
from .fmu_variables import LARGEST, Variable
from .slave_base import SlaveBase, StepRefusedError

U, T_L, THETA_M, THETA_L, OMEGA_M, OMEGA_L, T_M, T_SHAFT, CONTACT = range(9)
FIRST_PARAMETER = CONTACT + 1
FIRST_START = FIRST_PARAMETER + len(PARAMETERS)
MODEL = FIRST_PARAMETER + P_MODEL
KNOWN_STEPS = 16
# The work of a step grows with its length; a host that asks for more than this has mistaken the unit.
LONGEST_STEP = 100.0

_NAMES = tuple(parameter.name for parameter in PARAMETERS)
_STARTS = (
    ("theta_m_start", "rad", "Initial motor angle"),
    ("omega_m_start", "rad/s", "Initial motor speed"),
    ("theta_l_start", "rad", "Initial load angle"),
    ("omega_l_start", "rad/s", "Initial load speed"),
    ("T_m_start", "N.m", "Initial motor torque"),
)
_START_NAMES = tuple(name for name, _, _ in _STARTS)
_SHAFT = (*(name for name in _NAMES if not name.startswith(("effects.input", "effects.sensor"))), *_START_NAMES)
# Rigid models move a load that would be wound beyond its gap to the flank, so its angle depends on these as well.
_LOAD = ("alpha", "i", "backlash_model", "theta_m_start", "theta_l_start", "effects.sensor_offset.load.offset")
_GEAR = ("J_m", "J_l", "i", "alpha", "backlash_model", "theta_m_start", "theta_l_start", "omega_m_start")

_prepare = lru_cache(maxsize=256)(drivetrain.prepare)


def _variable(parameter: Parameter) -> Variable:
    name, unit, default, minimum, maximum, description = parameter
    if name == "backlash_model":
        return Variable(
            name,
            "parameter",
            "",
            int(default) + 1,
            description,
            1,
            6,
            type="Enumeration",
            declared_type="BacklashModel",
        )
    return Variable(name, "parameter", unit, default, description, minimum, maximum)


def _output(name: str, unit: str, description: str, nominal: float, starts_from: tuple[str, ...]) -> Variable:
    depends_on = ("T_l",) if name == "T_shaft" else ()
    return Variable(
        name, "output", unit, None, description, nominal=nominal, depends_on=depends_on, starts_from=starts_from
    )


class Drivetrain(SlaveBase):
    """Motor with lag, gear with play, elastic shaft and load; the inputs are held over a communication step."""

    title = "Geared drivetrain with backlash: motor with lag, gear with play, elastic shaft, load"
    feedthrough = True
    table: ClassVar[tuple[Variable, ...]] = (
        Variable("u", "input", "N.m", 0.0, "Requested motor torque", nominal=100.0),
        Variable("T_l", "input", "N.m", 0.0, "External torque against the load", nominal=100.0),
        _output(
            "theta_m", "rad", "Motor angle as measured", 1.0, ("theta_m_start", "effects.sensor_offset.motor.offset")
        ),
        _output("theta_l", "rad", "Load angle as measured", 1.0, _LOAD),
        _output("omega_m", "rad/s", "Motor speed", 10.0, (*_GEAR, "omega_l_start")),
        _output("omega_l", "rad/s", "Load speed", 10.0, (*_GEAR, "omega_l_start")),
        _output("T_m", "N.m", "Motor torque", 100.0, ("T_m_start",)),
        _output("T_shaft", "N.m", "Torque of the shaft on the load", 100.0, (*_SHAFT, "T_l")),
        Variable(
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
        *(Variable(name, "parameter", unit, 0.0, text, -1e12, 1e12) for name, unit, text in _STARTS),
    )

    def initialise(self) -> None:
        """Read the parameters and start at the initial state."""
        self._take_parameters()
        theta_m, omega_m, theta_l, omega_l, T_m = (self.real[FIRST_START + n] for n in range(len(_STARTS)))
        x = (theta_m, omega_m, theta_l, omega_l, T_m, theta_l, omega_l, 0.0)
        self._x = drivetrain.consistent_start(x, self._p)
        self._mode = drivetrain.initial_mode(self._x, self._p)
        self._tables: dict[float, drivetrain.Table] = {}
        self._requests: Requests = ()
        self._write()

    def _take_parameters(self) -> None:
        values = [self.real.get(FIRST_PARAMETER + n, 0.0) for n in range(len(PARAMETERS))]
        values[P_MODEL] = float(self.integer[MODEL] - 1)
        self._p = tuple(values)
        self._delay = values[P_DELAY]
        self._limit = values[P_LIMIT]
        self._offset_m = values[P_OFFSET_M]
        self._offset_l = values[P_OFFSET_L]

    def advance(self, time: float, step: float) -> None:
        """Integrate with the inputs held; a dead time splits the step where an older request takes over."""
        real = self.real
        p = self._p
        T_l = real[T_L]
        u = saturated(real[U], self._limit)
        x, mode, requests = self._x, self._mode, self._requests
        if self._delay == 0.0:
            table = self._tables.get(step)
            if table is None:
                step, table = self._table(time, step)
            x, mode = drivetrain.advance(x, mode, p, u, T_l, step, table)
        else:
            requests, pieces = split_step(requests, u, self._delay, time, step)
            for u, piece in pieces:
                length, table = self._table(time, piece)
                x, mode = drivetrain.advance(x, mode, p, u, T_l, length, table)
        if not -LARGEST <= x[0] + x[1] + x[2] + x[3] + x[4] <= LARGEST:
            raise StepRefusedError(f"the state must stay finite, but is {x!r} after a step of {step!r} s")
        self._x, self._mode, self._requests = x, mode, requests
        self._write()

    def _table(self, time: float, step: float) -> tuple[float, drivetrain.Table]:
        """Return the table of a step size, and the size it was made for.

        Hosts compute step sizes as differences of time stamps, so that equal sizes differ by rounding; they
        count as equal. Which sizes are known is part of the saved state, so that a restored run repeats bit for bit.
        """
        noise = 1e-15 * (1.0 + abs(time))
        for known, table in self._tables.items():
            if abs(known - step) <= noise:
                return known, table
        if step > LONGEST_STEP:
            raise StepRefusedError(f"a step must be at most {LONGEST_STEP!r} s long, but is {step!r} s")
        table = _prepare(self._p, step)
        if len(self._tables) < KNOWN_STEPS:
            self._tables[step] = table
        return step, table

    def _write(self) -> None:
        real = self.real
        x = self._x
        real[THETA_M] = x[0] + self._offset_m
        real[THETA_L] = x[2] + self._offset_l
        real[OMEGA_M] = x[1]
        real[OMEGA_L] = x[3]
        real[T_M] = x[4]
        self.refresh()
        self.integer[CONTACT] = drivetrain.reported_contact(x, self._mode, self._p)

    def refresh(self) -> None:
        """Recompute the shaft torque, which a rigid gear passes on from the load torque at once."""
        self.real[T_SHAFT] = drivetrain.shaft_torque(self._x, self._mode, self._p, self.real[T_L])

    def saved(self) -> Any:
        """Return state, mode, torque requests that are still under way and known step sizes."""
        return [self._x, self._mode, self._requests, list(self._tables)]

    def restore(self, saved: Any) -> None:
        """Take over a saved state."""
        x, mode, requests, steps = saved
        self._take_parameters()
        self._x = tuple(x)
        self._mode = tuple(mode)
        self._requests = tuple((time, u) for time, u in requests)
        self._tables = {step: _prepare(self._p, step) for step in steps}
