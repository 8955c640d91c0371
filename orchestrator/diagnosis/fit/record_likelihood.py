"""Innovations of a record under one set of parameters and one level of process noise, and their likelihood.

Gains come from the Riccati recursion of the plant with every effect off, at the nominal parameters, for white
torques of standard deviation ``q`` on motor and load; they depend on the sample (they start large, since the initial
state is not known) and not on the candidate, so one set of gains serves all candidates at one ``q``.

With one encoder and a gap before what is not measured, models with a gap share another set: that of a filter linearised
along the motion of one of them, the ``reference``, from the state in which the record finds it. A filter that starts
without it takes the load for anywhere in the gap, and is lost where the teeth first meet.
"""

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from copy import copy
from dataclasses import dataclass, field, replace
from threading import Event
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.reference import Reference, Start
from orchestrator.diagnosis.fit.riccati import riccati
from orchestrator.diagnosis.fit.signals import Signals, later
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.plants.description import STATES, Plant
from orchestrator.plants.predictor import follower_of, predictor_of
from orchestrator.shared.inference.colour import Colour, colour_of
from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gains:
    """Filter gains (n, 8, 2) in the predictor's places and the whitening factors (n, channels, channels)."""

    gains: Array
    roots: Array


@dataclass
class RecordLikelihood:
    """Runs the predictor over one record; keeps the gains of each process-noise level."""

    plant: Plant
    signals: Signals
    nominal: Array
    stop: int
    settings: DiagnosisSettings
    reference: Reference | None = None
    _gains: dict[tuple[float, bytes], Gains] = field(default_factory=dict)
    _halted: Event = field(default_factory=Event)

    def __post_init__(self) -> None:
        self._delay, self._limit = (self.plant.index(name) for name in (self.plant.drive.delay, self.plant.drive.limit))
        self._offsets = [self.plant.index(name) for name in self.plant.offsets]
        self._substeps = self.plant.substeps(self.nominal, self.signals.h)
        self._start = self._initial_state()

    def over(self, stop: int) -> "RecordLikelihood":
        """Return the likelihood over the samples before ``stop``; gains are shared.

        Args:
            stop: sample to stop before.

        Returns:
            The likelihood.
        """
        shorter = copy(self)  # nothing else depends on where it stops
        shorter.stop = stop
        return shorter

    def alone(self, part: slice, p: Array, q: float) -> tuple["RecordLikelihood", slice]:
        """Return the likelihood of a part as a record of its own, and where the part lies in that.

        Close to free runs, predictions of a part are ruled by all that came before it: its own starts anew. Of what no
        encoder sees it starts where a model finds it.

        Args:
            part: the samples.
            p: (parameters,) of the model.
            q: its process noise.

        Returns:
            Both; those of the whole where there are several records.
        """
        if self.signals.runs:
            return self, part
        begin = max(part.start - self.settings.likelihood.head, 0)
        rows = slice(begin, part.stop)
        signals = replace(self.signals, y=np.ascontiguousarray(self.signals.y[rows]), u=self.signals.u[rows])
        reference = self._reference(p)
        if reference is not None and reference.starts and begin:
            state = self.innovations(p, q)[1][begin, list(self.plant.states)]
            reference = replace(reference, starts=(replace(reference.starts[0], state=state),))
        own = replace(self, signals=signals, stop=part.stop - begin, reference=reference, _gains={})
        return own, slice(part.start - begin, part.stop - begin)

    def about(self, p: Array, starts: Sequence[Start] = ()) -> "RecordLikelihood":
        """Return the likelihood whose gains for models with a gap are those along the motion of one of them.

        It is the same one where every body has its encoder, or the model has no gap.

        Args:
            p: (parameters,) of the model.
            starts: where each record begins; none: that is not known.

        Returns:
            The likelihood.
        """
        return replace(self, reference=Reference(p, tuple(starts))) if self.is_hidden(p) else self

    def _reference(self, p: Array | None) -> Reference | None:
        """Return the reference of a model with parameters ``p``; None: it needs none."""
        return self.reference if p is not None and self.is_hidden(p) else None

    def is_hidden(self, p: Array) -> bool:
        """Tell whether a model ``p`` has a gap before a body that is not measured.

        Args:
            p: (parameters,) of the predictor.

        Returns:
            True when it has.
        """
        shaft = self.plant.shaft
        if shaft is None or not shaft.gap or self.signals.channels >= len(self.plant.bodies):
            return False
        return self.plant.value(p, shaft.gap) > 0.0

    def gains(self, q: float, p: Array | None = None) -> Gains:
        """Return the gains for white torques of standard deviation ``q`` times the drive's rms torque.

        Args:
            q: process noise.
            p: parameters of the model; None: one without a gap.

        Returns:
            Gains and roots of every sample.
        """
        reference = self._reference(p)
        key = (q, b"" if reference is None else reference.key)
        if key not in self._gains:
            self._gains[key] = self._solve(q, reference)
        return self._gains[key]

    def halt(self) -> None:
        """Let every run of the predictor from now on, in whatever thread, raise ``CancelledError``."""
        self._halted.set()

    @property
    def halted(self) -> bool:
        """Tell whether :meth:`halt` has been called."""
        return self._halted.is_set()

    def innovations(self, p: Array, q: float) -> tuple[Array, Array]:
        """Return raw innovations (stop, 2) and corrected states (stop, 8).

        Args:
            p: parameters of the predictor, in its order.
            q: process noise of the filter, relative to the plant's.

        Returns:
            Innovations (stop, 2) and states (stop, 8) after each correction.

        Raises:
            CancelledError: the fits have been stopped by an interrupt.
        """
        if self._halted.is_set():
            raise CancelledError
        n, gains = self.stop, self.gains(q, p).gains
        raw, states = np.empty((n, 2)), np.empty((n, STATES))
        signals = self.signals.aligned(self.plant, p)
        offsets, predict = [p[place] for place in self._offsets] + [0.0, 0.0], predictor_of(self.plant, p)
        for rows, u, start in self._records(signals, n, self._reference(p)):
            one = isinstance(rows, slice)  # else rows of one record lie apart
            errors, corrected = (raw, states) if one else (np.empty((len(u), 2)), np.empty((len(u), STATES)))
            predict(
                signals.y[rows], *self.delivered(p, u, signals.late), p, signals.h, self.substeps(p), gains[rows],
                (offsets[0], offsets[1]), start, errors, corrected,
            )  # fmt: skip
            if not one:
                raw[rows], states[rows] = errors, corrected
        for run in signals.runs[1:]:
            raw[run.rows[run.rows < n][: self.settings.likelihood.settled]] = 0.0  # they only settle the state
        return raw, states

    def whitened(self, p: Array, q: float) -> Array:
        """Return innovations (stop, channels), each sample scaled by the filter's own covariance.

        Args:
            p: (parameters,) of the predictor.
            q: process noise, as a share of the drive's rms torque.

        Returns:
            The innovations.
        """
        raw, _ = self.innovations(p, q)
        return np.asarray(_scaled(raw, self.gains(q, p).roots))

    def _records(
        self, signals: Signals, stop: int, reference: Reference | None
    ) -> Iterator[tuple[Any, Array, tuple[float, ...]]]:
        """Yield of each record its rows before ``stop``, its requests there and its initial state."""
        known = None if reference is None else reference.starts
        if not signals.runs:
            yield slice(0, stop), signals.u[:stop], self._known_state(known[0]) if known else self._start
        for number, run in enumerate(signals.runs):
            rows = run.rows[run.rows < stop]
            start = self._known_state(known[number]) if known else self._initial_state(int(run.rows[0]))
            yield rows, signals.u[rows], start

    def delivered(self, p: Array, u: Array, more: float = 0.0) -> tuple[Array, Array, float]:
        """Return what of the requests ``u`` (n,) reaches the drive in each sample: limited, then late.

        Args:
            p: (parameters,) of the predictor.
            u: [N.m].
            more: by which they are later than the model's dead time [s].

        Returns:
            torque (n,) in the first part of each sample, torque (n,) in the rest, length of the first part [s].
        """
        h = self.signals.h
        limit, delay = p[self._limit], float(p[self._delay]) + more
        if limit < self.settings.likelihood.unlimited:
            u = np.clip(u, -limit, limit)
        u, _ = self.plant.followed(p, u, h)
        if delay <= 0.0:
            return u, u, 0.0
        whole = math.floor(delay / h)
        return later(u, whole + 1), later(u, whole), delay - whole * h

    def substeps(self, p: Array) -> tuple[int, int]:
        """Return Runge-Kutta steps of a sample, and of one in which friction may turn round or teeth meet.

        An extra resonance may need more than the plant alone.

        Args:
            p: (parameters,) of the predictor.

        Returns:
            Both numbers.
        """
        needed, settings, added = 1, self.settings.likelihood, self.plant.resonance
        if added is not None and p[self.plant.index(added.inertia)] > 0.0:
            turned = p[self.plant.index(added.frequency)] * self.signals.h
            needed = math.ceil(turned * settings.resonance_margin / settings.resonance_step)
        return max(self._substeps, needed), max(settings.finer * self._substeps, needed)

    def log_likelihood(
        self, z: Array, q: float, part: slice, colour: Colour | None = None, p: Array | None = None
    ) -> float:  # fmt: skip
        """Return the log-likelihood of a part, the covariance of what ``colour`` leaves taken from that part.

        Without a colour, innovations count as independent from sample to sample; ``p`` are the model's parameters
        (None: it has no gap).

        Args:
            z: (n, channels) whitened innovations.
            q: process noise, as a share of the drive's rms torque.
            part: the samples.
            colour: autoregression that is taken out first.
            p: (parameters,) of the predictor.

        Returns:
            The log-likelihood; minus infinity for an unstable predictor.
        """
        colour = colour_of(z, part, 0) if colour is None else colour
        if not colour.usable:
            return -math.inf
        e = colour.white(z, part)
        with np.errstate(over="ignore", invalid="ignore"):
            covariance = e.T @ e / len(e)
        if not np.all(np.isfinite(covariance)):
            return -math.inf  # an unstable predictor explains nothing
        roots = self.gains(q, p).roots[part]
        logdet = np.linalg.slogdet(covariance)[1] - 2.0 * np.linalg.slogdet(colour.root)[1]
        scale = np.sum(np.log(np.diagonal(roots, axis1=1, axis2=2)))
        return float(-0.5 * len(e) * logdet + scale)

    def _initial_state(self, first: int = 0) -> tuple[float, ...]:
        y = self.signals.y[first:]
        start = [0.0] * STATES
        for channel, body in enumerate(self.plant.bodies):
            if channel < self.signals.channels:
                start[body.angle] = float(y[0, channel])
            else:
                start[body.angle] = float(y[0, 0] / self.plant.ratio(self.nominal))
        return self._followed(start)

    def _known_state(self, known: Start) -> tuple[float, ...]:
        start = [0.0] * STATES
        for place, value in zip(self.plant.states, known.state, strict=True):
            start[place] = float(value)
        return self._followed(start)

    def _followed(self, start: list[float]) -> tuple[float, ...]:
        for place, followed in self.plant.followers:
            start[place] = start[followed]
        return tuple(start)

    def _solve(self, q: float, reference: Reference | None) -> Gains:
        plant = self.plant
        about = None if reference is None else reference.p
        signals = self.signals if about is None else self.signals.aligned(plant, about)
        m, n = signals.channels, signals.size
        at = {place: row for row, place in enumerate(plant.states)}
        size, p = len(plant.states), self.nominal
        A = plant.transition(p, signals.h)
        C = measurement_matrix(plant, m)
        Q, P = np.zeros((size, size)), np.zeros((size, size))
        ratio = plant.ratio(p)
        speed = _largest_speed(signals, self.settings.likelihood.speed_span)
        for body in plant.bodies:
            torque = q * signals.torque * (ratio if body.geared else 1.0)
            row = at[body.speed]
            Q[row, row] = (torque / p[plant.index(body.inertia)]) ** 2 * signals.h
            P[row, row] = speed**2 / (ratio**2 if body.geared else 1.0)
        for channel, body in enumerate(plant.bodies):
            noise = signals.noise[min(channel, m - 1)]
            P[at[body.angle], at[body.angle]] = (self.settings.likelihood.start_angle * noise) ** 2
        drive = at[plant.drive.torque]
        P[drive, drive] = signals.torque**2 if plant.value(p, plant.drive.lag) > 0.0 else 0.0
        gains, roots = np.zeros((n, size, m)), np.zeros((n, m, m))
        noises = [run.noise for run in signals.runs] or [signals.noise]
        spreads = [P] * len(noises)
        if reference is not None and reference.starts:
            spreads = [start.covariance for start in reference.starts]
        records = self._records(signals, n, reference)
        for (rows, u, start), noise, spread in zip(records, noises, spreads, strict=True):
            own, factors, R = np.zeros((len(u), size, m)), np.zeros((len(u), m, m)), np.diag(noise**2)
            if about is None:
                riccati(A, C, Q, R, spread, own, factors)
            else:
                offsets = [about[place] for place in self._offsets] + [0.0, 0.0]
                follower_of(plant)(
                    signals.y[rows], *self.delivered(about, u, signals.late), about, signals.h, self.substeps(about),
                    (offsets[0], offsets[1]), start, np.array(plant.states),
                    np.array([at[body.angle] for body in plant.bodies[:m]]), spread, Q, R, own, factors,
                )  # fmt: skip
            gains[rows], roots[rows] = own, factors
        full = np.zeros((n, STATES, 2))
        for place, row in at.items():
            full[:, place, :m] = gains[:, row]
        for place, followed in plant.followers:
            full[:, place] = full[:, followed]
        return Gains(full, roots)


