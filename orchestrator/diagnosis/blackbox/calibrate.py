"""Parameters of any FMU from a record: values, intervals, and what the record does not determine."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.diagnosis.blackbox.diagnose import fitters, prepared
from orchestrator.diagnosis.blackbox.estimates import OutputMisfit, ValueEstimate, estimates_of, misfits
from orchestrator.diagnosis.blackbox.mapping import Map
from orchestrator.diagnosis.blackbox.model import Data
from orchestrator.diagnosis.blackbox.parts import parts_of
from orchestrator.diagnosis.blackbox.rest import Rest, rest_of
from orchestrator.diagnosis.blackbox.settings import DEFAULT, BoxSettings
from orchestrator.diagnosis.blackbox.subject import Subject
from orchestrator.errors import ScenarioError


@dataclass(frozen=True)
class BoxCalibration:
    """Parameters that explain a record.

    Attributes:
        parameters: re-fitted values with intervals.
        learned: name -> share of the granted uncertainty that the record has removed, 0 to 1.
        confounded: pairs that the record hardly tells apart.
        misfit: of each output; ``corrected`` is that of the calibrated model too.
        rest: what the calibrated model leaves.
        warnings: sentences.
        seconds: wall time.
    """

    parameters: tuple[ValueEstimate, ...]
    learned: dict[str, float]
    confounded: tuple[tuple[str, str], ...]
    misfit: tuple[OutputMisfit, ...]
    rest: Rest
    warnings: tuple[str, ...]
    seconds: float

    @property
    def explained(self) -> bool:
        """Whether nothing but noise, and at most a small disturbance, is left."""
        return self.rest.nothing_missing


def calibrate(
    subject: Subject,
    given: Map,
    data: Data,
    progress: Callable[[str], None] = lambda what: None,
    settings: BoxSettings = DEFAULT,
) -> BoxCalibration:
    """Return the parameters of an FMU, or of several, that explain ``data``; arguments as of ``diagnose``.

    Args:
        subject: the FMU, or several.
        given: the map.
        data: the record.
        progress: called with what is being done.
        settings: thresholds.

    Returns:
        The parameters with intervals, and how much they explain.

    Raises:
        ScenarioError: the map makes no parameter uncertain.
        FmuError: the FMU cannot be used.
        SlaveError: it does not run over the record.
    """
    if not given.uncertain:
        raise ScenarioError(f"{given.source}: $.parameters must give an uncertainty to at least one, but gives none")
    begun = time.monotonic()
    progress("probing")
    problem, probe = prepared(subject, given, data, settings=settings)
    try:
        with np.errstate(all="ignore"):
            parts = parts_of(problem.n)
            best = None
            for fitter in fitters(problem, parts, settings):
                progress("parameters")
                fit = fitter.grown(problem.nominal, 0)
                if fit is None:
                    raise problem.does_not_run()
                fit = fitter.settled(fit)
                if best is None or fit.total > best[1].total + settings.start.pays:
                    best = (fitter, fit)
            assert best is not None
            fitter, fit = best
            seen = slice(0, parts.seen)
            fit = fitter.fit(fit.model, fit.level, None, seen) or fit
            covariance = fitter.covariance(fit, seen)
            parameters, _ = estimates_of(problem, fit.model, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
            before, after = problem.must_simulate(problem.nominal), problem.must_simulate(fit.model)
            stages = (before, after, after)
            rest = rest_of(fitter, replace(fit, y=stages[1]), slice(0, problem.n))
            found = misfits(problem, stages, parts.held_out)
    finally:
        problem.runner.close()
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    learned = {e.name: float(max(0.0, 1.0 - sd[k] / fitter.sd[k])) for k, e in enumerate(parameters)}
    correlation = covariance / sd / sd[:, None]
    names = [e.name for e in parameters]
    pairs = tuple(
        (names[i], names[j])
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) > settings.calibration.confounded
    )
    warnings = [*probe.notes, *problem.runner.remarks]
    warnings += [
        f"`{n}` is hardly determined: excite what it acts on"
        for n, share in learned.items()
        if share < settings.calibration.learned
    ]
    warnings += [f"`{a}` and `{b}` are hardly told apart: excite them at other frequencies" for a, b in pairs]
    if not rest.nothing_missing:
        warnings.append("something else is missing: `diagnose` says what")
    seconds = time.monotonic() - begun
    return BoxCalibration(parameters, learned, pairs, found, rest, tuple(warnings), seconds)
