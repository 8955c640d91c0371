"""Prediction-error fit of a set of parameters: Levenberg-Marquardt on whitened innovations with Gaussian priors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free, Slope, taken
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.shared.cores import spread
from orchestrator.shared.inference.colour import ORDERS, WHITE, Colour, colour_of
from orchestrator.shared.inference.damped_fit import Damping, Linearised, damped_fit
from orchestrator.shared.inference.inverse import pseudo_inverse
from orchestrator.shared.inference.normal import NORMAL_95

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """The outcome of a fit: parameters, process noise, innovations and the covariance of the free parameters."""

    p: Array
    q: float
    z: Array
    free: tuple[Free, ...]
    covariance: Array
    fitted: float  # log-likelihood of the part that was fitted, prior included
    validated: float  # log-likelihood of the part after it
    colour: Colour = WHITE  # of the innovations of the part that was fitted
    slope: Slope | None = None  # near it, while fits go on from here

    def rank(self, parts: "Parts") -> float:
        """Return what fits of one model are chosen by: the log-likelihood of all that it was fitted to or decides.

        A colour that learns the fitted part by heart, and parameters that are wrong beside it, fail on the other.

        Args:
            parts: of the record.

        Returns:
            The log-likelihood, prior included.
        """
        return self.fitted + self.validated if parts.apart else self.fitted

    def standard_error(self, place: int) -> float:
        """Return the standard error of one free parameter.

        Args:
            place: of the parameter in the predictor's tuple.

        Returns:
            The error, in the parameter's unit.
        """
        row = next(n for n, entry in enumerate(self.free) if entry.place == place)
        return float(np.sqrt(max(self.covariance[row, row], 0.0)))

    def interval(self, place: int) -> tuple[float, float]:
        """Return the 95 % interval of one free parameter, cut off at its bounds.

        Args:
            place: of the parameter in the predictor's tuple.

        Returns:
            Lower and upper end, in the parameter's unit.
        """
        entry = next(entry for entry in self.free if entry.place == place)
        reach = NORMAL_95 * self.standard_error(place)
        value = float(self.p[place])
        # Bounds come from the signals of a model before, and may have moved past the value since.
        return (min(max(value - reach, entry.minimum), value), max(min(value + reach, entry.maximum), value))


@dataclass(frozen=True)
class Parts:
    """The samples that are fitted, those that decide, and those that nothing has touched."""

    fitted: slice
    validated: slice
    held_out: slice

    @property
    def apart(self) -> bool:
        """Tell whether the deciding part was not fitted."""
        return self.validated.start >= self.fitted.stop or self.validated.stop <= self.fitted.start

    @property
    def seen(self) -> slice:
        """Return the samples that may be looked at: the fitted and the deciding ones, which are neighbours."""
        both = (self.fitted, self.validated)
        return slice(min(part.start for part in both), max(part.stop for part in both))


def split(sizes: Sequence[int], settings: DiagnosisSettings) -> tuple[Parts, list[tuple[int, int]]]:
    """Return the parts of records of ``sizes`` samples: fitted, deciding, held out, one after the other.

    Args:
        sizes: samples of each record.
        settings: of the diagnosis.

    Returns:
        the parts of the series of all records, and of each record where its deciding and its held-out part begin.
    """
    own, total, found = settings.fit, sum(sizes), []
    for size in sizes:
        most = int(own.most_fitted * size / total)
        a = min(int(size * own.fitted), most)
        found.append((a, min(int(size * own.looked_at), a + most // 2)))
    a, b = (sum(edges) for edges in zip(*found, strict=True))
    return Parts(slice(settings.likelihood.head, a), slice(a, b), slice(b, total)), found


def log_prior(p: Array, free: Sequence[Free]) -> float:
    """Return the logarithm of the prior density of the free parameters, up to a constant.

    Args:
        p: (parameters,) of the predictor.
        free: parameters to fit.

    Returns:
        The logarithm.
    """
    return -0.5 * sum(((p[f.place] - f.prior[0]) / f.prior[1]) ** 2 for f in free if f.prior is not None)


Point = tuple[Array, Array]  # parameters, innovations


@np.errstate(over="ignore", invalid="ignore")  # a step into instability is seen by its cost
def fit(
    likelihood: RecordLikelihood, start: Array, q: float, free: Sequence[Free], parts: Parts,
    iterations: int | None = None, most: int = ORDERS[-1], bar: float = -np.inf, known: Slope | None = None,
    exact: bool = True,
) -> Fit:  # fmt: skip
    """Maximise the likelihood of ``parts.fitted`` over the ``free`` parameters at process noise ``q``.

    Covariance and colour of the innovations are re-estimated at every iteration, so that the determinant of what an
    autoregression leaves of them is minimised. The derivative is taken anew where steps gain less than it foretells.

    Args:
        likelihood: of the record.
        start: all parameters; those that are not free stay.
        q: process noise.
        free: parameters to fit.
        parts: parts of the record.
        iterations: most Levenberg-Marquardt steps; None: as in the settings.
        most: largest order of the autoregression; 0: innovations count as white.
        bar: rank that the fit must reach: it is given up where steps as large as its last would not get there.
        known: derivative near ``start``; None: it is taken there.
        exact: the fit is to end where a derivative taken there foretells no gain; else where steps gain little.

    Returns:
        The fit.
    """
    settings, part = likelihood.settings.fit, parts.fitted
    enough = settings.enough if exact else settings.nearly
    scales = np.array([f.scale for f in free])
    seen: list[Fit] = []  # at every point of the descent
    rows, inner = reaching_back(part, ORDERS[-1])
    slope, held, foretold = known, known, 0.0

    def linearise(point: Point) -> Linearised[Point] | None:
        nonlocal slope, held
        p, z = point
        colour = colour_of(z, part, most)
        seen.append(_fit_at(likelihood, p, q, z, free, parts, colour))
        if not free or not colour.usable:
            return None
        residual = colour.white(z, part).ravel()
        slope = taken(likelihood, p, q, free, z, rows) if slope is None else slope.moved(p, z, free)
        held = near = slope
        J = colour.white(near.columns, inner).reshape(residual.size, len(free))
        pull = np.array([(p[f.place] - f.prior[0]) / f.prior[1] if f.prior else 0.0 for f in free])
        weight = np.array([f.scale / f.prior[1] if f.prior else 0.0 for f in free])
        hessian, gradient = J.T @ J + np.diag(weight**2), J.T @ residual + weight * pull
        if not np.all(np.isfinite(hessian)):  # the model runs away
            return None
        seen[-1] = replace(
            seen[-1], covariance=np.asarray(pseudo_inverse(hessian) * np.outer(scales, scales)), slope=near
        )

        def moved(step: Array) -> tuple[Point, float]:
            nonlocal foretold
            there = _moved(p, step * scales, free)
            done = np.array([there[f.place] - p[f.place] for f in free]) / scales
            foretold = float(-gradient @ done - 0.5 * done @ hessian @ done)
            z_there = likelihood.whitened(there, q)
            new = colour.white(z_there, part).ravel()
            return (there, z_there), float(0.5 * new @ new - log_prior(there, free))

        cost = 0.5 * residual @ residual - log_prior(p, free)
        return Linearised(hessian, gradient, float(cost), moved, near.taken)

    def converged(gain: float, cost: float) -> bool:
        nonlocal slope
        sure = (slope is not None and slope.taken) or (not exact and foretold < enough)
        risen = max(gain, seen[-1].rank(parts) - seen[-2].rank(parts)) if len(seen) > 1 else np.inf
        if seen[-1].rank(parts) + settings.iterations * risen < bar:
            return True
        if gain < enough or abs(gain - foretold) > settings.astray * foretold:
            slope = None
        return gain < enough and sure

    damping = Damping(settings.damping, settings.damping, lambda hessian: settings.ridge, settings.patience)
    first = np.array(start, dtype=float)
    (p, z), _ = damped_fit(
        (first, likelihood.whitened(first, q)), linearise, damping,
        settings.iterations if iterations is None else iterations, converged,
    )  # fmt: skip
    last = _fit_at(likelihood, p, q, z, free, parts, colour_of(z, part, most))
    last = replace(last, slope=held.moved(p, z, free) if held else None)
    seen.append(replace(last, covariance=seen[-1].covariance) if seen else last)
    return max(seen, key=lambda found: found.fitted)


@np.errstate(over="ignore", invalid="ignore")
def settled(likelihood: RecordLikelihood, start: Array, q: float, free: Sequence[Free], parts: Parts) -> Fit:
    """Return the best of three fits: from ``start``, where innovations counted as white lead, and from there.

    A model that is far off leaves slow innovations, whose autoregression hides what is slow in the signals, its
    own errors among it: such a fit stays where it is, or leaves the right values for wrong ones.

    Args:
        likelihood: of the record.
        start: (parameters,) to start from.
        q: process noise, as a share of the drive's rms torque.
        free: parameters to fit.
        parts: of the record: fitted, deciding, held out.

    Returns:
        The fit.
    """
    first = np.array(start, dtype=float)
    known = None
    if free:
        rows, _ = reaching_back(parts.fitted, ORDERS[-1])
        known = taken(likelihood, first, q, free, likelihood.whitened(first, q), rows)
    direct, white = spread(
        lambda most: fit(likelihood, first, q, free, parts, most=most, known=known, exact=False), (ORDERS[-1], 0)
    )
    if not np.all(np.isfinite(white.z)):
        return direct
    again = fit(likelihood, white.p, q, free, parts, known=white.slope, exact=False)
    colour = colour_of(white.z, parts.fitted)
    there = replace(_fit_at(likelihood, white.p, q, white.z, free, parts, colour), covariance=white.covariance)
    return max((direct, again, there), key=lambda found: found.rank(parts))


def _fit_at(
    likelihood: RecordLikelihood, p: Array, q: float, z: Array, free: Sequence[Free], parts: Parts, colour: Colour
) -> Fit:  # fmt: skip
    nothing: Array = np.zeros((len(free), len(free)))
    if not colour.usable:
        return Fit(p, q, z, tuple(free), nothing, -np.inf, -np.inf, colour)
    fitted = likelihood.log_likelihood(z, q, parts.fitted, colour, p) - colour.cost + log_prior(p, free)
    validated = likelihood.log_likelihood(z, q, parts.validated, colour, p)
    return Fit(p, q, z, tuple(free), nothing, fitted, validated, colour)


def reaching_back(part: slice, order: int) -> tuple[slice, slice]:
    """Return a part with the samples that an autoregression needs before it, and where the part lies in that.

    Args:
        part: the samples.
        order: of the autoregression.

    Returns:
        Both.
    """
    begin = max(part.start - order, 0)
    return slice(begin, part.stop), slice(part.start - begin, part.stop - begin)


def anneal(
    likelihood: RecordLikelihood, start: Array, q: float, free: Sequence[Free], parts: Parts, levels: Sequence[float],
    most: int = ORDERS[-1],
) -> Fit:  # fmt: skip
    """Fit at ``q``, then at other levels of process noise, and once more, to the end, at the best.

    Args:
        likelihood, start, free, parts: as in :func:`fit`.
        q: level to start from, one of ``levels``.
        levels: the ladder of process noise, falling.
        most: largest order of the autoregression of innovations; 0: they count as white.

    Returns:
        The fit.
    """
    first = settled(likelihood, start, q, free, parts) if most else fit(likelihood, start, q, free, parts, most=0)
    return followed(likelihood, first, parts, levels, most)


def followed(
    likelihood: RecordLikelihood, first: Fit, parts: Parts, levels: Sequence[float], most: int = ORDERS[-1]
) -> Fit:
    """Fit at other levels of process noise, in long strides and then in short ones, and to the end at the best.

    Long strides down go on where the likelihood of the fitted part falls: a colour that was estimated at a high level
    holds part of what a right model explains at a low one.

    Args:
        likelihood: of the record.
        first: fit at one of the levels.
        parts: of the record: fitted, deciding, held out.
        levels: the ladder of process noise, falling.
        most: largest order of the autoregression of innovations; 0: they count as white.

    Returns:
        The fit.
    """

    def at_level(fitted: Fit) -> Fit:
        return replace(fitted, validated=decided(likelihood, fitted, parts, levels)) if most and parts.apart else fitted

    at, best, free = list(levels).index(first.q), at_level(first), first.free
    known = {at}
    settings = likelihood.settings.fit
    for stride in settings.strides:
        for direction in (1, -1):
            patience = settings.passed_over if direction > 0 and stride == settings.strides[0] else 0
            place, misses = at, 0
            while misses <= patience and 0 <= place + direction * stride < len(levels):
                place += direction * stride
                if place in known:  # it was no better on the way here
                    misses += 1
                    continue
                known.add(place)
                rank, q = best.rank(parts), levels[place]
                tried = at_level(fit(likelihood, best.p, q, free, parts, most=most, bar=rank, exact=False))
                if tried.rank(parts) > rank:
                    best, at, misses = tried, place, 0
                else:
                    misses += 1
    if free:
        last = at_level(fit(likelihood, best.p, best.q, free, parts, most=most))
        best = max(best, last, key=lambda found: found.rank(parts))
    return replace(best, slope=None)


def decided(likelihood: RecordLikelihood, best: Fit, parts: Parts, levels: Sequence[float]) -> float:
    """Return the log-likelihood of the deciding part, its process noise raised as long as that helps.

    A model that is nearly right may deserve more process noise on a part that it was not fitted to.

    Args:
        likelihood: of the record.
        best: fit to the fitted part.
        parts: of the record: fitted, deciding, held out.
        levels: of process noise, falling.

    Returns:
        The log-likelihood.
    """
    value = best.validated
    for level in reversed(levels[: list(levels).index(best.q)]):
        z = likelihood.whitened(best.p, level)
        raised = likelihood.log_likelihood(z, level, parts.validated, colour_of(z, parts.fitted), best.p)
        if not raised > value:
            break
        value = raised
    return value


def _moved(p: Array, step: Array, free: Sequence[Free]) -> Array:
    moved = p.copy()
    for change, entry in zip(step, free, strict=True):
        moved[entry.place] = min(max(p[entry.place] + change, entry.minimum), entry.maximum)
    return moved
