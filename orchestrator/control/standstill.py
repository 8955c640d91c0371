"""What a loop does at rest before anyone runs it: margins, rank, and the cycle that the gap makes of it.

Without friction and limit of the torque the loop is homogeneous: a half-gap twice as wide makes the same motion twice
as large, so gains alone decide whether it cycles. From far out every trajectory of a stable loop comes in, since far
out the gap is small. It ends in rest or in the outermost cycle. So the motion is computed for a half-gap of 1 from
several starts, exactly between samples of the controller but for the instant of a contact, until it repeats.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import ScenarioError
from orchestrator.plants.design import (
    DrivetrainValues,
    LinearModel,
    discretise,
    five_state_model,
    rank_report,
    six_state_model,
)  # fmt: skip

Array = NDArray[np.float64]

LONGEST_PART = 2.5e-4  # of a sample, within which a contact is taken to last or not to [s]
LONGEST = 240.0  # that a start is followed [s]
PIECE = 10.0  # after which a motion is judged [s]
STILL = 0.05  # motion of the load in a piece, over the half-gap, that is rest
REPEATED = 0.01  # relative difference of the motion of two pieces, below which it is a cycle
STARTS = ((100.0, 0.0), (0.0, 30.0), (3.0, 0.0), (-1.5, 6.0))  # load angle and speed, over the half-gap
FREQUENCIES = 20_000  # of the loop's margins
ROUNDING = 1e-10  # of an eigenvalue's size


@dataclass(frozen=True)
class Margins:
    """Of the sampled loop, cut at the request.

    Attributes:
        lower: factor of the gain at which it is unstable, below 1; 0 where there is none.
        upper: the same above 1; infinite where there is none.
        phase: least phase that makes it unstable [rad].
        delay: least further delay that does [s].
    """

    lower: float
    upper: float
    phase: float
    delay: float


@dataclass(frozen=True)
class RestForecast:
    """What a loop with a gap will do at rest, without friction and load.

    Attributes:
        cycles: whether it oscillates for ever.
        twist: amplitude of the twist, over the half-gap; 0 where it is still.
        load: amplitude of the load's angle, over the half-gap; 0 where it is still.
        frequency: [Hz]; 0 where it is still.
        settled: whether the motion repeated itself, or came to rest, within the time that it was followed.
        margins: of the loop without a gap.
        rank: of the model with the load torque as a sixth state: how many an input moves.
    """

    cycles: bool
    twist: float
    load: float
    frequency: float
    settled: bool
    margins: Margins
    rank: int


def forecast_rest(
    values: DrivetrainValues, gains: tuple[float, ...], sample_time: float, delay: int = 0
) -> RestForecast:
    """Return what the loop ``u = -K x`` does at rest.

    Args:
        gains: for ``REGULATOR_STATES``.
        sample_time: of the controller [s].
        delay: of the request [samples].

    Raises:
        ScenarioError: the loop is unstable even without a gap.
    """
    matrices = _matrices(values, np.asarray(gains), sample_time, delay)
    parts = n_parts(sample_time)
    _require_stable(matrices, sample_time)
    state = np.zeros((6 + delay + 1, len(STARTS)))
    state[-1] = 1.0
    state[2], state[3] = np.array(STARTS).T
    state[0], state[1] = values.i * state[2], values.i * state[3]
    rows = round(PIECE / sample_time)
    before = np.full(len(STARTS), np.inf)
    settled = np.zeros(len(STARTS), dtype=bool)
    for _ in range(round(LONGEST / PIECE)):
        twist, load, state = _follow(matrices, state, (rows, parts), values.i)
        size = 0.5 * np.ptp(load, axis=0)
        settled = (np.abs(size - before) < REPEATED * size) | (size < STILL)
        if settled.all():
            break
        before = size
    largest = int(np.argmax(size))
    margins = loop_margins(five_state_model(values), gains, sample_time, delay)
    rank = rank_report(six_state_model(values)).controllable
    if size[largest] < STILL:
        return RestForecast(False, 0.0, 0.0, 0.0, bool(settled.all()), margins, rank)
    frequency = _frequency(load[:, largest], sample_time)
    amplitude = 0.5 * float(np.ptp(twist[:, largest]))
    return RestForecast(True, amplitude, float(size[largest]), frequency, bool(settled.all()), margins, rank)


def loop_margins(model: LinearModel, gains: tuple[float, ...], sample_time: float, delay: int = 0) -> Margins:
    """Return the margins of the loop at the request [states of ``model``]."""
    angles = np.geomspace(1e-4 * sample_time, np.pi, FREQUENCIES)
    L = loop_response(model, gains, sample_time, delay, angles)
    phase = np.unwrap(np.angle(L))
    size = np.abs(L)
    crossed = np.flatnonzero(np.diff(np.floor((phase - np.pi) / (2.0 * np.pi))) != 0)
    factors = 1.0 / size[crossed]
    if L[-1].real < 0.0:  # at half the sampling frequency the response is real: a pole leaves at z = -1
        factors = np.append(factors, 1.0 / size[-1])
    unity = np.flatnonzero(np.diff(size > 1.0))
    over = np.mod(phase[unity] + np.pi, 2.0 * np.pi)
    times = over / angles[unity] * sample_time
    least = np.minimum(over, 2.0 * np.pi - over)
    return Margins(
        float(factors[factors < 1.0].max(initial=0.0)),
        float(factors[factors > 1.0].min(initial=np.inf)),
        float(least.min(initial=np.pi)),
        float(times.min(initial=np.inf)),
    )


def loop_response(
    model: LinearModel, gains: tuple[float, ...], sample_time: float, delay: int, angles: Array
) -> NDArray[np.complex128]:
    """Return ``L(z) = K (z - A)^-1 B z^-delay`` at the angles of ``z`` [rad], shape (n,)."""
    A, B = discretise(model, sample_time)
    z = np.exp(1j * angles)
    poles, vectors = np.linalg.eig(A)
    left = np.asarray(gains) @ vectors
    right = np.linalg.solve(vectors, B[:, 0].astype(complex))
    response: NDArray[np.complex128] = ((left * right) / (z[:, None] - poles)).sum(axis=1) * z**-delay
    return response


def _matrices(values: DrivetrainValues, gains: Array, sample_time: float, delay: int) -> tuple[Array, Array, Array]:
    """Return the steps of a part of a sample within the gap and on its flank, and the sampling at its end.

    The state is the plant's, the requests that are held and under way (the one that acts first), and 1. On a flank the
    wound twist is ``phi - 1`` there; ``_follow`` turns the sign of the state round for the other one.
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


