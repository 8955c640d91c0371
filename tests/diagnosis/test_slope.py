"""Derivatives that are kept up from step to step, and fits that end where those that are taken anew do."""

from dataclasses import replace

import msgspec
import numpy as np

from orchestrator.diagnosis.fit.fitting import Parts, fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free, taken
from tests.support.short_records import AXIS, axis_likelihood

Q = 1e-3
PARTS = Parts(slice(10, 160), slice(160, 240), slice(0, 0))


def free_of(likelihood: RecordLikelihood) -> tuple[Free, ...]:
    values = {name: AXIS.value(likelihood.nominal, name) for name in ("J", "b")}
    return tuple(Free(AXIS.index(n), 0.3 * v, 1e-3, 1e6, (v, 0.3 * v)) for n, v in values.items())


def test_what_a_step_has_shown_is_kept() -> None:
    likelihood, p = axis_likelihood(J=1.3, b=1.5)
    free, rows = free_of(likelihood), slice(5, 160)
    z, there = (likelihood.whitened(at, Q) for at in (likelihood.nominal, p))
    slope = taken(likelihood, likelihood.nominal, Q, free, z, rows)
    assert slope.moved(likelihood.nominal, z, free) is slope
    kept = slope.moved(p, there, free)
    step = np.array([(p[f.place] - likelihood.nominal[f.place]) / f.scale for f in free])
    assert slope.taken
    assert not kept.taken
    assert np.allclose(kept.columns @ step, there[rows] - z[rows], atol=1e-9 * np.abs(there).max())
    across = np.array([-step[1], step[0]])
    assert np.allclose(kept.columns @ across, slope.columns @ across, atol=1e-9 * np.abs(slope.columns).max())


def test_a_fit_with_derivatives_kept_up_ends_where_others_do(monkeypatch) -> None:
    likelihood, _ = axis_likelihood(J=1.3, b=1.5)
    free, runs = free_of(likelihood), []
    innovations = RecordLikelihood.innovations

    def counted(self, p, q):  # type: ignore[no-untyped-def]
        runs.append(q)
        return innovations(self, p, q)

    monkeypatch.setattr(RecordLikelihood, "innovations", counted)
    found = fit(likelihood, likelihood.nominal, Q, free, PARTS)
    few = len(runs)
    runs.clear()
    settings = likelihood.settings
    anew = replace(likelihood, settings=replace_fit(settings, astray=0.0))
    other = fit(anew, likelihood.nominal, Q, free, PARTS)
    assert abs(found.fitted - other.fitted) < settings.fit.enough
    assert np.all(np.abs(found.p - other.p) <= 0.1 * np.sqrt(other.covariance.max()))
    assert few < len(runs)


def replace_fit(settings, **changes):  # type: ignore[no-untyped-def]
    return msgspec.structs.replace(settings, fit=msgspec.structs.replace(settings.fit, **changes))


def test_a_fit_ends_where_products_of_derivatives_are_beyond_numbers(monkeypatch) -> None:
    """Derivatives are numbers, their products are infinite: a decomposition of those need not end."""
    likelihood, _ = axis_likelihood(J=1.3, b=1.5)
    free = free_of(likelihood)

    def steep(*args):  # type: ignore[no-untyped-def]
        slope = taken(*args)
        return replace(slope, columns=1e200 * slope.columns)

    monkeypatch.setattr("orchestrator.diagnosis.fit.fitting.taken", steep)
    found = fit(likelihood, likelihood.nominal, Q, free, PARTS)
    assert np.array_equal(found.p, likelihood.nominal)
    assert np.isfinite(found.fitted)
