"""Parameters of any FMU from records: the fit without effects, with intervals and what the records do not determine."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.diagnosis.fmu.diagnose import diagnose_fmu
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu.result import FmuDiagnosis
from orchestrator.diagnosis.fmu.subject import Subject
from orchestrator.diagnosis.report.estimates import value_covariance
from orchestrator.diagnosis.report.judgement import is_missed
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.errors import ScenarioError

CONFOUNDED = 0.95  # correlation from which two parameters count as not told apart
LEARNED = 0.3  # share of its uncertainty below which the records have said little of a parameter


@dataclass(frozen=True)
class FmuCalibration:
    """Parameters that explain records.

    Attributes:
        diagnosis: of the re-fitted model, no effect searched for.
        learned: name -> share of the granted uncertainty that the records have removed, 0 to 1.
        confounded: pairs that the records hardly tell apart.
        explained: free runs over test data miss no output by more than its noise, and what is left follows nothing.
        notes: sentences.
    """

    diagnosis: FmuDiagnosis
    learned: Mapping[str, float]
    confounded: tuple[tuple[str, str], ...]
    explained: bool
    notes: tuple[str, ...]


def calibrate_fmu(
    subject: Subject,
    given: Map,
    records: Sequence[Data],
    settings: DiagnosisSettings,
    progress: Callable[[str], None] = lambda what: None,
) -> FmuCalibration:
    """Return the parameters of an FMU, or of several, that explain records.

    Args:
        subject: the FMU, or several.
        given: the map.
        records: of one machine.
        settings: thresholds.
        progress: called with what is being done.

    Returns:
        The parameters with intervals, and how much they explain.

    Raises:
        ScenarioError: the map makes no parameter uncertain.
        FmuError: the FMU cannot be used.
        SlaveError: it does not run over a record.
    """
    if not given.uncertain:
        raise ScenarioError(f"{given.source}: $.parameters must give an uncertainty to at least one, but gives none")
    found = diagnose_fmu(subject, given, records, settings, search=False, progress=progress)
    problem, fitted = found.workings.search.problem, found.workings.search.final
    covariance = value_covariance(fitted)
    errors = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    names = [entry.name for entry in problem.shared]
    learned = {
        entry.name: float(np.clip(1.0 - errors[k] / np.log1p(entry.spread), 0.0, 1.0))
        for k, entry in enumerate(problem.shared)
    }
    correlation = covariance / errors / errors[:, None]
    pairs = tuple(
        (names[i], names[j]) for i in range(len(names)) for j in range(i) if abs(correlation[i, j]) > CONFOUNDED
    )
    notes = [*found.notes]
    notes += [
        f"the record hardly determines `{name}`: excite what it acts on"
        for name, share in learned.items()
        if share < LEARNED
    ]
    notes += [f"the record hardly distinguishes `{a}` and `{b}`: excite other frequencies" for a, b in pairs]
    explained = found.verdict != "unknown" and not any(is_missed(one) for test in found.test for one in test.signals)
    if not explained:
        notes.append("the parameters do not explain the record: `diagnose` looks for what is missing")
    return FmuCalibration(found, learned, pairs, explained, tuple(notes))
