"""The corrected plant as an FMU: built, checked, and run beside the nominal one by the master algorithm."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.building.build import build_variant
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.diagnosis.model.drive import shift_signal
from orchestrator.diagnosis.model.plant_effects import effect_parameters
from orchestrator.diagnosis.report.estimates import joint_covariance
from orchestrator.diagnosis.report.free_run import free_runs, run_parts
from orchestrator.diagnosis.report.open_test_data import signals_of_test_data
from orchestrator.diagnosis.report.simulation import RunSignals
from orchestrator.diagnosis.result import Diagnosis, ValueEstimate
from orchestrator.effects.of_logs import LEAD
from orchestrator.errors import SimulationError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.plants.description import Plant
from orchestrator.records.fitted_record import FittedRecord
from orchestrator.records.model_file import Model
from orchestrator.records.model_text import describe_fit, model_text
from orchestrator.shared.arrays import Array


@dataclass(frozen=True)
class BeforeAfter:
    """The test part, measured and co-simulated with the nominal and the corrected values."""

    time: Array  # (n,) s
    u: Array  # (n,) N.m
    measured: Array  # (n, channels) rad, as both of the next
    before: Array
    after: Array
    difference: float  # largest one between the corrected FMU and the compiled simulation of the same equations
    rows: tuple[int, ...] = ()  # where each run begins
    starts: tuple[dict[str, float], ...] = ()  # start values of the corrected FMU in each run


def fmu_name(plant: str, source: str) -> str:
    """Return a model identifier made of the plant's name and the record's, at most 80 characters long."""
    stem = re.sub(r"[^A-Za-z0-9_]+", "_", Path(source).stem).strip("_") or "record"
    return f"{plant}_{stem}"[:80]


def build_corrected(diagnosis: Diagnosis, source: str, directory: Path) -> Path:
    """Build the plant's FMU with the corrected values as start values, check it, and return its path."""
    plant = diagnosis.model.plant
    values = start_values(plant, diagnosis.workings.final)
    return check_corrected(build_variant(fmu_name(plant.name, source), plant.name, values, directory))


def check_corrected(path: Path) -> Path:
    """Return the path of a corrected FMU that passes the check of what its values can break.

    All else is as in the plant's own FMU, which passes the whole check.
    """
    report = check_fmu(path, CheckOptions(probes=("life cycle", "reference")))
    if not report.ok:
        raise SimulationError(f"{path.name}: the corrected FMU does not pass `check`: {report.findings[0]}")
    return path


def start_values(plant: Plant, p: Array, built: Array | None = None) -> dict[str, float]:
    """Return the start values that make an FMU the model ``p``: all that differ from those that it has.

    ``built``: parameters of the model that the FMU is (default: the plant's own FMU, with its defaults).
    """
    own = plant.fmu_values(p)
    before = [entry.default for entry in plant.table] if built is None else plant.fmu_values(built)
    return {
        entry.name: float(own[n]) + (1.0 if entry.name in plant.enumerations else 0.0)
        for n, entry in enumerate(plant.table)
        if own[n] != before[n]
    }


