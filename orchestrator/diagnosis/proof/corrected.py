"""The corrected plant as an FMU: built, checked, and run beside the nominal one by the master algorithm."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.build import build_variant, ensure_built
from orchestrator.checking.check import check_fmu
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.proof.free_run import free_run
from orchestrator.diagnosis.proof.misfit import segments
from orchestrator.errors import SimulationError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.plants.description import Plant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BeforeAfter:
    """The held-out part, measured and co-simulated with the nominal and the corrected FMU.

    Attributes:
        time: (n,) s.
        u: (n,) N.m.
        measured, before, after: (n, channels) rad.
        difference: largest difference between the corrected FMU and the compiled simulation of the same equations.
        restarts: times at which a free run starts anew [s], the first included.
        rows: where each run begins.
        starts: start values of the corrected FMU in each run.
    """

    time: Array
    u: Array
    measured: Array
    before: Array
    after: Array
    difference: float
    restarts: tuple[float, ...] = ()
    rows: tuple[int, ...] = ()
    starts: tuple[dict[str, float], ...] = ()


def fmu_name(plant: str, source: str) -> str:
    """Return a model identifier made of the plant's name and the record's.

    Args:
        plant: its name.
        source: file name of the record.

    Returns:
        At most 80 characters.
    """
    stem = re.sub(r"[^A-Za-z0-9_]+", "_", Path(source).stem).strip("_") or "record"
    return f"{plant}_{stem}"[:80]


def build_corrected(diagnosis: Diagnosis, source: str, directory: Path) -> Path:
    """Build the plant's FMU with the corrected values as start values, check it, and return its path.

    Args:
        diagnosis: of the record.
        source: file name of the record.
        directory: where the FMU goes.

    Returns:
        The FMU's path.

    Raises:
        FmuError: it cannot be built.
        SimulationError: the check found an error in it.
    """
    plant = diagnosis.workings.plant
    values = start_values(plant, diagnosis.workings.final.p)
    return checked(build_variant(fmu_name(plant.name, source), plant.name, values, directory))


def checked(path: Path) -> Path:
    """Return the path of a corrected FMU that passes the check.

    Args:
        path: of the FMU.

    Returns:
        The same.

    Raises:
        SimulationError: the check found an error in it.
    """
    report = check_fmu(path)
    if not report.ok:
        raise SimulationError(f"{path.name}: the corrected FMU does not pass `check`: {report.findings[0]}")
    return path


def start_values(plant: Plant, p: Array) -> dict[str, float]:
    """Return the start values that make the plant's FMU the model ``p``: all that differ from its defaults.

    Args:
        plant: that the record is of.
        p: (parameters,) of the predictor.

    Returns:
        Value by name, in SI units.
    """
    own = plant.own(p)
    return {
        entry.name: float(own[n]) + (1.0 if entry.name in plant.enumerations else 0.0)
        for n, entry in enumerate(plant.table)
        if own[n] != entry.default
    }


def before_and_after(diagnosis: Diagnosis, fmu: Path) -> BeforeAfter:
    """Run the nominal and the corrected FMU, in one process and one system, over the held-out part.

    Each segment starts from the initial state that :func:`free_run` finds for each model.

    Args:
        diagnosis: of the record.
        fmu: path of the corrected FMU.

    Returns:
        Times, measured angles and those of both models.
    """
    w = diagnosis.workings
    signals, h, settings = w.likelihood.signals, w.likelihood.signals.h, diagnosis.settings.proof
    m = signals.channels
    nominal = ensure_built([w.plant.name])[w.plant.name]
    parts = segments(w.parts.held_out, signals, settings)
    length = parts[0].stop - parts[0].start
    whole = w.likelihood.over(signals.size)
    models = {"before": w.nominal, "after": w.final.p}
    instances = (
        fmu_instance("before", nominal, start_values(w.plant, w.nominal)),
        fmu_instance("after", fmu),
    )
    outputs = w.plant.encoders[:m]
    record = tuple(f"{model}.{name}" for model in models for name in outputs)
    asked = {model: signals.aligned(w.plant, p).meant for model, p in models.items()}
    sources = tuple(SignalSource(f"{model}.u", Samples(asked[model][parts[0]], h)) for model in models)
    system = System(instances, (), sources)
    runs: dict[str, list[Array]] = {model: [] for model in models}
    difference = 0.0
    starts: list[dict[str, float]] = []
    with Session(system, record, GaussSeidel(h), (length - 1) * h) as session:
        for part in parts:
            given: dict[str, float] = {}
            expected: dict[str, Array] = {}
            for model, p in models.items():
                _, states = whole.innovations(p, w.final.q)
                run = free_run(w.plant, p, states[part.start], signals, part, settings.free_run, history=False)
                given |= {f"{model}.{w.plant.starts[s]}": float(run.start[s]) for s in w.plant.states}
                expected[model] = run.outputs
            starts.append({name.partition(".")[2]: v for name, v in given.items() if name.startswith("after.")})
            result = session.run(given, {n: Samples(u[part], h) for n, u in enumerate(asked.values())})
            for model in models:
                runs[model].append(np.column_stack([result[f"{model}.{name}"] for name in outputs]))
            difference = max(difference, float(np.max(np.abs(runs["after"][-1] - expected["after"]))))
    covered = np.concatenate([np.arange(part.start, part.stop) for part in parts])
    return BeforeAfter(
        np.asarray(h * np.arange(signals.size)[covered]),
        signals.u[covered],
        signals.aligned(w.plant, w.final.p).y[covered][:, :m],
        np.concatenate(runs["before"]),
        np.concatenate(runs["after"]),
        difference,
        tuple(h * part.start for part in parts),
        tuple(part.start - parts[0].start for part in parts),
        tuple(starts),
    )
