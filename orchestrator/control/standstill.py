"""What a loop does at rest before anyone runs it: margins, rank, and the cycle that the gap makes of it.

Without friction and limit of the torque the loop is homogeneous: a half-gap twice as wide makes the same motion twice
as large, so gains alone decide whether it cycles. From far out every trajectory of a stable loop comes in, since far
out the gap is small. It ends in rest or in the outermost cycle. So the motion is computed for a half-gap of 1 from
several starts, exactly between samples of the controller but for the instant of a contact, until it repeats.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.translation.kernels import Kernels
from orchestrator.errors import ScenarioError
from orchestrator.plants.design import DrivetrainValues, LinearModel, five_state_model, rank_report, six_state_model
from orchestrator.shared.arrays import Array
from orchestrator.shared.results.regulator import ForecastFound

LONGEST_PART = 2.5e-4  # of a sample, within which a contact is taken to last or not to [s]
LONGEST = 240.0  # that a start is followed [s]
PIECE = 10.0  # after which a motion is judged [s]
STILL = 0.05  # motion of the load in a piece, over the half-gap, that is rest
REPEATED = 0.01  # relative difference of the motion of two pieces, below which it is a cycle
STARTS = ((100.0, 0.0), (0.0, 30.0), (3.0, 0.0), (-1.5, 6.0))  # load angle and speed, over the half-gap
FREQUENCIES = 4000  # of the loop's margins, between which they are refined
REST = Kernels("orchestrator.control.rest_kernel")
ROUNDING = 1e-10  # of an eigenvalue's size


@dataclass(frozen=True)
class Margins:
    """Of the sampled loop, cut at the request."""

    lower: float  # factor of the gain at which it is unstable, below 1; 0 where there is none
    upper: float  # the same above 1; infinite where there is none
    phase: float  # least phase that makes it unstable [rad]
    delay: float  # least further delay that does [s]


def forecast_rest(
    values: DrivetrainValues, gains: tuple[float, ...], sample_time: float, delay: int = 0
) -> ForecastFound:
    """Return what the loop ``u = -K x`` of ``REGULATOR_STATES`` does at rest; ``delay``: of the request [samples].

    Raises:
        ScenarioError: the loop is unstable even without a gap.
    """
    matrices = _matrices(values, np.asarray(gains), sample_time, delay)
    parts = n_parts(sample_time)
    _require_stable(matrices, sample_time)
    state = np.zeros((len(STARTS), 6 + delay + 1))
    state[:, -1] = 1.0
    state[:, 2:4] = STARTS
    state[:, :2] = values.i * state[:, 2:4]
    rows = round(PIECE / sample_time)
    before = np.full(len(STARTS), np.inf)
    settled = np.zeros(len(STARTS), dtype=bool)
    twist, load = np.empty((2, len(STARTS), rows))
    for _ in range(round(LONGEST / PIECE)):
        for n, one in enumerate(state):
            REST.follow(*matrices, one, np.empty_like(one), parts, values.i, twist[n], load[n])
        size = 0.5 * np.ptp(load, axis=1)
        settled = (np.abs(size - before) < REPEATED * size) | (size < STILL)
        if settled.all():
            break
        before = size
    largest = int(np.argmax(size))
    margins = loop_margins(five_state_model(values), gains, sample_time, delay)
    cycles = bool(size[largest] >= STILL)
    return ForecastFound(
        cycles=cycles,
        twist=0.5 * float(np.ptp(twist[largest])) if cycles else 0.0,
        load=float(size[largest]) if cycles else 0.0,
        frequency=_frequency(load[largest], sample_time) if cycles else 0.0,
        phase_margin=margins.phase,
        delay_margin=margins.delay if math.isfinite(margins.delay) else None,
        rank=rank_report(six_state_model(values)).controllable,
        settled=bool(settled.all()),
        lower_gain=margins.lower or None,
        upper_gain=margins.upper if math.isfinite(margins.upper) else None,
    )


def loop_margins(model: LinearModel, gains: tuple[float, ...], sample_time: float, delay: int = 0) -> Margins:
    """Return the margins of the loop at the request [states of ``model``].

    The sampled loop has poles near ``z = 1``, where the polynomials of ``control.stability_margins`` cancel: they say a
    gain margin of 1.15 in place of 86. Its method ``frd`` knows no crossing at half the sampling frequency. So the
    crossings are bracketed and refined here.
    """
    from scipy.optimize import brentq

    angles = np.geomspace(1e-4 * sample_time, np.pi, FREQUENCIES)
    loop = loop_response(model, gains, sample_time, delay)
    L = loop(angles)
    phase, size = np.unwrap(np.angle(L)), np.abs(L)

    def crossings(at: NDArray[np.intp], value: Callable[[complex], float]) -> Array:
        found = [brentq(lambda a: value(complex(loop(np.array([a]))[0])), angles[n], angles[n + 1]) for n in at]
        return np.array(found)

    turned = np.flatnonzero(np.diff(np.floor((phase - np.pi) / (2.0 * np.pi))) != 0)
    turned = turned[np.signbit(L.imag[turned]) != np.signbit(L.imag[turned + 1])]
    factors = 1.0 / np.abs(loop(crossings(turned, lambda value: value.imag)))
    if L[-1].real < 0.0:  # at half the sampling frequency the response is real: a pole leaves at z = -1
        factors = np.append(factors, 1.0 / size[-1])
    unity = crossings(np.flatnonzero(np.diff(size > 1.0)), lambda value: abs(value) - 1.0)
    over = np.mod(np.angle(loop(unity)) + np.pi, 2.0 * np.pi)
    return Margins(
        float(factors[factors < 1.0].max(initial=0.0)),
        float(factors[factors > 1.0].min(initial=np.inf)),
        float(np.minimum(over, 2.0 * np.pi - over).min(initial=np.pi)),
        float((over / unity * sample_time).min(initial=np.inf)),
    )


def loop_response(
    model: LinearModel, gains: tuple[float, ...], sample_time: float, delay: int
) -> Callable[[Array], NDArray[np.complex128]]:
    """Return ``L(z) = K (z - A)^-1 B z^-delay`` as a function of angles of ``z`` [rad], shape (n,)."""
    import control

    sampled = control.c2d(control.ss(model.A, model.B, np.atleast_2d(gains), 0), sample_time)

    def respond(angles: Array) -> NDArray[np.complex128]:
        z = np.exp(1j * angles)
        return np.asarray(sampled(z) * z**-delay, dtype=np.complex128)

    return respond


def _matrices(values: DrivetrainValues, gains: Array, sample_time: float, delay: int) -> tuple[Array, Array, Array]:
    """Return the steps of a part of a sample within the gap and on its flank, and the sampling at its end.

    The state is the plant's, the requests that are held and under way (the one that acts first), and 1. On the
    upper flank the wound twist is ``phi - 1``.
    """
    from scipy.linalg import expm

    n = 6 + delay + 1
    contact = np.zeros((n, n))
    model = five_state_model(values)
    contact[:5, :5], contact[:5, 5] = model.A, model.B[:, 0]
    gap = contact.copy()
    twist = np.array([1.0 / values.i, 0.0, -1.0, 0.0])
    speed = np.array([0.0, 1.0 / values.i, 0.0, -1.0])
    for row, inertia in ((1, -values.J_m * values.i), (3, values.J_l)):
        gap[row, :4] -= (values.k * twist + values.c * speed) / inertia
        contact[row, -1] = -values.k / inertia
    sample = np.eye(n)
    sample[5 : 5 + delay] = np.eye(n)[6 : 6 + delay]
    sample[5 + delay] = 0.0
    sample[5 + delay, :5] = -gains
    part = sample_time / n_parts(sample_time)
    return expm(gap * part), expm(contact * part), sample


def n_parts(sample_time: float) -> int:
    """Return into how many parts a sample [s] is cut."""
    return math.ceil(sample_time / LONGEST_PART - 1e-9)


def _require_stable(matrices: tuple[Array, Array, Array], sample_time: float) -> None:
    """Refuse a loop whose teeth always touch and that is unstable: far out every loop with a gap is that one."""
    _, contact, sample = matrices
    step = np.linalg.matrix_power(contact[:-1, :-1], n_parts(sample_time)) @ sample[:-1, :-1]
    largest = float(np.abs(np.linalg.eigvals(step)).max())
    if largest > 1.0 - ROUNDING:
        late = len(sample) - 7
        grows = largest > 1.0 + ROUNDING
        motion = f"doubles in {sample_time * math.log(2.0) / math.log(largest):.3g} s" if grows else "does not decay"
        raise ScenarioError(
            f"the loop must be stable without a gap, but with a `delay` of {late} its motion {motion}: "
            f"give {'a shorter `delay` or ' if late else ''}other gains",
            "delay",
        )


def _frequency(load: Array, sample_time: float) -> float:
    """Return the mean frequency [Hz] of a motion, by its passages upwards through its middle."""
    level = load - 0.5 * (load.max() + load.min())
    up = np.flatnonzero((level[1:] >= 0.0) & (level[:-1] < 0.0))
    passed = [n - level[n] / (level[n + 1] - level[n]) for n in up]
    gaps = [b - a for a, b in pairwise(passed)]
    return 1.0 / (float(np.mean(gaps)) * sample_time) if gaps else 0.0
