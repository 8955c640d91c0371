"""What the best model leaves: how much, and whether generic functions of the state would predict it on other data.

Three questions decide between "effects" and "unknown":

- how much of the likelihood that a model at the noise floor would have is still missing;
- do generic bases (speed, twist, twist memory, angle, input, at motor, shaft or load), fitted to the innovations of
  the fitted part, predict those of the deciding part;
- do the innovations stay as small on later parts as on the part that was fitted.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.diagnosis.fitting import Fit, Parts, jacobian
from orchestrator.diagnosis.likelihood import Likelihood
from orchestrator.diagnosis.plants import Plant
from orchestrator.diagnosis.screening import ErrorResponse, error_response

Array = NDArray[np.float64]

SITES = ("motor", "load", "shaft")
HARMONICS = 3
RIDGE = 1e-6


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
    """

    missing: float
    explained: float
    growth: float
    predictable: tuple[Predictable, ...]


def noise_floor(likelihood: Likelihood, parts: Parts, lowest: float) -> float:
    """Return the log-likelihood of both parts for innovations that are measurement noise and nothing else."""
    roots = likelihood.gains(lowest).roots[parts.seen]
    return float(np.sum(np.log(np.diagonal(roots, axis1=1, axis2=2))))


def remainder(
    likelihood: Likelihood, plant: Plant, base: Fit, best: Fit, parts: Parts, lowest: float
) -> Remainder:  # fmt: skip
    """Return what ``best`` leaves; ``likelihood`` runs over the parts that may be looked at."""
    floor = noise_floor(likelihood, parts, lowest)
    had = floor - base.fitted - base.validated
    left = floor - best.fitted - best.validated
    spread = np.std(best.z[parts.fitted], axis=0)
    later = np.std(best.z[parts.validated], axis=0)
    growth = float(np.max(later / np.maximum(spread, 1e-300)))
    found = predictable(likelihood, plant, best, parts)
    return Remainder(left, 1.0 - left / had if had > 0.0 else 0.0, growth, found)


def predictable(likelihood: Likelihood, plant: Plant, model: Fit, parts: Parts) -> tuple[Predictable, ...]:
    """Return what each kind of basis predicts on the deciding part, best first."""
    response = error_response(likelihood, plant, model)
    _, states = likelihood.innovations(model.p, model.q)
    looked = parts.seen
    stop = looked.stop
    e = model.z[parts.fitted]
    root = np.linalg.inv(np.linalg.cholesky(e.T @ e / len(e)))
    white = model.z[looked] @ root.T
    nuisance = np.einsum("ij,njk->nik", root, jacobian(likelihood, model.p, model.q, model.free, model.z, looked))
    cut = parts.validated.start - parts.fitted.start
    found = []
    for site, column in _sites(response):
        for kind, basis in _bases(likelihood, plant, states[:stop], site, model).items():
            columns = filtered(np.ascontiguousarray(basis), response.F, column, response.W)[looked]
            gain, share = _out_of_sample(white, np.concatenate([nuisance, columns], axis=2), nuisance, cut)
            found.append(Predictable(site, kind, gain, share))
    return tuple(sorted(found, key=lambda entry: entry.gain, reverse=True))


def _out_of_sample(white: Array, columns: Array, nuisance: Array, cut: int) -> tuple[float, float]:
    """Return gain and share on rows after ``cut`` of a regression on the rows before, over ``nuisance`` alone."""
    errors = []
    for design in (nuisance, columns):
        k = design.shape[2]
        left = design[:cut].reshape(cut * design.shape[1], k)
        scale = np.sqrt(np.mean(left**2, axis=0)) + 1e-300
        left = left / scale
        H = left.T @ left
        coefficients = np.linalg.solve(H + RIDGE * np.trace(H) * np.eye(k) / k, left.T @ white[:cut].reshape(-1))
        after = white[cut:].reshape(-1) - (design[cut:].reshape(white[cut:].size, k) / scale) @ coefficients
        errors.append(float(after @ after))
    before, after_all = errors
    n = white[cut:].size
    return 0.5 * n * float(np.log(before / after_all)), 1.0 - after_all / before


