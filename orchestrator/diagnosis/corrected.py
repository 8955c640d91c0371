"""The corrected plant as an FMU: built, checked, and run beside the nominal one by the master algorithm."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.checking.check import check_fmu
from orchestrator.diagnosis.diagnose import SEGMENT
from orchestrator.diagnosis.free_run import free_run
from orchestrator.diagnosis.likelihood import Likelihood
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.plants import Plant
from orchestrator.errors import SimulationError
from orchestrator.fmi.build import build_variant, ensure_built
from orchestrator.fmi.slave import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import Source, System

Array = NDArray[np.float64]

STARTS = {0: "theta_m_start", 1: "omega_m_start", 2: "theta_l_start", 3: "omega_l_start", 4: "T_m_start"}
ENUMERATIONS = ("backlash_model",)


@dataclass(frozen=True)
class BeforeAfter:
    """The held-out part, measured and co-simulated with the nominal and the corrected FMU.

    Attributes:
        time: (n,) s.
        u: (n,) N.m.
        measured, before, after: (n, channels) rad.
        difference: largest difference between the corrected FMU and the compiled simulation of the same equations.
    """

    time: Array
    u: Array
    measured: Array
    before: Array
    after: Array
    difference: float


def fmu_name(plant: str, source: str) -> str:
    """Return a model identifier made of the plant's name and the record's."""
    stem = re.sub(r"[^A-Za-z0-9_]+", "_", Path(source).stem).strip("_") or "record"
    return f"{plant}_{stem}"[:80]


def build_corrected(diagnosis: Diagnosis, source: str, directory: Path) -> Path:
    """Build the plant's FMU with the corrected values as start values, check it, and return its path.

    Raises:
        FmuError: it cannot be built.
        SimulationError: the check found an error in it.
    """
    plant = diagnosis.workings.plant
    path = build_variant(
        fmu_name(plant.name, source), plant.name, start_values(plant, diagnosis.workings.final.p), directory
    )
    report = check_fmu(path)
    if not report.ok:
        raise SimulationError(f"{path.name}: the corrected FMU does not pass `check`: {report.findings[0]}")
    return path


def start_values(plant: Plant, p: Array) -> dict[str, float]:
    """Return the start values that make the plant's FMU the model ``p``: all that differ from its defaults."""
    return {
        entry.name: float(p[n]) + (1.0 if entry.name in ENUMERATIONS else 0.0)
        for n, entry in enumerate(plant.table)
        if p[n] != entry.default
    }


def before_and_after(diagnosis: Diagnosis, fmu: Path) -> BeforeAfter:
    """Run the nominal and the corrected FMU, in one process and one system, over the held-out part.

    Each segment starts from the initial state that :func:`free_run` finds for each model.
    """
    w = diagnosis.workings
    signals, h = w.likelihood.signals, w.likelihood.signals.h
    m = signals.channels
    nominal = ensure_built([w.plant.name])[w.plant.name]
    length = max(round(SEGMENT / h), 40)
    begin, end, _ = w.parts.held_out.indices(signals.size)
    starts = list(range(begin, end - length + 1, length)) or [begin]
    length = min(length, end - begin)
    whole = Likelihood(w.plant, signals, w.nominal, signals.size)
    models = {"before": w.nominal, "after": w.final.p}
    instances = (
        fmu_instance("before", nominal, start_values(w.plant, w.nominal)),
        fmu_instance("after", fmu),
    )
    outputs = ("theta_m", "theta_l")[:m]
    record = tuple(f"{model}.{name}" for model in models for name in outputs)
    rows = slice(starts[0], starts[0] + length)
    sources = tuple(Source(f"{model}.u", Samples(signals.u[rows], h)) for model in models)
    system = System(instances, (), sources)
    runs: dict[str, list[Array]] = {model: [] for model in models}
    difference = 0.0
    with Session(system, record, GaussSeidel(h), (length - 1) * h) as session:
        for start in starts:
            part = slice(start, start + length)
            given: dict[str, float] = {}
            expected: dict[str, Array] = {}
            for model, p in models.items():
                _, states = whole.innovations(p, w.final.q)
                run = free_run(w.plant, p, states[start], signals, part, history=False)
                given |= {f"{model}.{STARTS[s]}": float(run.start[s]) for s in w.plant.states}
                expected[model] = run.outputs
            u = Samples(signals.u[part], h)
            result = session.run(given, {0: u, 1: u})
            for model in models:
                runs[model].append(np.column_stack([result[f"{model}.{name}"] for name in outputs]))
            difference = max(difference, float(np.max(np.abs(runs["after"][-1] - expected["after"]))))
    covered = slice(starts[0], starts[0] + length * len(starts))
    return BeforeAfter(
        np.asarray(h * np.arange(signals.size)[covered]),
        signals.u[covered],
        signals.y[covered, :m],
        np.concatenate(runs["before"]),
        np.concatenate(runs["after"]),
        difference,
    )
