"""One paired run: both loops in one system of six FMUs, and the estimate from their difference."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestrator.errors import CalibrationError
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.protocol import Value
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.paired.calibration import GapEstimate, estimate_gap, load_or_calibrate
from orchestrator.paired.cosimulation import ERROR_SOURCES, MACHINE, RECORDED, TWIN, LoopRun, loop_system, plant_values
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.metric import difference_sum


@dataclass(frozen=True)
class PairRun:
    """Both loops, the metric S [rad], and the estimate, or why there is none."""

    machine: LoopRun
    twin: LoopRun
    total: float
    estimate: GapEstimate | None
    no_estimate: str = ""


def run_pair(
    experiment: Experiment,
    fmus: Mapping[str, Path],
    alpha: float,
    seed: int = 0,
    start: Mapping[str, Value] | None = None,
) -> PairRun:
    """Co-simulate the loop with a half-gap ``alpha`` [rad] and its twin without one, side by side.

    The half-gap may have any size, for the estimate says itself when it cannot be trusted.
    """
    prefixes = (MACHINE, TWIN)
    system = loop_system(experiment, fmus, prefixes)
    record = [f"{prefix}{address}" for prefix in prefixes for address in RECORDED.values()]
    errors = experiment.encoder_errors(seed)
    signals = {k: Samples(e, experiment.sample_time) for k, e in zip(ERROR_SOURCES, errors, strict=True)}
    with Session(system, record, GaussSeidel(experiment.sample_time), experiment.duration) as session:
        result = session.run(plant_values(experiment, alpha) | dict(start or {}), signals)
    count = len(RECORDED)
    machine = LoopRun(result.time, dict(zip(RECORDED, result.values[:count], strict=True)))
    twin = LoopRun(result.time, dict(zip(RECORDED, result.values[count:], strict=True)))
    total = difference_sum(machine["theta_l_hat"], twin["theta_l_hat"])
    try:
        estimate = estimate_gap(load_or_calibrate(experiment), total)
    except CalibrationError as error:
        return PairRun(machine, twin, total, None, str(error))
    return PairRun(machine, twin, total, estimate)
