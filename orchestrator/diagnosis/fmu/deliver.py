"""The corrected system as an SSP: the original FMU untouched, effect FMUs wired around it, and their values."""

import hashlib
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.building.archive import write_archive
from orchestrator.diagnosis.fmu.bank import OUTPUT
from orchestrator.diagnosis.fmu.binding import owned
from orchestrator.diagnosis.fmu.model import BoxModel
from orchestrator.diagnosis.fmu.parts import Part, build_effect_fmu, parts_of
from orchestrator.diagnosis.fmu.problem import BoxProblem, series_of
from orchestrator.diagnosis.fmu.ssp_structure import (
    PLANT,
    border_name,
    followed_signals,
    owner_and_connector,
    parameter_values,
    system_structure,
)
from orchestrator.errors import OrchestratorError
from orchestrator.master.signals import Samples
from orchestrator.scenarios.isolated import Safety
from orchestrator.scenarios.scenario import simulate
from orchestrator.scenarios.ssp.common import STRUCTURE
from orchestrator.scenarios.ssp.read import opened_ssp
from orchestrator.shared.results.any_fmu import DeliveredFound, PartFound


@dataclass(frozen=True)
class Delivered:
    """A corrected system that was written.

    Attributes:
        difference: largest rms difference of an output between its run under our master and the fit, over the noise.
        note: why it could not be run, where it could not.
    """

    path: Path
    parts: tuple[Part, ...]
    difference: float
    note: str = ""

    def found(self) -> DeliveredFound:
        """Return what ``diagnose.json`` says of it."""
        parts = tuple(
            PartFound(p.name, "connection" if p.effect is None else p.effect.label, p.values) for p in self.parts
        )
        return DeliveredFound(self.path.name, parts, self.difference, self.note)


def deliver(path: Path, problem: BoxProblem, model: BoxModel) -> Delivered:
    """Write the corrected system as SSP 1.0, and compare its run with the fit."""
    parts = parts_of(problem, model)
    subject = problem.runner.subject
    members = {f"resources/{fmu.name}": fmu.read_bytes() for fmu in subject.members.values()}
    attachment = ""
    if parts:
        with tempfile.TemporaryDirectory() as folder:
            built = build_effect_fmu(Path(folder))
            attachment = f"AttachedEffect_{hashlib.sha256(built.read_bytes()).hexdigest()[:8]}.fmu"
            members[f"resources/{attachment}"] = built.read_bytes()
    for name in subject.members:
        members[f"resources/{name or PLANT}.ssv"] = parameter_values(_given_to(name, problem, model))
    for part in parts:
        members[f"resources/{part.name}.ssv"] = parameter_values(part.values)
    members[STRUCTURE] = system_structure(problem, parts, attachment)
    write_archive(path, members)
    try:
        return Delivered(path, parts, difference(path, problem, model))
    except OrchestratorError as error:
        return Delivered(path, parts, float("nan"), str(error))


def difference(path: Path, problem: BoxProblem, model: BoxModel, jacobi: bool = False) -> float:
    """Return the largest rms difference between a run of the system and the fit, over the noise."""
    fitted = problem.must_simulate(model)
    step = problem.step
    table = series_of(problem, problem.n)
    start = float(problem.data.time[0])
    signals = {border_name(name, "in"): Samples(table[:, k], step, start) for k, name in enumerate(problem.inputs)}
    for name in followed_signals(parts_of(problem, model)):
        at = list(problem.map.signals).index(name)
        values = problem.data.signals[:-1, at] + problem.map.signals[name].reference
        signals[border_name(name, "in")] = Samples(np.repeat(values, problem.m), step, start)
    worst = 0.0
    with opened_ssp(path, signals, step, jacobi) as scenario:
        result = simulate(scenario, Safety())
    for k, name in enumerate(problem.outputs):
        last = [p.name for p in parts_of(problem, model) if p.where == OUTPUT and p.place == name]
        signal = f"{last[-1]}.result" if last else ".".join(owner_and_connector(problem, name))
        y = result[signal][:: problem.m][: problem.n]
        rows = slice(problem.n // 20, None)
        rms = float(np.sqrt(np.mean((y[rows] - fitted[: len(y), k][rows]) ** 2)))
        worst = max(worst, rms / float(problem.noise[k]))
    return worst


def _given_to(member: str, problem: BoxProblem, model: BoxModel) -> dict[str, float | int | bool | str]:
    """Return start values of one of the FMUs, by its own names."""
    placed = {owned(n, problem.runner.subject.members): v for n, v in problem.starts(model).items()}
    return {variable: value for (name, variable), value in placed.items() if name == member}
