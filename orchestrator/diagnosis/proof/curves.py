"""The curve of a learned law: its knots, its values between them, and the short formula that is enough."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.plants.learned import AWAY, EDGE, JUMP, KNOTS
from orchestrator.shared.inference.inverse import pseudo_inverse

Array = NDArray[np.float64]


def knots_of(values: Array, jump: bool = False) -> Array | None:
    """Return the knots of a law: half-way between even steps and even shares of the values.

    Args:
        values: (n,) that the argument takes.
        jump: the law may jump where the values change sign: two of the knots lie close together there.

    Returns:
        Knots, rising; None: the values have no range, or run away.
    """
    if not np.all(np.isfinite(values)):
        return None
    low, high = np.quantile(values, [EDGE, 1.0 - EDGE])
    jump = jump and low < 0.0 < high
    count = KNOTS - 2 if jump else KNOTS
    shares = np.quantile(values, np.linspace(EDGE, 1.0 - EDGE, count))
    knots = 0.5 * (shares + np.linspace(shares[0], shares[-1], count))
    if jump:
        close = JUMP * (high - low)
        away = np.where(np.abs(knots) < 2.0 * close, np.where(knots < 0.0, -AWAY, AWAY) * close, knots)
        knots = np.sort([*away, -close, close])
    return knots if np.all(np.diff(knots) > 1e-9 * max(float(np.ptp(knots)), 1e-300)) else None


def curve(knots: Array, values: Array, at: Array) -> Array:
    """Return a law at some places: straight lines between its knots, the last ones go on.

    Args:
        knots: (k,) rising.
        values: (k,) of the law there.
        at: (n,) arguments.

    Returns:
        Its values (n,).
    """
    n = np.clip(np.searchsorted(knots, at), 1, len(knots) - 1)
    share = (at - knots[n - 1]) / (knots[n] - knots[n - 1])
    return np.asarray(values[n - 1] + share * (values[n] - values[n - 1]))


def drawn(knots: Array, jumps: bool) -> tuple[Array, Array]:
    """Return the places at which a law is shown, and how it follows there from its values and its dry friction.

    Args:
        knots: (k,) of the law.
        jumps: it has dry friction, a jump at rest: two places stand close to zero then.

    Returns:
        places (m,), shares (m, k + 1): their product with values and dry friction is the law.
    """
    at = knots
    if jumps and knots[0] < 0.0 < knots[-1]:
        close = JUMP * min(-knots[0], knots[-1])
        at = np.sort([*knots[np.abs(knots) > close], -close, close])
    hats = np.column_stack([curve(knots, row, at) for row in np.eye(len(knots))])
    return at, np.column_stack([hats, np.sign(at)])


def terms_of(s: Array) -> dict[str, Array]:
    """Return the simple terms of a formula at some arguments, by their names.

    Args:
        s: (n,) arguments.

    Returns:
        Each term (n,).
    """
    return {
        "1": np.ones_like(s), "s": s, "sign(s)": np.sign(s), "|s|": np.abs(s), "s |s|": s * np.abs(s), "s^2": s**2,
        "s^3": s**3, "sin(s)": np.sin(s), "cos(s)": np.cos(s),
    }  # fmt: skip


def formula_of(knots: Array, values: Array, errors: Array, most: float) -> str:
    """Return the shortest sum of at most two simple terms that runs within the errors of a law.

    Args:
        knots: (k,) arguments.
        values: (k,) of the law.
        errors: (k,) standard errors of the values.
        most: mean squared error in standard errors up to which a formula holds.

    Returns:
        The formula, s being the argument; empty: none does.
    """
    terms = terms_of(knots)
    weight = 1.0 / np.maximum(errors, 1e-3 * float(np.max(np.abs(values))))
    for count in (1, 2):
        found = []
        for chosen in itertools.combinations(terms, count):
            columns = np.column_stack([terms[name] for name in chosen])
            size, *_ = np.linalg.lstsq(columns * weight[:, None], values * weight, rcond=None)
            left = float(np.mean(((values - columns @ size) * weight) ** 2))
            found.append((left, chosen, size))
        left, chosen, size = min(found, key=lambda entry: entry[0])
        if left < most:
            return " ".join(f"{value:+.4g} {name}" for value, name in zip(size, chosen, strict=True)).lstrip("+")
    return ""


@dataclass(frozen=True)
class Short:
    """A law of few terms: which, its values, dry friction last, and their covariance."""

    terms: tuple[str, ...]
    values: Array
    covariance: Array


def shortened(knots: Array, values: Array, covariance: Array, jumps: bool, terms: tuple[str, ...]) -> list[Short]:
    """Return the likeliest laws of one term and of two, given the fit of one with many values.

    What errors have in common counts (generalised least squares): a curve may lie within its band, and be surely wrong.

    Args:
        knots: (k,) of the law.
        values: (k,) that were fitted, and dry friction where ``jumps``.
        covariance: of these.
        jumps: the law has dry friction, which is the sign of its argument.
        terms: that the law has; empty: every one, and every two, are tried.

    Returns:
        One law, or two.
    """
    basis = {
        name: np.append(column, 0.0) if jumps else column
        for name, column in terms_of(knots).items()
        if not (jumps and name == "sign(s)")
    }
    if jumps:
        basis["sign(s)"] = np.append(np.zeros_like(knots), 1.0)
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    weight = pseudo_inverse(covariance / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)

    def fitted(chosen: tuple[str, ...]) -> tuple[float, Short]:
        columns = np.column_stack([basis[name] for name in chosen])
        spread = pseudo_inverse(columns.T @ weight @ columns, hermitian=True)
        there = columns @ (spread @ (columns.T @ (weight @ values)))
        off = float((values - there) @ weight @ (values - there))
        return off, Short(chosen, there, columns @ spread @ columns.T)

    groups = [[terms]] if terms else [list(itertools.combinations(basis, count)) for count in (1, 2)]
    return [min(map(fitted, group), key=lambda one: one[0])[1] for group in groups]
