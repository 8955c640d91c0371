"""A learned law as part of the corrected FMU: built, checked, and run freely over the held-out part with the law on."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.build import build_variant
from orchestrator.building.sources import catalogue, takes_law
from orchestrator.diagnosis.outcome import Diagnosis, FittedLaw, LearnedLaw
from orchestrator.diagnosis.proof.corrected import checked, fmu_name, start_values
from orchestrator.diagnosis.proof.free_run import free_run
from orchestrator.diagnosis.proof.misfit import segments
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.plants.description import Plant
from orchestrator.plants.learned import (
    CLOCK_STATE,
    CYCLE_L,
    CYCLE_M,
    DRY,
    PERIOD,
    SINCE,
    Argument,
    arguments_of,
    cycles_of,
    later_arguments_of,
    names,
    rubbing,
)
from pyfmu_sources.learned_plant import CLOCK, ON

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LawRun:
    """Free runs of the corrected FMU over the held-out part, its law switched on.

    Attributes:
        misfit: rms of simulated minus measured by signal [rad].
        difference: largest difference between the FMU and the predictor with the law [rad].
        outputs: (n, channels) simulated angles [rad], those of all runs one behind the other.
        starts: start values of each run; of a law with a clock, the clock's among them.
        rows: where each run begins in them.
    """

    misfit: dict[str, float]
    difference: float
    outputs: Array
    starts: tuple[dict[str, float], ...]
    rows: tuple[int, ...]


def refusal(diagnosis: Diagnosis) -> str:
    """Return why the corrected FMU of a diagnosis can have no learned law, in a sentence; empty: it can.

    Args:
        diagnosis: of the record.

    Returns:
        The sentence.
    """
    none = "the corrected FMU has no learned law (`with_law`): "
    if diagnosis.verdict != "unknown":
        return f"{none}one is learned where the verdict is `unknown`, but it is `{diagnosis.verdict}`"
    if diagnosis.learned is None:
        return f"{none}none was found that predicts what is left"
    name = diagnosis.workings.plant.name
    recipe = catalogue().get(name)
    if recipe is None or not takes_law(recipe):
        return f"{none}the plant {name} has no equations for one beside its own"
    return ""


def build_with_law(diagnosis: Diagnosis, law: LearnedLaw, source: str, directory: Path) -> Path:
    """Build the corrected FMU with a learned law, which is off until ``effects.learned_law.on`` is 1, and check it.

    Args:
        diagnosis: of the record.
        law: learned from what it leaves.
        source: file name of the record.
        directory: where the FMU goes.

    Returns:
        The FMU's path.

    Raises:
        FmuError: it cannot be built, or the plant cannot have a law.
        SimulationError: the check found an error in it.
    """
    w = diagnosis.workings
    values = start_values(w.plant, w.final.p)
    described = law_of(w.plant, law, w.final.p)
    return checked(build_variant(fmu_name(w.plant.name, source), w.plant.name, values, directory, described))


def law_of(plant: Plant, law: LearnedLaw, p: Array) -> dict[str, Any]:
    """Return a law as an FMU takes it, with the changes of parameters that belong to it.

    Args:
        plant: without the law.
        law: that was learned.
        p: (parameters,) of the model without the law.

    Returns:
        What ``pyfmu_sources.learned_plant.law_variables`` takes.
    """
    fitted = _fitted(law)
    wide = fitted.likelihood.plant
    code, knots, values = ([wide.index(name) for name in group] for group in _groups())
    argument = _argument(plant, int(fitted.p[code[0]]))
    found: dict[str, Any] = {
        "form": argument.code,
        "words": f"{law.argument} at the {law.site}",
        "unit": argument.unit,
        "value_unit": "N.m.s/rad" if argument.with_speed else "N.m",
        "knots": fitted.p[knots].tolist(),
        "values": fitted.p[values].tolist(),
    }
    since, period, dry = (float(fitted.p[wide.index(name)]) for name in (SINCE, PERIOD, DRY))
    cyclic = argument.kind in (CYCLE_M, CYCLE_L)
    beside = np.array(fitted.p[: len(plant.names)])
    rubs = rubbing(plant, argument)
    found |= {"since": since} if cyclic or argument.later else {}
    found |= {"period": period} if cyclic else {}
    own = plant.own(beside)
    if rubs is not None:
        # The distance over which friction builds up follows from the friction that there is, the law's included.
        place = plant.index(rubs.parameters[rubs.size])
        beside[place] += dry
        own = plant.own(beside)
        own[place] -= dry
        found["dry"] = dry
    return found | {"changes": _changes(plant, plant.own(p), own)}


def run_with_law(diagnosis: Diagnosis, law: LearnedLaw, fmu: Path) -> LawRun:
    """Run the corrected FMU over the held-out part with its law on, segment by segment.

    Each segment starts from the initial state that :func:`free_run` finds for the predictor with the law.

    Args:
        diagnosis: of the record.
        law: that the FMU has.
        fmu: its path.

    Returns:
        What the runs miss, and how they were started.
    """
    fitted, w, settings = _fitted(law), diagnosis.workings, diagnosis.settings.proof
    likelihood, p = fitted.likelihood, fitted.p
    plant, signals, h = likelihood.plant, likelihood.signals, likelihood.signals.h
    aligned, encoders = signals.aligned(plant, p), plant.encoders[: signals.channels]
    parts = segments(w.parts.held_out, signals, settings)
    _, states = likelihood.over(signals.size).innovations(p, fitted.q)
    described = law_of(w.plant, law, w.final.p)
    instance = fmu_instance("law", fmu, {ON: 1})
    source = SignalSource("law.u", Samples(aligned.meant[parts[0]], h))
    record = tuple(f"law.{name}" for name in encoders)
    outputs: list[Array] = []
    starts: list[dict[str, float]] = []
    difference, length = 0.0, parts[0].stop - parts[0].start
    with Session(System((instance,), (), (source,)), record, GaussSeidel(h), (length - 1) * h) as session:
        for part in parts:
            run = free_run(plant, p, states[part.start], signals, part, settings.free_run, history=False)
            given = {plant.starts[place]: float(run.start[place]) for place in plant.states}
            given |= {CLOCK: float(run.start[CLOCK_STATE])} if "since" in described else {}
            result = session.run({f"law.{n}": v for n, v in given.items()}, {0: Samples(aligned.meant[part], h)})
            outputs.append(np.column_stack([result[name] for name in record]))
            difference = max(difference, float(np.max(np.abs(outputs[-1] - run.outputs))))
            starts.append(given)
    simulated = np.concatenate(outputs)
    measured = np.concatenate([aligned.y[part, : signals.channels] for part in parts])
    rms = np.sqrt(np.mean((simulated - measured) ** 2, axis=0))
    misfit = {name: float(value) for name, value in zip(encoders, rms, strict=True)}
    rows = tuple(part.start - parts[0].start for part in parts)
    return LawRun(misfit, difference, simulated, tuple(starts), rows)


def _groups() -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    code, knots, values = names()
    return (code,), knots, values


def _fitted(law: LearnedLaw) -> FittedLaw:
    assert law.fitted is not None, "a law of a diagnosis has the model that it was fitted in"
    return law.fitted


def _argument(plant: Plant, code: int) -> Argument:
    every = (*arguments_of(plant), *later_arguments_of(plant), *cycles_of(plant))
    return next(one for one in every if one.code == code)


def _changes(plant: Plant, before: Array, after: Array) -> dict[str, float]:
    """Return by how much parameters of the FMU differ between two models, where they do."""
    return {
        entry.name: float(after[n] - before[n])
        for n, entry in enumerate(plant.table)
        if after[n] != before[n] and entry.name not in plant.enumerations
    }
