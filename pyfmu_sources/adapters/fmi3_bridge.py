"""The Python side of an FMU of FMI 3.0 that runs Python: a slave whose values lie in the C instance's memory.

The C around it does what FMI asks for; it calls the slave's methods by their names.
"""

from __future__ import annotations

import json
from importlib import import_module
from typing import Any

from .hidden_state import hidden_type, shaped
from .slave_base import SlaveBase, StepRefusedError

LONGEST_MESSAGE = 512
# Numbers of what may be raised, as in translated.h.
STEP_REFUSED, VALUE_ERROR, ZERO_DIVISION_ERROR, OVERFLOW_ERROR, INDEX_ERROR = range(1, 6)
_KINDS = (
    (StepRefusedError, STEP_REFUSED),
    (ValueError, VALUE_ERROR),
    (ZeroDivisionError, ZERO_DIVISION_ERROR),
    (OverflowError, OVERFLOW_ERROR),
    (IndexError, INDEX_ERROR),
)

try:  # at once: the library of the FMU keeps this module for later instances, when its package may be out of reach
    _ENTRY = f"{(__package__ or '').rpartition('.')[0]}.entry"
    _MODEL: Any = import_module(_ENTRY).Model
except ModuleNotFoundError as error:  # outside an FMU
    if error.name != _ENTRY:
        raise
    _MODEL = None


class Bridge:
    """One slave and the memory that it shares: values, states, results, event, fault, message (python_slave.h)."""

    def __init__(self, memory: memoryview, variables: int, states: int, results: int, model: Any = None) -> None:
        model = _MODEL if model is None else model
        self.slave = model()
        self.text = b""
        places = []
        place = 0
        for size in (8 * variables, 8 * (states + 1), 8 * (results + 1), 4 * variables, 4, 4, LONGEST_MESSAGE):
            places.append(memory[place : place + size])
            place += size
        self.views = [places[n].cast("d") for n in range(3)] + [places[n].cast("i") for n in range(3, 6)]
        self.slave.real, self.states, self.results, self.slave.integer, self.event, self.fault = self.views
        self.message = places[6]
        self.count = states
        self.attribute = getattr(model, "state_attribute", "")

    def close(self) -> None:
        """Let go of the memory, which ends with the C instance."""
        self.slave.real = self.slave.integer = {}
        for view in (*self.views, self.message):
            view.release()

    def call(self, method: str, a: float, b: float) -> float:
        """Call a method of the slave; what it raises is left in the shared memory.

        Args:
            b: second argument, if it takes two.

        Returns:
            What it returns if that is a number; a tuple of numbers is left in the shared results.
        """
        self.fault[0] = 0
        slave = self.slave
        try:
            if self.count:
                setattr(slave, self.attribute, tuple(self.states[: self.count]))
            found = self._called(method, a, b)
            if self.count:
                for n, number in enumerate(getattr(slave, self.attribute)):
                    self.states[n] = number
                self.event[0] = slave._event
        except BaseException as error:
            kind = next((number for cls, number in _KINDS if isinstance(error, cls)), 0)
            text = str(error) if kind else f"{type(error).__name__}: {error}"
            said = text.encode("utf-8")[: LONGEST_MESSAGE - 1]
            self.fault[0] = kind or VALUE_ERROR
            self.message[: len(said) + 1] = said + b"\0"
            return 0.0
        if isinstance(found, tuple):
            for n, number in enumerate(found):
                self.results[n] = number
            return 0.0
        return 0.0 if found is None else float(found)

    def _called(self, method: str, a: float, b: float) -> Any:
        slave = self.slave
        if method in ("advance", "advance_to_event"):
            return getattr(slave, method)(a, b)
        if method in ("advance_along", "advance_along_to_event"):
            return slave.advance_along(a, b, method != "advance_along")
        if method == "update":
            return slave.update(a)
        if method == "take_node":
            return slave.take_node(int(a))
        if method == "save":
            self.text = json.dumps(SlaveBase.saved(slave)).encode("ascii")
            return None
        return getattr(slave, method)()

    def restore(self, text: bytes) -> float:
        """Take over a hidden state; return 0, or 1 where the text is none of this slave."""
        slave = self.slave
        try:
            saved = json.loads(text)
            names = slave._hidden
            if len(saved) != len(names):
                return 1.0
            values = [shaped(value, hidden_type(type(slave), name)) for name, value in zip(names, saved)]  # noqa: B905
        except (ValueError, TypeError, IndexError):
            return 1.0
        for name, value in zip(names, values):  # noqa: B905 - Python 3.9 has no `strict`
            setattr(slave, name, value)
        return 0.0
