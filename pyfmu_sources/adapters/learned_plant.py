"""Plants with a law that was learned from a record: off until ``effects.learned_law.on`` is 1.

The equations stay as they are. A law is a torque that is held over short pieces of a step, at its value half-way
through each (the midpoint rule), so that contact and stiction are located as ever. What was fitted beside the law is
kept as changes of the plant's parameters, which hold while the law is on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from ..hybrid.event_numbers import NO_EVENT
from ..laws.learned_law import (
    KNOTS,
    L_CLOCK,
    L_DRY,
    L_SINCE,
    LAW_COUNT,
    Motion,
    at_bodies,
    begins_late,
    is_cyclic,
    law_torque,
    longest_piece,
    until_knot,
)
from ..laws.parameter_rows import BIG, Parameter
from .fmu_variables import FmuVariable
from .plant_slave import PlantSlave
from .slave_base import TOO_STIFF, StepRefusedError

PREFIX = "effects.learned_law."
ON = f"{PREFIX}on"
CLOCK = f"{PREFIX}clock"
CHANGE = f"{PREFIX}change."
MOST_PIECES = 200000  # of one communication step
SHORTEST = 1e-12  # of a step, below which a piece is nothing

LawValues = Annotated[tuple[float, ...], LAW_COUNT]
Pushes = tuple[float, float]
_Base: Any = PlantSlave if TYPE_CHECKING else object


def law_variables(law: Mapping[str, Any], parameters: Sequence[Parameter]) -> tuple[FmuVariable, ...]:
    """Return the variables that an FMU has more for a law."""

    def real(name: str, unit: str, start: float, text: str, low: float = -BIG, high: float = BIG) -> FmuVariable:
        return FmuVariable(PREFIX + name, "parameter", unit, float(start), text, low, high)

    text = f"1: a law learned from a record acts, over the {law['words']}; 0: it does not"
    found = [FmuVariable(ON, "parameter", "", 0, text, 0, 1, type="Integer")]
    if "since" in law:
        found.append(real("clock", "s", 0.0, "Time since the record's first row at time 0"))
        found.append(real("since", "s", law["since"], "When the law, or its first cycle, begins, by its clock"))
    if "period" in law:
        found.append(real("period", "s", law["period"], "Period of the law's cycles", 1e-9))
    if "dry" in law:
        found.append(real("dry", "N.m", law["dry"], "Dry friction within the law", 0.0))
    for n in range(KNOTS):
        found.append(real(f"knot[{n + 1}]", law["unit"], law["knots"][n], "Knot of the law, beyond the one before"))
    for n in range(KNOTS):
        found.append(real(f"value[{n + 1}]", law["value_unit"], law["values"][n], "The law at its knot"))
    units = {entry.name: entry.unit for entry in parameters}
    for name, change in law["changes"].items():
        found.append(real(f"change.{name}", units[name], change, f"Change of `{name}` while the law is on"))
    return tuple(found)


def _starting_from(variable: FmuVariable, names: tuple[str, ...]) -> FmuVariable:
    """Return a variable whose initial value, if it is an output's, depends on further parameters."""
    if variable.causality != "output":
        return variable
    return variable._replace(starts_from=(*variable.starts_from, *names))


