"""A learned law as part of the corrected FMU: built, checked, and run freely over the test part with the law on."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.build import build_variant
from orchestrator.building.sources import catalogue, takes_law
from orchestrator.diagnosis.report.corrected import check_corrected, fmu_name, requests_for_fmu, start_values
from orchestrator.diagnosis.report.free_run import free_runs, run_parts
from orchestrator.diagnosis.report.open_test_data import signals_of_test_data
from orchestrator.diagnosis.result import Diagnosis
from orchestrator.diagnosis.selection.outcome import Dependence
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.plants.learned import names, with_law
from pyfmu_sources.adapters.learned_plant import ON

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LawRun:
    """Free runs of the corrected FMU over the test part, its law switched on.

    Attributes:
        misfit: rms of simulated minus measured by signal [rad].
        difference: largest difference between the FMU and the compiled equations with the law [rad].
        outputs: (n, channels) simulated angles [rad], those of all runs one behind the other.
        starts: start values of each run.
        rows: where each run begins in them.
    """

    misfit: dict[str, float]
    difference: float
    outputs: Array
    starts: tuple[dict[str, float], ...]
    rows: tuple[int, ...]


def law_refusal(diagnosis: Diagnosis) -> str:
    """Return why the corrected FMU of a diagnosis can have no learned law, in a sentence; empty: it can."""
    none = "the corrected FMU has no learned law (`with_law`): "
    if diagnosis.verdict != "unknown":
        return f"{none}one is learned where the verdict is `unknown`, but it is `{diagnosis.verdict}`"
    if diagnosis.law is None:
        return f"{none}what is left follows no signal surely enough"
    name = diagnosis.model.plant.name
    recipe = catalogue().get(name)
    if recipe is None or not takes_law(recipe):
        return f"{none}the plant {name} has no equations for one beside its own"
    return ""


def build_with_law(diagnosis: Diagnosis, law: Dependence, source: str, directory: Path) -> Path:
    """Build the corrected FMU with a learned law, which is off until ``effects.learned_law.on`` is 1, and check it."""
    plant, final = diagnosis.model.plant, diagnosis.workings.final
    values, described = start_values(plant, final), describe_law(diagnosis, law)
    return check_corrected(build_variant(fmu_name(plant.name, source), plant.name, values, directory, described))


def describe_law(diagnosis: Diagnosis, law: Dependence) -> dict[str, Any]:
    """Return a law as an FMU takes it, with the changes of parameters that belong to it."""
    plant = diagnosis.model.plant
    before = plant.fmu_values(diagnosis.workings.final)
    after = plant.fmu_values(_values_with_law(diagnosis, law)[: len(plant.names)])
    changes = {
        entry.name: float(after[n] - before[n])
        for n, entry in enumerate(plant.table)
        if after[n] != before[n] and entry.name not in plant.enumerations
    }
    return {
        "form": law.code, "words": f"{law.argument} at the {law.site}", "unit": law.argument_unit,
        "value_unit": law.unit,
        "knots": list(law.knots), "values": list(law.values), "changes": changes,
    }  # fmt: skip


def _values_with_law(diagnosis: Diagnosis, law: Dependence) -> Array:
    """Return the parameters of the plant with the law, those that were fitted beside it moved."""
    plant = diagnosis.model.plant
    wide = with_law(plant)
    p = np.concatenate([diagnosis.workings.final, [entry.default for entry in wide.nuisances[len(plant.nuisances) :]]])
    for name, share in law.changes.items():
        if name in diagnosis.model.parameters:
            p[plant.index(name)] += share * diagnosis.model.parameters[name].value
    code, knots, values = names()
    p[wide.index(code)] = law.code
    p[[wide.index(name) for name in knots]] = law.knots
    p[[wide.index(name) for name in values]] = law.values
    return p


def run_with_law(diagnosis: Diagnosis, law: Dependence, fmu: Path) -> LawRun:
    """Run the corrected FMU over the test part with its law on, part by part.

    Each part starts from the initial state that lies closest for the compiled equations with the law.

    Returns:
        What the runs miss, and how they were started.
    """
    plant, settings = diagnosis.model.plant, diagnosis.settings.report
    _, signals, first = signals_of_test_data(diagnosis.workings.test_data, diagnosis.workings.balances[0])[0]
    wide, p = with_law(plant), _values_with_law(diagnosis, law)
    encoders, step = plant.encoders[: signals.channels], signals.step
    parts = run_parts(first, signals.size, settings)
    expected = free_runs(wide, p, signals, parts, history=False)
    asked = requests_for_fmu(signals, plant, diagnosis.workings.final)
    instance = fmu_instance("law", fmu, {ON: 1})
    source = SignalSource("law.u", Samples(asked[parts[0]], step))
    record = tuple(f"law.{name}" for name in encoders)
    outputs: list[Array] = []
    starts: list[dict[str, float]] = []
    difference, length = 0.0, parts[0].stop - parts[0].start
    with Session(System((instance,), (), (source,)), record, GaussSeidel(step), (length - 1) * step) as session:
        for part, run in zip(parts, expected, strict=True):
            given = {plant.starts[place]: float(run.start[place]) for place in plant.states}
            result = session.run({f"law.{n}": v for n, v in given.items()}, {0: Samples(asked[part], step)})
            outputs.append(np.column_stack([result[name] for name in record]))
            difference = max(difference, float(np.max(np.abs(outputs[-1] - run.outputs))))
            starts.append(given)
    simulated = np.concatenate(outputs)
    angles = signals.angles_in_time(plant, diagnosis.workings.final)
    measured = np.concatenate([angles[part] for part in parts])
    rms = np.sqrt(np.mean((simulated - measured) ** 2, axis=0))
    misfit = {name: float(value) for name, value in zip(encoders, rms, strict=True)}
    return LawRun(misfit, difference, simulated, tuple(starts), tuple(part.start - parts[0].start for part in parts))
