"""Innovations of a record under one set of parameters and one level of process noise, and their likelihood.

Gains come from the Riccati recursion of the plant with every effect off, at the nominal parameters, for white
torques of standard deviation ``q`` on motor and load; they depend on the sample (they start large, since the initial
state is not known) and not on the candidate, so one set of gains serves all candidates at one ``q``.
"""

import math
from collections.abc import Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from threading import Event
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.diagnosis.plants import Plant
from orchestrator.diagnosis.predictor import predictor_of
from orchestrator.record import Record, quantisation_step

Array = NDArray[np.float64]

HEAD = 10  # samples at the start that only settle the state
FINER = 8  # times more Runge-Kutta steps in a sample in which dry friction may turn round


@dataclass(frozen=True)
class Signals:
    """The signals of a record as the predictor takes them.

    Attributes:
        y: (n, 2) measured angles; the second column is zero with one encoder.
        u: (n,) requested torque.
        h: sample time [s].
        channels: number of encoders, 1 or 2.
        noise: (channels,) standard deviation of the measurement noise, rounding included.
        torque: rms of the drive's torque, the unit in which process noise is counted.
    """

    y: Array
    u: Array
    h: float
    channels: int
    noise: Array
    torque: float

    @property
    def size(self) -> int:
        """Return the number of samples."""
        return int(self.u.size)


def signals_of(record: Record, tau: float) -> Signals:
    """Return the signals of a record for a plant whose torque lags by ``tau`` [s]."""
    one = record.theta_l is None
    load = np.zeros(record.size) if record.theta_l is None else record.theta_l
    y = np.ascontiguousarray(np.column_stack([record.theta_m, load]))
    channels = 1 if one else 2
    noise = np.array([noise_level(y[:, n]) for n in range(channels)])
    return Signals(
        y, np.ascontiguousarray(record.u), record.step, channels, noise, lagged_rms(record.u, record.step, tau)
    )


def noise_level(values: Array, window: int = 9) -> float:
    """Return the standard deviation of the measurement noise from what a sliding cubic leaves.

    It is at least the rounding error of the encoder's count (``count / sqrt(12)``).
    """
    from numpy.lib.stride_tricks import sliding_window_view

    basis, _ = np.linalg.qr(np.vander(np.arange(window) - (window - 1) / 2, 4))
    panes = sliding_window_view(values, window)
    left = panes - (panes @ basis) @ basis.T
    spread = np.sqrt(np.mean(left**2, axis=1) * window / (window - 4))
    rounding = quantisation_step(values) / math.sqrt(12.0)
    scale = 1e-9 * max(float(np.abs(values).max()), 1e-12)
    return max(float(np.sqrt(np.mean(spread**2))), rounding, scale)


def lagged_rms(u: Array, h: float, tau: float) -> float:
    """Return the rms [N.m] of ``u`` behind a lag of ``tau`` [s]."""
    from scipy.signal import lfilter

    pole = math.exp(-h / tau) if tau > 0.0 else 0.0
    torque = lfilter([1.0 - pole], [1.0, -pole], u)
    return max(float(np.sqrt(np.mean(torque**2))), 1e-12)


@njit(cache=True)
def _riccati(A: Array, C: Array, Q: Array, R: Array, P: Array, gains: Array, roots: Array) -> None:
    """Fill the filter gains (n, states, channels) and inverse Cholesky factors of the innovations' covariance."""
    for t in range(gains.shape[0]):
        S = C @ P @ C.T + R
        roots[t] = np.linalg.inv(np.linalg.cholesky(S))
        gain = P @ C.T @ np.linalg.inv(S)
        gains[t] = gain
        P = P - gain @ C @ P
        P = A @ P @ A.T + Q
        P = 0.5 * (P + P.T)


@dataclass(frozen=True)
class Gains:
    """Filter gains (n, 8, 2) in the predictor's places and the whitening factors (n, channels, channels)."""

    gains: Array
    roots: Array