@kept(error_model="numpy", nogil=True)
def _scaled(raw: Array, roots: Array) -> Array:
    """Return innovations (n, channels), each sample (n, 2) scaled by its lower triangular root."""
    channels = roots.shape[1]
    out = np.empty((raw.shape[0], channels))
    for n in range(raw.shape[0]):
        for row in range(channels):
            total = 0.0
            for column in range(row + 1):
                total += roots[n, row, column] * raw[n, column]
            out[n, row] = total
    return out


def measurement_matrix(plant: Plant, channels: int) -> Array:
    """Return (channels, states): which state of the plant with every effect off each encoder measures.

    Args:
        plant: that the record is of.
        channels: number of encoders.

    Returns:
        Ones and zeros.
    """
    C = np.zeros((channels, len(plant.states)))
    for channel, body in enumerate(plant.bodies[:channels]):
        C[channel, plant.states.index(body.angle)] = 1.0
    return C


def _largest_speed(signals: Signals, span: float) -> float:
    """Return a bound for the motor's speed from the record [rad/s], taken over ``span`` [s]."""
    reach, largest = max(1, round(span / signals.h)), 0.0
    for y in [signals.y[run.rows, 0] for run in signals.runs] or [signals.y[:, 0]]:
        if reach >= y.size:
            return float(np.ptp(y)) + 1e-9
        largest = max(largest, float(np.max(np.abs(y[reach:] - y[:-reach])) / (reach * signals.h)))
    return largest + 1e-9
