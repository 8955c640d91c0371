"""What a diagnosis says of one record, in the few values that every benchmark needs.

This is the only module of the benchmarks that knows the result of ``oc.diagnose``.
"""

import resource
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import orchestrator as oc
from orchestrator.api.any_fmu import diagnose_fmu
from orchestrator.diagnosis.result import Diagnosis, DiagnosisOutcome
from orchestrator.errors import OrchestratorError
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

GRADES = ("certain", "likely", "possible")
NAMED = ("certain", "likely")  # grades that count as a name


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class NamedEffect:
    """A named effect: its grade, its values by short name, the labels that the record does not tell from it, and the
    rules that lowered its grade.
    """

    grade: str
    values: dict[str, Estimate]
    family: tuple[str, ...] = ()
    lowered_by: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What a diagnosis says of one record.

    Attributes:
        names: label (``name@site``) -> effect.
        parameters: re-fitted values of the model's own parameters, by name.
        misfit: signal -> rms on the test part of re-fitted parameters, and with the names.
        refused: why nothing is said; empty: something is.
        seconds: processor time.
        verdict: of the diagnosis.
        trust: level of it, in a word.
    """

    names: dict[str, NamedEffect] = field(default_factory=dict)
    parameters: dict[str, Estimate] = field(default_factory=dict)
    misfit: dict[str, tuple[float, float]] = field(default_factory=dict)
    refused: str = ""
    seconds: float = 0.0
    verdict: str = ""
    trust: str = ""

    @property
    def alarms(self) -> bool:
        """Whether it says that something is missing that it does not know, or that the model must not be used."""
        return self.verdict == "unknown" or self.trust == "red"

    def labels(self, grades: tuple[str, ...] = NAMED) -> list[str]:
        """Return the labels of some grades.

        Args:
            grades: of the names.

        Returns:
            The labels.
        """
        return [label for label, effect in self.names.items() if effect.grade in grades]


def diagnose_record(record: Record, model: Model, settings: Any = None, search: bool = True) -> Outcome:
    """Return what a diagnosis says of a record; a refusal is an outcome.

    Args:
        record: the record.
        model: what it is compared with.
        settings: of the diagnosis; None: the default.
        search: False: parameters are re-fitted, no effect is looked for.

    Returns:
        The outcome.
    """
    begun = time.process_time()
    try:
        outcome = outcome_of(oc.diagnose(record, model, settings=settings, search=search))
    except OrchestratorError as error:
        outcome = Outcome(refused=str(error))
    return replace(outcome, seconds=time.process_time() - begun)


def diagnose_with_fmu(record: Path, fmu: Path, map_path: Path) -> Outcome:
    """Return what a diagnosis of any FMU says of a record; a refusal is an outcome.

    Args:
        record, fmu, map_path: the files.

    Returns:
        The outcome; its processor time is that of the FMU's processes too.
    """
    begun = _processor_time()
    try:
        result = diagnose_fmu([record], fmu, map_path)
    except OrchestratorError as error:
        return Outcome(refused=str(error), seconds=_processor_time() - begun)
    result.close()
    return replace(outcome_of(result), seconds=_processor_time() - begun)


def _processor_time() -> float:
    """Return the seconds that this process and its ended children have computed."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def outcome_of(result: Any) -> Outcome:
    """Return the outcome of one result of ``oc.diagnose``.

    Args:
        result: of a plant of ours, or of any FMU.

    Returns:
        The outcome.
    """
    diagnosis: DiagnosisOutcome = result.diagnosis
    names = {
        effect.label: NamedEffect(
            effect.grade.word, _values(effect.parameters), effect.evidence.family, effect.lowered_by
        )
        for effect in diagnosis.effects
    }
    for nuisance in diagnosis.nuisances if isinstance(diagnosis, Diagnosis) else ():
        if nuisance.name != "drive_gain":  # never more than a remark: values that carry a torque take its place
            names[nuisance.name] = NamedEffect(
                nuisance.grade.word, _values(nuisance.parameters), lowered_by=nuisance.lowered_by
            )
    misfit = {
        f"{n}:{one.signal}": (one.parameters, one.final)
        for n, part in enumerate(diagnosis.test)
        for one in part.signals
    }
    return Outcome(
        names, _values(diagnosis.parameters), misfit, verdict=diagnosis.verdict, trust=diagnosis.trust.level.word
    )


def _values(estimates: Mapping[str, Any]) -> dict[str, Estimate]:
    return {name: Estimate(one.value, *one.interval) for name, one in estimates.items()}