@dataclass
class Likelihood:
    """Runs the predictor over one record; keeps the gains of each process-noise level."""

    plant: Plant
    signals: Signals
    nominal: Array
    stop: int
    _gains: dict[float, Gains] = field(default_factory=dict)
    _halted: Event = field(default_factory=Event)

    def __post_init__(self) -> None:
        self._predict = predictor_of(self.plant.name)
        names = self.plant.names
        self._places = {
            short: names.index(name)
            for short, name in (
                ("delay", "effects.input_delay.delay"),
                ("limit", "effects.torque_saturation.limit"),
                ("resonance", "effects.extra_resonance.inertia"),
                ("frequency", "effects.extra_resonance.frequency"),
            )
            if name in names
        }
        self._offsets = [names.index(name) for name in self.plant.offsets]
        self._substeps = self.plant.substeps(self.nominal, self.signals.h)
        self._start = self._initial_state()

    def gains(self, q: float) -> Gains:
        """Return the gains for white torques of standard deviation ``q`` times the drive's rms torque."""
        if q not in self._gains:
            self._gains[q] = self._solve(q)
        return self._gains[q]

    def halt(self) -> None:
        """Let every run of the predictor from now on, in whatever thread, raise ``CancelledError``."""
        self._halted.set()

    def innovations(self, p: Array, q: float) -> tuple[Array, Array]:
        """Return raw innovations (stop, 2) and corrected states (stop, 8)."""
        if self._halted.is_set():
            raise CancelledError
        n = self.stop
        raw, states = np.empty((n, 2)), np.empty((n, 8))
        offsets = [p[place] for place in self._offsets] + [0.0]
        self._predict(
            self.signals.y, *self.delivered(p, n), tuple(p.tolist()), self.signals.h, self.substeps(p),
            self.gains(q).gains, (offsets[0], offsets[1]), self._start, raw, states,
        )  # fmt: skip
        return raw, states

    def whitened(self, p: Array, q: float) -> Array:
        """Return innovations (stop, channels), each sample scaled by the filter's own covariance."""
        raw, _ = self.innovations(p, q)
        roots = self.gains(q).roots[: self.stop]
        m = self.signals.channels
        with np.errstate(over="ignore", invalid="ignore"):  # of an unstable predictor; the caller sees that
            return np.asarray((roots @ raw[:, :m, None])[:, :, 0])

    def delivered(self, p: Array, stop: int) -> tuple[Array, Array, float]:
        """Return the torque that reaches the drive in each of the first ``stop`` samples: limited, then delayed.

        Returns:
            torque (stop,) in the first part of each sample, torque (stop,) in the rest, length of the first part [s].
        """
        u, h = self.signals.u, self.signals.h
        limit, delay = p[self._places["limit"]], float(p[self._places["delay"]])
        if limit < 1e11:
            u = np.clip(u, -limit, limit)
        if delay <= 0.0:
            return u[:stop], u[:stop], 0.0
        whole = math.floor(delay / h)
        late = u[np.maximum(np.arange(stop) - whole, 0)]
        early = u[np.maximum(np.arange(stop) - whole - 1, 0)]
        return early, late, delay - whole * h

    def substeps(self, p: Array) -> tuple[int, int]:
        """Return Runge-Kutta steps of a sample, and of one in which dry friction may turn round.

        An extra resonance may need more than the plant alone.
        """
        needed = 1
        if "resonance" in self._places and p[self._places["resonance"]] > 0.0:
            needed = math.ceil(p[self._places["frequency"]] * self.signals.h * 1.3 / 0.5)
        return max(self._substeps, needed), max(FINER * self._substeps, needed)

    def log_likelihood(self, z: Array, q: float, part: slice) -> float:
        """Return the log-likelihood of a part, the innovations' covariance taken from that part."""
        e = z[part]
        covariance = e.T @ e / len(e)
        roots = self.gains(q).roots[part]
        _, logdet = np.linalg.slogdet(covariance)
        scale = np.sum(np.log(np.diagonal(roots, axis1=1, axis2=2)))
        return float(-0.5 * len(e) * logdet + scale)

    def _initial_state(self) -> tuple[float, ...]:
        y = self.signals.y
        start = [0.0] * 8
        for channel, place in enumerate(self.plant.measured[: self.signals.channels]):
            start[place] = float(y[0, channel])
        if self.signals.channels < len(self.plant.measured):
            start[2] = float(y[0, 0] / self.nominal[self.plant.index("i")])
        for place, followed in self.plant.followers:
            start[place] = start[followed]
        return tuple(start)

    def _solve(self, q: float) -> Gains:
        plant, signals = self.plant, self.signals
        size, m, n = len(plant.states), signals.channels, signals.size
        at = {place: row for row, place in enumerate(plant.states)}
        p = self.nominal
        A = plant.transition(p, signals.h)
        C = np.zeros((m, size))
        for channel in range(m):
            C[channel, at[plant.measured[channel]]] = 1.0
        ratio = float(p[plant.index("i")]) if "i" in plant.names else 1.0
        Q, P = np.zeros((size, size)), np.zeros((size, size))
        for place, inertia, geared in plant.pushed:
            torque = q * signals.torque * (ratio if geared else 1.0)
            row = at[place]
            Q[row, row] = (torque / p[plant.index(inertia)]) ** 2 * signals.h
            P[row, row] = _largest_speed(signals) ** 2 / (ratio**2 if geared else 1.0)
        for channel in range(len(plant.measured)):
            row = at[plant.measured[channel]]
            P[row, row] = (10.0 * signals.noise[min(channel, m - 1)]) ** 2
        drive = at[4]
        P[drive, drive] = signals.torque**2 if p[plant.index("tau")] > 0.0 else 0.0
        gains, roots = np.zeros((n, size, m)), np.zeros((n, m, m))
        _riccati(A, C, Q, np.diag(signals.noise**2), P, gains, roots)
        full = np.zeros((n, 8, 2))
        for place, row in at.items():
            full[:, place, :m] = gains[:, row]
        for place, followed in plant.followers:
            full[:, place] = full[:, followed]
        return Gains(full, roots)


def _largest_speed(signals: Signals) -> float:
    """Return a bound for the motor's speed from the record [rad/s]."""
    reach = max(1, round(0.05 / signals.h))
    y = signals.y[:, 0]
    if reach >= y.size:
        return float(np.ptp(y)) + 1e-9
    return float(np.max(np.abs(y[reach:] - y[:-reach])) / (reach * signals.h)) + 1e-9


def with_values(plant: Plant, p: Array, values: Mapping[str, float]) -> Array:
    """Return ``p`` with the parameters named in ``values`` replaced."""
    changed = np.array(p, dtype=float)
    for name, value in values.items():
        changed[plant.index(name)] = value
    return changed


def as_floats(values: Any) -> Array:
    """Return a float array."""
    return np.asarray(values, dtype=float)