class WithLaw(_Base):
    """What a plant's slave with a law has more; it stands before that slave among the bases."""

    plant_parameters: ClassVar[tuple[Parameter, ...]] = ()
    _form: ClassVar[int] = 0
    _places: ClassVar[dict[str, int]] = {}  # of the variables in the table
    _changed: ClassVar[tuple[tuple[int, int], ...]] = ()
    if TYPE_CHECKING:  # hidden state, which each slave declares
        _p: Any
        _rubbing: Any
        _law: Any
        _now: float
        _piece: float

    @classmethod
    def learn(cls, law: Mapping[str, Any]) -> None:
        """Give the class its law."""
        cls.title = f"{cls.title}; with a law learned from a record"
        added = law_variables(law, cls.plant_parameters)
        follow = tuple(variable.name for variable in added)
        cls.table = (*(_starting_from(variable, follow) for variable in cls.table), *added)
        cls._form = int(law["form"])
        cls._places = {variable.name: n for n, variable in enumerate(cls.table)}
        numbers = {entry.name: n for n, entry in enumerate(cls.plant_parameters)}
        cls._changed = tuple((numbers[name], cls._places[CHANGE + name]) for name in law["changes"])
        cls._index()

    # What a slave implements ----------------------------------------------------------------------------

    def _begin_with(self, p: Any) -> None:
        """Start at the initial state with other parameters."""
        raise NotImplementedError

    def _rubbed(self, p: Any) -> Any:
        """Return parameters with the law's dry friction added to the body's own."""
        raise NotImplementedError

    def _inertias(self) -> tuple[float, float, float]:
        """Return the inertias of motor and load [kg.m2] and the ratio of the gear."""
        raise NotImplementedError

    def _motion(self, x: Any, u: float) -> Motion:
        """Return what a law is a function of."""
        raise NotImplementedError

    def _mode_of(self, x: Any, mode: Any, p: Any, u: float) -> Any:
        """Return the mode in which friction that sets in finds the plant."""
        raise NotImplementedError

    def _pushed(self, x: Any, mode: Any, p: Any, u: float, against: Pushes, step: float) -> tuple[Any, Any]:
        """Return state and mode after a piece of a step with torques held against motor and load."""
        raise NotImplementedError

    # What all of them share -----------------------------------------------------------------------------

    def _clock(self) -> float:
        """Return the time of the record that the law was learned from [s]."""
        return float(self._law[L_CLOCK] + self._now)

    def initialise(self) -> None:
        """Read the parameters, those of the law too, and start at the initial state."""
        on = self.integer[self._places[ON]] == 1
        self._now = self.start_time
        self._law = self._read(on)
        self._piece = 0.0  # off
        super().initialise()
        self._rubbing = self._p
        if not on:
            return
        p = list(self._p)
        for n, place in self._changed:
            entry = self.plant_parameters[n]
            p[n] = min(max(p[n] + self.real[place], entry.minimum), entry.maximum)
        self._begin_with(self._p._make(p))
        self._rubbing = self._rubbed(self._p) if self._law[L_DRY] > 0.0 else self._p
        if not begins_late(self._law):
            self._begin_with(self._rubbing)
        self._piece = longest_piece(self._law, *self._inertias())
        self._write()

    def _read(self, on: bool) -> tuple[float, ...]:
        """Return the law's values as they are set; those of one that is on must make sense."""

        def value(name: str, default: float) -> float:
            place = self._places.get(PREFIX + name)
            return default if place is None else float(self.real[place])

        knots = [value(f"knot[{n + 1}]", 0.0) for n in range(KNOTS)]
        for n in range(1, KNOTS):
            if on and not knots[n] > knots[n - 1]:
                raise ValueError(f"`{PREFIX}knot[{n + 1}]` must be larger than {knots[n - 1]!r}, but is {knots[n]!r}")
        clock, since = value("clock", 0.0), value("since", 0.0)
        values = (value(f"value[{n + 1}]", 0.0) for n in range(KNOTS))
        return (float(self._form), clock, since, value("period", 1.0), value("dry", 0.0), *knots, *values)

    def advance(self, time: float, step: float) -> None:
        """Integrate from ``time`` [s] over ``step`` [s] with the inputs held."""
        before, self._now = self._now, time
        try:
            super().advance(time, step)
        except BaseException:
            self._now = before
            raise

    def _moved(self, x: Any, mode: Any, u: float, time: float, step: float) -> tuple[Any, Any]:
        """Return state and mode after a piece of a step between two requests."""
        clock = self._clock()
        self._now += step
        if self._piece == 0.0:
            return super()._moved(x, mode, u, time, step)
        rest = step
        if begins_late(self._law) and clock < self._law[L_SINCE]:
            wait = min(step, self._law[L_SINCE] - clock)
            if wait > SHORTEST * step:
                x, mode = self._pushed(x, mode, self._p, u, (0.0, 0.0), wait)
            if wait == step:
                return x, mode
            mode = self._mode_of(x, mode, self._rubbing, u)
            clock, rest = self._law[L_SINCE], step - wait
        left = MOST_PIECES
        while rest > SHORTEST * step:
            span = min(rest, until_knot(self._law, clock)) if is_cyclic(self._law) else rest
            count = max(1, ceil(span / self._piece - 1e-9))
            left -= count
            if left < 0:
                raise StepRefusedError(f"the step of {step!r} s {TOO_STIFF}")
            for n in range(count):
                x, mode = self._acted(x, mode, u, clock + span * n / count, span / count)
            clock, rest = clock + span, rest - span
        return x, mode

    def _moved_to_event(self, x: Any, mode: Any, u: float, time: float, step: float) -> tuple[Any, Any, float, int]:
        """Return state and mode after a whole piece: events stay inside steps of a plant with a law."""
        x, mode = self._moved(x, mode, u, time, step)
        return x, mode, step, NO_EVENT

    def _acted(self, x: Any, mode: Any, u: float, clock: float, step: float) -> tuple[Any, Any]:
        """Return state and mode after a piece over which the law is held at its value half-way."""
        if is_cyclic(self._law):
            return self._pushed(x, mode, self._rubbing, u, self._pushes(x, u, clock + 0.5 * step), step)
        half, _ = self._pushed(x, mode, self._rubbing, u, self._pushes(x, u, clock), 0.5 * step)
        return self._pushed(x, mode, self._rubbing, u, self._pushes(half, u, clock + 0.5 * step), step)

    def _pushes(self, x: Any, u: float, clock: float) -> Pushes:
        """Return the law's torques against motor and load [N.m]."""
        return at_bodies(self._law, law_torque(self._law, clock, self._motion(x, u)), self._inertias()[2])

    def _acts(self) -> bool:
        """Tell whether the law acts at the time reached."""
        return self._piece > 0.0 and not (begins_late(self._law) and self._clock() < self._law[L_SINCE])