def _follow(
    matrices: tuple[Array, Array, Array], state: Array, counts: tuple[int, int], i: float
) -> tuple[Array, Array, Array]:
    """Return twist and load angle at each sample, shape (rows, starts), and the state behind them."""
    gap, contact, sample = matrices
    rows, parts = counts
    twist, load = np.empty((rows, state.shape[1])), np.empty((rows, state.shape[1]))
    for row in range(rows):
        state = sample @ state
        for _ in range(parts):
            phi = state[0] / i - state[2]
            side = np.where(phi > 1.0, 1.0, np.where(phi < -1.0, -1.0, 0.0))
            turned = state * np.where(side < 0.0, -1.0, 1.0)
            turned[-1] = 1.0
            touching = contact @ turned
            touching[:-1] *= np.where(side < 0.0, -1.0, 1.0)
            state = np.where(side == 0.0, gap @ state, touching)
        twist[row], load[row] = state[0] / i - state[2], state[2]
    return twist, load, state


def _frequency(load: Array, sample_time: float) -> float:
    """Return the mean frequency [Hz] of a motion, by its passages upwards through its middle."""
    level = load - 0.5 * (load.max() + load.min())
    up = np.flatnonzero((level[1:] >= 0.0) & (level[:-1] < 0.0))
    passed = [n - level[n] / (level[n + 1] - level[n]) for n in up]
    gaps = [b - a for a, b in pairwise(passed)]
    return 1.0 / (float(np.mean(gaps)) * sample_time) if gaps else 0.0