def before_and_after(diagnosis: Diagnosis, fmu: Path) -> BeforeAfter:
    """Run the corrected FMU, with the nominal values and with its own, in one system over the test part.

    Each segment starts from the initial state that :func:`free_run` finds for each model.
    """
    w, plant, settings = diagnosis.workings, diagnosis.model.plant, diagnosis.settings.report
    _, signals, first = signals_of_test_data(w.test_data, w.balances[0])[0]
    step, count = signals.step, signals.channels
    parts = run_parts(first, signals.size, settings)
    length = parts[0].stop - parts[0].start
    models = {"before": w.nominal, "after": w.final}
    instances = (fmu_instance("before", fmu, start_values(plant, w.nominal, w.final)), fmu_instance("after", fmu))
    outputs = plant.encoders[:count]
    record = tuple(f"{model}.{name}" for model in models for name in outputs)
    asked = {model: requests_for_fmu(signals, plant, p) for model, p in models.items()}
    sources = tuple(SignalSource(f"{model}.u", Samples(asked[model][parts[0]], step)) for model in models)
    system = System(instances, (), sources)
    expected = {model: free_runs(plant, p, signals, parts, history=False) for model, p in models.items()}
    runs: dict[str, list[Array]] = {model: [] for model in models}
    difference, starts = 0.0, list[dict[str, float]]()
    with Session(system, record, GaussSeidel(step), (length - 1) * step) as session:
        for n, part in enumerate(parts):
            given = {
                f"{model}.{plant.starts[place]}": float(expected[model][n].start[place])
                for model in models
                for place in plant.states
            }
            starts.append({name.partition(".")[2]: v for name, v in given.items() if name.startswith("after.")})
            result = session.run(given, {k: Samples(u[part], step) for k, u in enumerate(asked.values())})
            for model in models:
                runs[model].append(np.column_stack([result[f"{model}.{name}"] for name in outputs]))
            off = runs["after"][-1] - expected["after"][n].outputs
            difference = max(difference, float(np.max(np.abs(off))))
    covered = np.concatenate([np.arange(part.start, part.stop) for part in parts])
    return BeforeAfter(
        np.asarray(step * np.arange(signals.size)[covered]), signals.requests_of(plant, w.final)[covered],
        signals.angles_in_time(plant, w.final)[covered], np.concatenate(runs["before"]), np.concatenate(runs["after"]),
        difference, tuple(part.start - parts[0].start for part in parts), tuple(starts),
    )  # fmt: skip


def requests_for_fmu(signals: RunSignals, plant: Plant, p: Array) -> Array:
    """Return the requests (n,) for an FMU that takes one a sample: what the log has early comes later."""
    lead = plant.value(p, LEAD.name) if LEAD.name in plant.names else 0.0
    return shift_signal(signals.requests_of(plant, p), -lead / signals.step)


def format_corrected_model(model: Model, diagnosis: Diagnosis, record: FittedRecord | None = None) -> str:
    """Return the TOML text of a model with the values of a diagnosis; it reads records as ``model`` does.

    Every value that differs from the FMU's default is stated. Those that were fitted carry the half-width of their 95 %
    interval as uncertainty, so that another record may move them; all others are exact. ``record``: what
    :func:`fitted_record_of` says; None: that is left out.
    """
    plant, final = model.plant, diagnosis.workings.final
    fitted: dict[str, ValueEstimate] = dict(diagnosis.parameters)
    for row in plant.bank:
        named = next((one for one in diagnosis.effects if one.label == row.label and one.in_model), None)
        if named is not None:
            fitted |= {name: named.parameters[short] for short, name in row.parameters.items()}
    values: dict[str, tuple[float, float]] = {}
    for place, entry in enumerate(plant.table):
        value = float(final[place])
        if value == entry.default and entry.name not in fitted and entry.name not in plant.linear:
            continue
        uncertainty = 0.0
        if entry.name in fitted:
            low, high = fitted[entry.name].interval
            half = 0.5 * float(high - low)
            uncertainty = half if math.isfinite(half) else model.parameters[entry.name].uncertainty
        values[entry.name] = (value, uncertainty)
    return model_text(model, values, record)


def fitted_record_of(diagnosis: Diagnosis) -> FittedRecord:
    """Return what the first record showed, and what all records of a diagnosis left open."""
    workings, model, plant = diagnosis.workings, diagnosis.model, diagnosis.model.plant
    problem, fitted = workings.search.problem, workings.search.final
    rows = {row.label: row for row in plant.bank}

    def named(label: str) -> Callable[[tuple[float, ...]], Mapping[str, float]]:
        effect = problem.effects[label]
        return lambda values: {
            name: effect_parameters(plant, effect, values)[name] for name in rows[label].parameters.values()
        }

    names, covariance = joint_covariance(
        problem, fitted, {label: named(label) for label in fitted.labels}, diagnosis.settings.report.level
    )
    kept = [n for n, name in enumerate(names) if name in model.parameters]
    return describe_fit(
        workings.records[0], model, diagnosis.verdict, diagnosis.trust, workings.balances[0].signals.noise,
        {names[n]: plant.value(workings.final, names[n]) for n in kept}, covariance[np.ix_(kept, kept)],
    )  # fmt: skip
