"""Signals into inputs of type Integer, Boolean or Enumeration: what each can take, and what not."""

from collections.abc import Sequence

import numpy as np

from orchestrator.master.protocol import Variable
from orchestrator.master.signals import Constant, Samples, Scaled, Signal, Square, Step, Table
from orchestrator.master.values import coerce_value


def levels(signal: Signal) -> Sequence[float] | None:
    """Return the values that a signal jumps between."""
    match signal:
        case Constant():
            return [signal.value]
        case Step():
            return [signal.before, signal.after]
        case Square():
            return [signal.offset - signal.amplitude, signal.offset + signal.amplitude]
        case Table(hold=True) | Samples():
            return [float(value) for value in np.unique(np.asarray(signal.values))]
        case Scaled():
            inner = levels(signal.signal)
            return None if inner is None else [signal.factor * value + signal.offset for value in inner]
    return None


def discrete_problem(variable: Variable, signal: Signal) -> str | None:
    """Return what keeps a signal from being fed into an input that is not Real, in words."""
    values = levels(signal)
    if values is None:
        kinds = "a constant, a step, a square or a table with hold = true"
        return f"must be {kinds}, for it feeds an input of type {variable.type}"
    for value in values:
        if variable.type == "Boolean":
            if value not in (0.0, 1.0):
                return f"must be true or false (1 or 0) at all times, but is {value:g}"
            continue
        _, text = coerce_value(variable, value)
        if text is not None:
            return text
    return None
