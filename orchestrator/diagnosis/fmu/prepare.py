"""Records and an FMU, made ready for the analysis: probed, their noise known, what does nothing left out."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu.noise import begins_elsewhere, lone_rows, noise_of
from orchestrator.diagnosis.fmu.probing import Probe, opened, reduced
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.diagnosis.fmu.subject import Subject
from orchestrator.diagnosis.fmu_settings import DEFAULT, FmuSettings

Progress = Callable[[str], None]


def prepare_problems(
    subject: Subject,
    given: Map,
    records: Sequence[Data],
    workers: int | None = None,
    progress: Progress = lambda what: None,
    settings: FmuSettings = DEFAULT,
) -> tuple[tuple[BoxProblem, ...], Probe]:
    """Return a probed problem for each record, all with the same processes.

    Returns:
        The problems, whose children the caller ends, and what the FMU was found to be.
    """
    first, probe = opened(subject, given, records[0], workers, progress, settings)
    first.units = subject.units
    first.map = reduced(given, probe)
    first.sign = probe.sign
    problems, notes = [], probe.notes
    try:
        for data in records:
            problem = first if data is records[0] else replace(first, data=data, noise=first.noise.copy())
            y = problem.must_simulate(problem.nominal)
            noise, said = noise_of(given, data, [problem.data.outputs, problem.data.outputs - y], settings.probe)
            problem.noise = np.sqrt(noise**2 + probe.solver_error**2)
            notes += (*data.notes[2:], *said, *begins_elsewhere(problem, y, settings.probe))
            notes += lone_rows(problem, y, settings.probe)
            problems.append(problem)
    except BaseException:
        first.runner.close()
        raise
    return tuple(problems), replace(probe, notes=notes)
