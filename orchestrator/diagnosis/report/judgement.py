"""The verdict of a diagnosis and how far its corrected model can be trusted, with the sentences that say why."""

from collections.abc import Sequence

import numpy as np

from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.result import GradedEffect, ParameterEstimate, SignalMisfit, TestMisfit
from orchestrator.diagnosis.selection.outcome import Dependence, Grade, RecordEvidence, SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.effects.words import list_effects, number_words
from orchestrator.records.model_file import ModelParameter
from orchestrator.shared.trust import Level, Reason, Trust, trust_of

RECORD_AGAIN = "record the same torque twice: what comes again is the machine"
UNEXPLAINED = 0.1  # of the torque's power, a third of it in rms: a model that leaves more does not explain a record


def form_verdict(
    search: SearchResult, effects: Sequence[GradedEffect], dependences: Sequence[Dependence], record: RecordEvidence,
    test: Sequence[TestMisfit], settings: DiagnosisSettings,
) -> str:  # fmt: skip
    """Return the verdict. ``test``: misfits on test data, with how far the values' uncertainty lets free runs drift.

    A possible effect is a hint, as a curve is: either tells that something is missing by what it surely takes of
    what is left.
    """
    if any(effect.grade >= Grade.LIKELY for effect in effects):
        return "effects"
    takes = [(one.t, one.gain) for one in (effect.evidence for effect in effects)]
    takes += [(one.t, one.gain) for one in (curve.comparison for curve in dependences)]
    strong = any(t >= settings.grades.likely_t and gain >= settings.grades.likely_gain for t, gain in takes)
    missed = any(signal.tells for one in test for signal in one.signals)
    if strong or missed or not search.complete or record.left > UNEXPLAINED:
        return "unknown"
    return "none" if _nominal_explains(search) else "parameters"


def _nominal_explains(search: SearchResult) -> bool:
    """Tell whether the nominal model explains the record as well as re-fitted parameters do: by three for each of them.

    What a record begins with is no property of the model, and stays as it was fitted.
    """
    problem, count = search.problem, len(search.problem.shared)
    start = ModelPoint((*problem.start.parameters[:count], *search.final.point.parameters[count:]))
    (nominal,) = problem.whiten_residuals([start])
    return float(nominal @ nominal) - search.final.cost < 3.0 * count


def judge_trust(
    verdict: str, effects: Sequence[GradedEffect], searched: bool, record: RecordEvidence, test: Sequence[TestMisfit],
    parameters: dict[str, ParameterEstimate], uncertain: Sequence[ModelParameter], settings: DiagnosisSettings,
) -> Trust:  # fmt: skip
    """Return how far the corrected model can be trusted."""
    red, amber = [], []
    if verdict == "unknown":
        why = "no effect of the library is likely" if searched else "no search was done"
        red.append(f"the model lacks something, and {why}: do not predict with it; {RECORD_AGAIN}")
    if record.inertia_is_off(settings.selection.prior_deviations):
        asked = f"{record.inertia:.2g}" if record.shows_inertia else f"at most {record.highest_inertia:.2g}"
        red.append(
            f"without the ranges of the model file, the record fits {asked} times its inertia: check the "
            "inertias, the units and the scale of the torque, of which every size is a multiple"
        )
    for one in test:
        if one.still:
            amber.append(
                f"nothing moves in the last {one.rows} rows of {one.source}, which are its test part: the test says "
                "nothing; judge the model on another record"
            )
            continue
        if one.is_worse(settings):
            red.append(
                f"the final model predicts the test part of {one.source} worse than re-fitted parameters do: its "
                "effects may stand for others; judge it on another record"
            )
        for signal in one.signals:
            if signal.tells:
                amber.append(
                    f"free runs on the test part of {one.source} miss {signal.signal} by "
                    f"{number_words(signal.miss)} times its noise{_of_motion(signal)}: a disturbance or a missing "
                    f"effect; {RECORD_AGAIN}"
                )
    if likely := [effect.label for effect in effects if effect.grade is Grade.LIKELY]:
        amber.append(
            f"likely, not certain: {list_effects(likely)}: another effect may stand there; make the record that is "
            "advised"
        )
    if record.left > UNEXPLAINED:
        left = number_words(100.0 * float(np.sqrt(record.left)), 2)
        amber.append(
            f"{left} % (rms) of the torque remains unexplained in the fitted data, {100.0 * record.noise:.0f} % of its "
            f"power like noise: predictions miss the rest; {RECORD_AGAIN}"
        )
    for known in uncertain:
        if not known.assumed and known.name in parameters and _is_far(parameters[known.name], known.uncertainty):
            amber.append(
                f"`{known.name}` lies outside the range that the model file states, and may stand for a missing "
                "effect: check its value and its unit"
            )
    return trust_of([*(Reason(Level.RED, text) for text in red), *(Reason(Level.AMBER, text) for text in amber)])


def _of_motion(signal: SignalMisfit) -> str:
    """Return a misfit as a share of the motion, in words; nothing where that is not known."""
    share = 1.0 - signal.r_squared
    return f", {number_words(100.0 * np.sqrt(max(share, 0.0)), 2)} % of its motion (rms)" if np.isfinite(share) else ""


def _is_far(estimate: ParameterEstimate, uncertainty: float) -> bool:
    """Tell whether a parameter is twice its stated share off, up or down: a tenth is as far as ten times."""
    low, high = estimate.interval
    nearest = float(np.clip(estimate.nominal, low, high))
    if nearest * estimate.nominal <= 0.0:
        return abs(nearest - estimate.nominal) > 2.0 * uncertainty
    return abs(np.log(nearest / estimate.nominal)) > 2.0 * np.log1p(uncertainty / abs(estimate.nominal))
