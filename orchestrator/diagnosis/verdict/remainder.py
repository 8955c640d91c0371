"""What the best model leaves: how much, and whether generic functions of the state would predict it on other data.

Three questions decide between "effects" and "unknown":

- how much of the likelihood that a model at the noise floor would have is still missing;
- do generic bases (speed, twist, twist memory, angle, input, at motor, shaft or load), fitted to the innovations of
  the fitted part, predict those of the deciding part;
- do the innovations stay as small on later parts as on the part that was fitted.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts, reaching_back
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.response import back_propagated, error_response, filtered
from orchestrator.diagnosis.fit.slope import taken
from orchestrator.diagnosis.settings import RemainderSettings, VerdictSettings
from orchestrator.shared.inference.colour import Colour, colour_of
from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Predictable:
    """A kind of basis at a site, and what it predicts of the innovations that it has not seen.

    ``gain`` is in log-likelihood on the deciding part, ``share`` of the innovations' energy there.
    """

    site: str
    kind: str
    gain: float
    share: float


@dataclass(frozen=True)
class Remainder:
    """What the best model leaves.

    Attributes:
        missing: log-likelihood of a model at the noise floor minus that of the best model, fitted and deciding part.
        explained: share of what the model with re-fitted parameters was missing that the effects have recovered.
        growth: rms of the innovations on the later parts over that on the fitted part, largest channel.
        predictable: kinds of bases, best first.
        tails: largest excess kurtosis of innovations and missing torques; 0 for a normal distribution.
    """

    missing: float
    explained: float
    growth: float
    predictable: tuple[Predictable, ...]
    tails: float = 0.0


def noise_floor(likelihood: RecordLikelihood, parts: Parts, lowest: float, p: Array) -> float:
    """Return the log-likelihood of both parts for innovations of a model ``p`` that are measurement noise alone.

    Args:
        likelihood: of the record.
        parts: of the record: fitted, deciding, held out.
        lowest: least level of process noise.
        p: (parameters,) of the predictor.

    Returns:
        The log-likelihood.
    """
    roots = likelihood.gains(lowest, p).roots[parts.seen]
    return float(np.sum(np.log(np.diagonal(roots, axis1=1, axis2=2))))


def remainder(likelihood: RecordLikelihood, base: Fit, best: Fit, parts: Parts, lowest: float) -> Remainder:
    """Return what ``best`` leaves; ``likelihood`` runs over the parts that may be looked at.

    Args:
        likelihood: of the record.
        base: fit of the model without effects.
        best: fit of the final model.
        parts: of the record: fitted, deciding, held out.
        lowest: least level of process noise.

    Returns:
        Log-likelihood that is lacking, its share, growth, and what can be predicted of it.
    """
    floor = noise_floor(likelihood, parts, lowest, best.p)
    had = floor - base.fitted - base.validated
    left = floor - best.fitted - best.validated
    spread = np.std(best.z[parts.fitted], axis=0)
    later = np.std(best.z[parts.validated], axis=0)
    growth = float(np.max(later / np.maximum(spread, 1e-300)))
    found = predictable(likelihood, best, parts)
    return Remainder(left, 1.0 - left / had if had > 0.0 else 0.0, growth, found, tails(likelihood, best, parts.seen))


def structured(left: Remainder, settings: VerdictSettings) -> bool:
    """Tell whether what is left is something else than a coloured torque noise.

    Args:
        left: what the final model leaves.
        settings: the rules' thresholds.

    Returns:
        True when it is.
    """
    return left.tails > settings.heavy or repeats(left, settings)


def repeats(left: Remainder, settings: VerdictSettings) -> bool:
    """Tell whether what is left repeats with a signal of the record.

    Args:
        left: what the final model leaves.
        settings: the rules' thresholds.

    Returns:
        True when it does.
    """
    return any(
        entry.gain > settings.structured or (entry.share > settings.large_share and entry.gain > settings.likely)
        for entry in left.predictable
    )


def is_noise(likelihood: RecordLikelihood, model: Fit, parts: Parts) -> bool:
    """Tell whether a model leaves nothing but noise, white or coloured, on the parts that may be looked at.

    Args:
        likelihood: of the record.
        model: the fit.
        parts: of the record: fitted, deciding, held out.

    Returns:
        True when it does.
    """
    settings = likelihood.settings.verdict
    growth = float(np.max(np.std(model.z[parts.validated], axis=0) / np.std(model.z[parts.fitted], axis=0)))
    left = Remainder(0.0, 0.0, growth, predictable(likelihood, model, parts), tails(likelihood, model, parts.seen))
    return growth < settings.grown and not structured(left, settings)


def tails(likelihood: RecordLikelihood, model: Fit, part: slice) -> float:
    """Return the largest excess kurtosis of what is left: of whitened innovations, and of the torque at each site.

    Args:
        likelihood: of the record.
        model: the fit.
        part: the samples.

    Returns:
        The excess kurtosis; 0.0 for a normal distribution.
    """
    raw, _ = likelihood.innovations(model.p, model.q)
    effort = back_propagated(error_response(likelihood, model), raw[:, : likelihood.signals.channels])
    columns = np.concatenate([model.colour.white(model.z, part), effort[part]], axis=1)
    columns = columns - columns.mean(axis=0)
    size = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-150)  # 1e-300 squared would be none
    return float(np.max(np.mean((columns / size) ** 4, axis=0))) - 3.0


def predictable(likelihood: RecordLikelihood, model: Fit, parts: Parts) -> tuple[Predictable, ...]:
    """Return what each kind of basis predicts on the deciding part, best first.

    An autoregression hides what is slow in the signals: bases are tried on innovations that count as white too.

    Args:
        likelihood: of the record.
        model: the fit.
        parts: of the record: fitted, deciding, held out.

    Returns:
        The gains.
    """
    found: dict[tuple[str, str], Predictable] = {}
    white = colour_of(model.z, parts.fitted, 0)
    for colour in [model.colour] if model.colour.order == 0 else [model.colour, white]:
        for entry in _predicted(likelihood, model, parts, colour):
            other = found.get((entry.site, entry.kind))
            if other is None or entry.gain > other.gain:
                found[entry.site, entry.kind] = entry
    return tuple(sorted(found.values(), key=lambda entry: entry.gain, reverse=True))


def _predicted(likelihood: RecordLikelihood, model: Fit, parts: Parts, colour: Colour) -> Iterator[Predictable]:
    response, settings = error_response(likelihood, model), likelihood.settings.verdict.remainder
    _, states = likelihood.innovations(model.p, model.q)
    looked = parts.seen
    white = colour.white(model.z, looked)
    wide, inner = reaching_back(looked, colour.order)
    nuisance = colour.white(taken(likelihood, model.p, model.q, model.free, model.z, wide).columns, inner)
    cut = parts.validated.start - parts.fitted.start
    sites = likelihood.plant.sites
    for site in sorted(sites, key=lambda name: name == "shaft"):  # the shaft's bases are tried last
        column = np.ascontiguousarray(response.B[:, sites.index(site)])
        for kind, basis in _bases(likelihood, states[: looked.stop], site, model).items():
            columns = colour.white(filtered(np.ascontiguousarray(basis), response.F, column, response.W), looked)
            gain, share = _out_of_sample(white, np.concatenate([nuisance, columns], axis=2), nuisance, cut, settings)
            yield Predictable(site, kind, gain, share)


def _out_of_sample(
    white: Array, columns: Array, nuisance: Array, cut: int, settings: RemainderSettings
) -> tuple[float, float]:
    """Return gain and share on rows after ``cut`` of a regression on the rows before, over ``nuisance`` alone.

    The gain is no larger than the mean over blocks against its scatter from block to block allows.
    """
    errors = []
    for design in (nuisance, columns):
        k = design.shape[2]
        left = design[:cut].reshape(cut * design.shape[1], k)
        scale = np.sqrt(np.mean(left**2, axis=0)) + 1e-300
        left = left / scale
        H = left.T @ left
        damped = H + settings.ridge * np.trace(H) * np.eye(k) / max(k, 1)
        coefficients = np.linalg.solve(damped, left.T @ white[:cut].reshape(-1))
        after = white[cut:].reshape(-1) - (design[cut:].reshape(white[cut:].size, k) / scale) @ coefficients
        errors.append(np.sum(after.reshape(white[cut:].shape) ** 2, axis=1))
    before, after_all = float(errors[0].sum()), float(errors[1].sum())
    gain = 0.5 * white[cut:].size * float(np.log(before / after_all))
    blocks = np.array([block.mean() for block in np.array_split(errors[0] - errors[1], settings.blocks)])
    scatter = float(np.std(blocks, ddof=1)) / settings.blocks**0.5
    certain = 0.5 * (float(blocks.mean()) / max(scatter, 1e-300)) ** 2
    return min(gain, certain) if gain > 0.0 else gain, 1.0 - after_all / before


def _bases(likelihood: RecordLikelihood, x: Array, site: str, model: Fit) -> dict[str, Array]:
    """Return the bases of a site by kind, each (n, k), of order one."""
    plant, settings = likelihood.plant, likelihood.settings.verdict.remainder
    body = plant.body(site)
    delivered = x[:, plant.drive.torque]
    torque = delivered / max(float(np.std(delivered)), 1e-12)
    u = likelihood.signals.u[: len(x)] / max(float(np.std(likelihood.signals.u)), 1e-12)
    speed = plant.twist_rate(model.p, x) if site == "shaft" else x[:, body.speed]
    angle = x[:, body.angle]
    # A single body without a lag has no torque state.
    drive = u if plant.shaft is None and plant.value(model.p, plant.drive.lag) == 0.0 else torque
    acceleration = np.gradient(speed)
    factors = [np.ones_like(angle), _unit(acceleration), _unit(speed) ** 2]
    bases = {
        "speed": _hats(speed, settings),
        "angle": _harmonics(angle, factors, settings.harmonics),
        "input": np.column_stack([np.sign(drive), drive * np.abs(drive), drive**3, np.abs(drive)]),
    }
    if plant.shaft is None:
        return bases | {"memory of position": _plays(angle, settings)}
    twist, driven = plant.twist(model.p, x), x[:, plant.bodies[-1].speed]
    bases["twist"] = np.column_stack([_hats(twist, settings), _unit(twist) * _unit(np.abs(driven))])
    bases["twist memory"] = np.column_stack([_plays(twist, settings), _unit(speed)])
    return bases


def _unit(values: Array) -> Array:
    return np.asarray(values / max(float(np.std(values)), 1e-300))


def _hats(values: Array, settings: RemainderSettings) -> Array:
    """Return hat functions between quantiles of ``values``, and the sign."""
    shares = np.linspace(settings.hat_edge, 1.0 - settings.hat_edge, settings.hats)
    knots = np.unique(np.quantile(values, shares))
    columns = [np.interp(values, knots, np.eye(len(knots))[n]) for n in range(len(knots))]
    return np.column_stack([*columns, np.sign(values)])


def _harmonics(angle: Array, factors: list[Array], count: int) -> Array:
    columns = []
    for n in range(1, count + 1):
        for factor in factors:
            columns += [np.sin(n * angle) * factor, np.cos(n * angle) * factor]
    return np.column_stack(columns)


def _plays(values: Array, settings: RemainderSettings) -> Array:
    """Return play operators (Prandtl-Ishlinskii) of several widths: a basis for anything that remembers."""
    reach = float(np.quantile(np.abs(values), settings.play_reach)) or 1.0
    widths = reach * np.geomspace(settings.least_play, settings.largest_play, settings.plays)
    return np.column_stack([play(values, float(width)) / reach for width in widths])


@kept(nogil=True)
def play(values: Array, width: float) -> Array:
    """Return the play (backlash) operator of half-width ``width`` applied to ``values``.

    Args:
        values: (n,) of a position.
        width: in the same unit.

    Returns:
        Shape (n,).
    """
    out = np.empty(values.size)
    state = values[0]
    for n in range(values.size):
        state = min(max(state, values[n] - width), values[n] + width)
        out[n] = state
    return out