def _sites(response: ErrorResponse) -> list[tuple[str, Array]]:
    """Return each site and the column of the error response for a torque there."""
    sites = [("motor", response.B[:, 0])]
    if response.B.shape[1] > 2:
        sites += [("load", response.B[:, 2]), ("shaft", response.B[:, 1])]
    return [(name, np.ascontiguousarray(column)) for name, column in sites]


@njit(cache=True)
def filtered(basis: Array, F: Array, column: Array, W: Array) -> Array:
    """Return (n, channels, k): the whitened innovations that a torque along each basis function would cause."""
    n, k = basis.shape
    out = np.zeros((n, W.shape[0], k))
    xi = np.zeros((F.shape[0], k))
    for t in range(n):
        out[t] = -W @ xi
        xi = F @ xi
        for j in range(k):
            for i in range(F.shape[0]):
                xi[i, j] += column[i] * basis[t, j]
    return out


def _bases(likelihood: Likelihood, plant: Plant, x: Array, site: str, model: Fit) -> dict[str, Array]:
    """Return the bases of a site by kind, each (n, k), of order one."""
    torque = x[:, 4] / max(float(np.std(x[:, 4])), 1e-12) if "tau" in plant.names else np.zeros(len(x))
    u = likelihood.signals.u[: len(x)] / max(float(np.std(likelihood.signals.u)), 1e-12)
    single = "k" not in plant.names
    ratio = 1.0 if single else float(model.p[plant.index("i")])
    twist = x[:, 0] / ratio - x[:, 2]
    speed = x[:, 1] if site == "motor" else x[:, 3] if site == "load" else x[:, 1] / ratio - x[:, 3]
    angle = x[:, 0] if site == "motor" else x[:, 2] if site == "load" else x[:, 0]
    drive = u if single and float(model.p[plant.index("tau")]) == 0.0 else torque
    acceleration = np.gradient(speed)
    bases = {
        "speed": _hats(speed),
        "angle": _harmonics(angle, [np.ones_like(angle), _unit(acceleration), _unit(speed) ** 2]),
        "input": np.column_stack([np.sign(drive), drive * np.abs(drive), drive**3, np.abs(drive)]),
    }
    if not single:
        bases["twist"] = np.column_stack([_hats(twist), _unit(twist) * _unit(np.abs(x[:, 3]))])
        bases["twist memory"] = np.column_stack([_plays(twist), _unit(speed)])
    if single:
        bases["memory of position"] = _plays(x[:, 0])
    return bases


def _unit(values: Array) -> Array:
    return np.asarray(values / max(float(np.std(values)), 1e-300))


def _hats(values: Array, count: int = 9) -> Array:
    """Return hat functions between quantiles of ``values``, and the sign."""
    knots = np.unique(np.quantile(values, np.linspace(0.002, 0.998, count)))
    columns = [np.interp(values, knots, np.eye(len(knots))[n]) for n in range(len(knots))]
    return np.column_stack([*columns, np.sign(values)])


def _harmonics(angle: Array, factors: list[Array]) -> Array:
    columns = []
    for n in range(1, HARMONICS + 1):
        for factor in factors:
            columns += [np.sin(n * angle) * factor, np.cos(n * angle) * factor]
    return np.column_stack(columns)


def _plays(values: Array, count: int = 5) -> Array:
    """Return play operators (Prandtl-Ishlinskii) of several widths: a basis for anything that remembers."""
    reach = float(np.quantile(np.abs(values), 0.99)) or 1.0
    widths = reach * np.geomspace(0.05, 0.9, count)
    return np.column_stack([play(values, float(width)) / reach for width in widths])


@njit(cache=True)
def play(values: Array, width: float) -> Array:
    """Return the play (backlash) operator of half-width ``width`` applied to ``values``."""
    out = np.empty(values.size)
    state = values[0]
    for n in range(values.size):
        state = min(max(state, values[n] - width), values[n] + width)
        out[n] = state
    return out


def strongest(found: tuple[Predictable, ...], judge: Callable[[Predictable], bool]) -> Predictable | None:
    """Return the first entry that satisfies ``judge``."""
    return next((entry for entry in found if judge(entry)), None)
