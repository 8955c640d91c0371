"""Recursive filters of a sampled signal: the values of ``scipy.signal``, without the half second of its import."""

import math

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.translation.kernels import Kernels
from orchestrator.shared.inference.noise import rms

Array = NDArray[np.float64]
FILTERS = Kernels("orchestrator.plants.kernels.filters")
ORDER = 6


def first_order(values: Array, now: float, before: float, decay: float, state: float = 0.0) -> Array:
    """Return the filter (n,) ``y[n] = decay y[n - 1] + now x[n] + before x[n - 1]`` of values (n,).

    Args:
        state: what comes to the first value from those before it.
    """
    out = np.empty(len(values))
    FILTERS.pass_lag(values, now, before, decay, state, out)
    return out


def rms_behind_lag(u: Array, h: float, tau: float) -> float:
    """Return the rms [N.m] of requests (n,) [N.m], each held for ``h`` [s], behind a lag of ``tau`` [s]."""
    pole = math.exp(-h / tau) if tau > 0.0 else 0.0
    return max(rms(first_order(u, 1.0 - pole, 0.0, pole)), 1e-12)


def low_pass(values: Array, share: float) -> Array:
    """Return values (n,) behind Butterworth's low-pass of sixth order, passed forwards and backwards: without a shift.

    Either end is continued by its own values, turned about it.

    Args:
        share: of half the sample rate at which half the power passes once.
    """
    sections = _sections(share)
    edge = 3 * (ORDER + 1)
    if values.size <= edge:
        raise ValueError(f"a signal must have more than {edge} values to be filtered, but has {values.size}")
    whole = np.concatenate(
        (2.0 * values[0] - values[edge:0:-1], values, 2.0 * values[-1] - values[-2 : -edge - 2 : -1])
    )
    for _ in range(2):
        out = np.empty(whole.size)
        FILTERS.pass_sections(whole, sections, _settled(sections) * whole[0], out)
        whole = out[::-1]
    return np.ascontiguousarray(whole[edge:-edge])


def _sections(share: float) -> Array:
    """Return Butterworth's sections (3, 5) by the bilinear transformation, the poles nearest to the circle last."""
    turn = 4.0 * np.tan(0.5 * np.pi * share)
    poles = turn * -np.exp(1j * np.pi * np.arange(1 - ORDER, ORDER, 2) / (2 * ORDER))
    gain = turn**ORDER * float(np.real(1.0 / np.prod(4.0 - poles)))
    poles = (4.0 + poles) / (4.0 - poles)
    poles = poles[poles.imag > 0.0]
    poles = poles[np.argsort(np.abs(poles))]
    rows = [(1.0, 2.0, 1.0, -2.0 * pole.real, (pole * pole.conjugate()).real) for pole in poles]
    sections = np.array(rows)
    sections[0, :3] *= gain
    return sections


def _settled(sections: Array) -> Array:
    """Return the states (3, 2) in which the sections answer ones by what is constant."""
    states, scale = np.empty((len(sections), 2)), 1.0
    for state, (b0, b1, b2, a1, a2) in zip(states, sections, strict=True):
        state[:] = scale * np.linalg.solve([[1.0 + a1, -1.0], [a2, 1.0]], [b1 - a1 * b0, b2 - a2 * b0])
        scale *= np.sum([b0, b1, b2]) / np.sum([1.0, a1, a2])
    return states
