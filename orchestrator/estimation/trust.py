"""How far an estimate of the half-gap can be trusted.

The maximum-likelihood fit checks itself: whether it explains the record, whether the values that it needs are those the
user allows, whether the gap was traversed. The other methods have no such check; they are held against that fit.
"""

import math
from collections.abc import Iterator, Mapping, Sequence

from orchestrator.estimation.problem import ALPHA
from orchestrator.estimation.protocol import FITTED, Estimate
from orchestrator.estimation.settings import EstimationSettings, TrustSettings
from orchestrator.estimation.stages.location import BOTH, FIRST, SECOND, Location
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.inference.normal import NORMAL_95
from orchestrator.shared.trust import Level, Reason, Trust, trust_of

STOPPED = "the fit stopped before it converged, and may be off: state values nearer to the machine, or record longer"
MORE = "record more reversals of the torque"


def trust_of_estimates(
    estimates: Sequence[Estimate], model: Model, settings: TrustSettings | None = None
) -> dict[str, Trust]:
    """Return how far each estimate of one record can be trusted."""
    chosen = settings or TrustSettings()
    fit = next((e for e in estimates if e.method == FITTED), None)
    own = trust_of(_of_fit(fit, model, chosen)) if fit is not None else None
    found: dict[str, Trust] = {}
    for estimate in estimates:
        if estimate.method == FITTED and own is not None:
            found[estimate.method] = own
        elif estimate.method == "two_encoders" and own is None:
            found[estimate.method] = trust_of([Reason(Level.AMBER, estimate.message)])  # what it cannot see, it says
        else:
            found[estimate.method] = trust_of(_compare_methods(estimate, fit, own))
    return found


def trust_of_location(location: Location, record: Record, model: Model, settings: EstimationSettings) -> Trust:
    """Return how far the place of a gap can be trusted; an answer that is a set is honest, and no reason for doubt."""

    def reasons() -> Iterator[Reason]:
        if not location.converged:
            yield Reason(Level.AMBER, STOPPED)
        if not location.explained:
            yield Reason(
                Level.AMBER,
                "the model does not explain the record: the torque noise or the size of the best fit is too large",
            )
        if location.answers and location.traversals < settings.trust.least_traversals:
            yield Reason(Level.AMBER, _rarely(location.traversals))
        sizes = [("both half-gaps together", location.total)] if location.answers else []
        for stage, gap in zip((FIRST, SECOND), location.stages, strict=True):
            if location.answers in ((stage,), (BOTH,)):
                sizes.append((f"the half-gap of stage {stage}", gap))
        for name, gap in sizes:
            low, high = gap.interval
            if high - low > 2.0 * NORMAL_95 * settings.trust.widest * gap.alpha:
                yield Reason(Level.AMBER, f"{name} may be anything from {low:.2g} to {high:.2g} rad")
        if record.u_sampled is not None:
            yield Reason(Level.AMBER, "the torque has rows of its own and was taken as held between them")
        if record.u_deviation is not None:
            yield Reason(Level.AMBER, "samples of the torque are missing and were interpolated")
        chance = settings.verdict.chance_autocorrelation / math.sqrt(record.size)
        worst = max(abs(value) for value in location.autocorrelation)
        if worst > max(settings.verdict.notable_autocorrelation, chance):
            yield Reason(
                Level.AMBER,
                f"the model does not explain the record (autocorrelation {worst:.2f} of the one-step errors)",
            )
        yield from _of_values(location.parameters, model, settings.trust)

    return trust_of(reasons())


def _of_fit(fit: Estimate, model: Model, settings: TrustSettings) -> Iterator[Reason]:
    """Yield what keeps the fit from green."""
    lacking = fit.diagnostics.get("lacking")
    if lacking:
        yield Reason(Level.AMBER, str(lacking))
    if "stopped" in fit.diagnostics:
        yield Reason(Level.AMBER, str(fit.diagnostics["stopped"]))
    elif not fit.diagnostics.get("converged", True):
        yield Reason(Level.AMBER, STOPPED)
    if not math.isfinite(fit.interval[1]):
        text = (
            "the interval of the half-gap has no upper end"
            if fit.visible
            else "the record cannot show a gap of any size"
        )
        yield Reason(Level.AMBER, f"{text}: {MORE}")
    elif fit.visible:
        traversals = int(fit.diagnostics.get("traversals", settings.least_traversals))
        if traversals < settings.least_traversals:
            yield Reason(Level.AMBER, _rarely(traversals))
        if fit.standard_error > settings.widest * fit.alpha:
            yield Reason(Level.AMBER, f"the standard error is more than a fifth of the half-gap: {MORE}")
    yield from _of_values(fit.diagnostics.get("parameters", {}), model, settings, fit)


def _of_values(
    parameters: Mapping[str, Mapping[str, float]], model: Model, settings: TrustSettings, fit: Estimate | None = None
) -> Iterator[Reason]:
    """Yield each fitted value outside what the model file allows on which the half-gap of ``fit`` hangs."""
    for name, entry in parameters.items():
        stated = model.parameters.get(name)
        if stated is None or stated.uncertainty <= 0.0 or stated.assumed:
            continue
        off = abs(entry["value"] - stated.value)
        if off <= stated.uncertainty + settings.beyond * entry["standard_error"]:
            continue
        if fit is not None and not _moves_gap(fit, name, off - stated.uncertainty):
            continue
        level = Level.RED if off > settings.far_beyond * stated.uncertainty else Level.AMBER
        text = f"`{name}` is fitted as {entry['value']:.4g}, but stated as {stated.value:.4g} to within"
        why = "the half-gap hangs on it, and something may be missing that it stands for; check its value and its unit"
        yield Reason(level, f"{text} {stated.uncertainty:.2g}: {why}")


def _moves_gap(fit: Estimate, name: str, move: float) -> bool:
    """Return whether the half-gap leaves its interval where a value moves, and all others follow as the record says."""
    names = list(fit.diagnostics["parameters"])
    if not fit.visible or ALPHA not in names or "covariance" not in fit.curves:
        return True
    own, gap = names.index(name), names.index(ALPHA)
    slope = fit.curves["covariance"][gap, own] / fit.curves["covariance"][own, own]
    return bool(abs(slope * move) > 0.5 * (fit.interval[1] - fit.interval[0]))


def _compare_methods(estimate: Estimate, fit: Estimate | None, fit_trust: Trust | None) -> Iterator[Reason]:
    """Yield what keeps a method that does not check itself from green."""
    if estimate.message:
        yield Reason(Level.AMBER, estimate.message)
    if fit is None or fit_trust is None:
        yield Reason(
            Level.AMBER,
            f"{estimate.method} does not check whether the model explains the record, and its interval holds scatter "
            f"alone: run {FITTED} too",
        )
        return
    low, high = estimate.interval
    if not low <= fit.alpha <= high:
        yield Reason(Level.RED, f"its interval does not hold the half-gap of {FITTED}, {fit.alpha:.5g} rad")
    yield Reason(fit_trust.level, f"{FITTED} beside it is {fit_trust.level.word}")


def _rarely(count: int) -> str:
    times = "once" if count == 1 else f"{count} times"
    return f"the gap is traversed only {times}, and a disturbance may pass for it: {MORE}"
