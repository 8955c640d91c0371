"""The signals that an effort at a port of an FMU may follow where no effect explains it."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.residual_model import FmuResiduals
from orchestrator.diagnosis.model.interface import LawArgument

Array = NDArray[np.float64]


def port_arguments(models: Sequence[FmuResiduals]) -> list[LawArgument]:
    """Return what an effort at a port may be a function of: position and speed there, each input, time.

    Args:
        models: one for each record.

    Returns:
        The arguments, for each port.
    """
    problem = models[0].problem
    found = []
    for port, entry in problem.map.ports.items():
        position, effort = problem.units.get(entry.position, ""), problem.units.get(entry.input, "")
        signals: list[tuple[str, str, Callable[[FmuResiduals], Array]]] = [
            (f"position at {port}", position, lambda m, port=port: m.motions[port].x),
            (f"speed at {port}", f"{position or '1'}/s", lambda m, port=port: m.motions[port].v),
            ("time", "s", lambda m: m.problem.data.time - m.problem.data.time[0]),
        ]
        for k, name in enumerate(problem.inputs):
            signals.append((name, problem.units.get(name, ""), lambda m, k=k: m.problem.data.inputs[:, k]))
        for name, unit, signal in signals:
            responses = tuple(partial(model.respond_to_effort, port) for model in models)
            found.append(LawArgument(name, port, unit, effort, tuple(signal(model) for model in models), responses))
    return found
