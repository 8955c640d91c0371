"""The signals that an effort at a port of an FMU may follow where no effect explains it."""

from collections.abc import Sequence
from functools import partial

from orchestrator.diagnosis.fmu.residual_model import FmuResiduals
from orchestrator.diagnosis.model.interface import LawArgument


def port_arguments(models: Sequence[FmuResiduals]) -> list[LawArgument]:
    """Return what an effort at a port may be a function of: position and speed there (or the flow), each input, time.

    Args:
        models: one for each record.

    Returns:
        The arguments, for each port.
    """
    problem = models[0].problem
    found = []
    for port, entry in problem.map.ports.items():
        unit, effort = problem.units.get(entry.position, ""), problem.units.get(entry.input, "")
        speeds = [model.motions[port].v for model in models]
        signals = [("time", "s", [model.problem.data.time - model.problem.data.time[0] for model in models])]
        if entry.flow_only:
            signals.append((f"flow at {port}", unit, speeds))
        else:
            signals.append((f"position at {port}", unit, [model.motions[port].x for model in models]))
            signals.append((f"speed at {port}", f"{unit or '1'}/s", speeds))
        for k, name in enumerate(problem.inputs):
            signals.append((name, problem.units.get(name, ""), [model.problem.data.inputs[:, k] for model in models]))
        for name, of_name, values in signals:
            responses = tuple(partial(model.respond_to_effort, port) for model in models)
            found.append(LawArgument(name, port, of_name, effort, tuple(values), responses))
    return found
