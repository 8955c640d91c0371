"""Where record and model disagree: the missing torque at motor, shaft and load, looked at by regime.

The missing torque is the smoothed disturbance of the filter (Bryson and Frazier's smoother: the process noise's
variance times the back-propagated innovations). For each site and each quantity that may rule it (time, speed,
twist, angle, input, frequency) the interval is reported in which more of the missing torque's energy sits than its
share of the samples.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fitting import Fit
from orchestrator.diagnosis.likelihood import Likelihood
from orchestrator.diagnosis.plants import Plant
from orchestrator.diagnosis.screening import back_propagated, error_response

Array = NDArray[np.float64]

BINS = 24
CONCENTRATED = 1.25  # energy share over sample share from which an interval counts
NARROW = 0.06  # share of the frequency axis below which a band says something
MOST = 12
SMALL = 0.02


@dataclass(frozen=True)
class Missing:
    """The missing torque (n,) [N.m] at each site, with the quantities (n,) that may rule it.

    ``weights`` holds each site's share of the gap.
    """

    torque: dict[str, Array]
    weights: dict[str, float]
    regimes: dict[str, dict[str, Array]]
    time: Array


@dataclass(frozen=True)
class Place:
    """One place of the gap: signal, regime, interval (with unit) and the share of the gap that sits there."""

    signal: str
    regime: str
    interval: tuple[float, float]
    unit: str
    share: float

    @property
    def words(self) -> str:
        """Return the place in words."""
        low, high = self.interval
        sites = {"torque of the motor": "at the motor", "torque of the load": "at the load"}
        site = sites.get(self.signal, "on the shaft" if "shaft" in self.signal else self.signal)
        if self.regime.startswith("|"):
            inside = f"while {self.regime} is within {low:.3g} and {high:.3g} {self.unit}"
        else:
            inside = f"for {self.regime} from {low:.3g} to {high:.3g} {self.unit}"
        return f"{site}, {inside}: {100.0 * self.share:.0f} % of the gap"


def missing_torque(likelihood: Likelihood, plant: Plant, model: Fit) -> Missing:
    """Return the missing torque of a fitted model over the samples that ``likelihood`` runs over."""
    raw, x = likelihood.innovations(model.p, model.q)
    response = error_response(likelihood, plant, model)
    m, h = likelihood.signals.channels, likelihood.signals.h
    effort = -back_propagated(response, raw[:, :m])
    # The filter's noise levels are known up to the factor that its innovations show.
    level = float(np.mean(np.var(model.z, axis=0)))
    variance = level * (model.q * likelihood.signals.torque) ** 2 / h
    ratio = float(model.p[plant.index("i")]) if "i" in plant.names else 1.0
    settled = slice(20, None)
    sites = {"torque of the motor": (0, variance)}
    if effort.shape[1] > 2:
        k = float(model.p[plant.index("k")])
        # A shaft torque shows at both ends; the two estimates weigh the same, hence the half.
        sites |= {
            "torque of the shaft": (1, 0.5 * variance * ratio**2 / k),
            "torque of the load": (2, variance * ratio**2),
        }
    torque, energy = {}, {}
    for name, (column, scale) in sites.items():
        torque[name] = scale * effort[settled, column]
        norm = float(np.mean(np.sum((response.W @ _impulses(response.F, response.B[:, column])) ** 2, axis=0)))
        energy[name] = float(np.mean(effort[settled, column] ** 2)) / max(norm, 1e-300)
    total = sum(energy.values())
    weights = {name: value / total if total > 0.0 else 0.0 for name, value in energy.items()}
    regimes = {name: _regimes(likelihood, plant, x[settled], name, model) for name in sites}
    return Missing(torque, weights, regimes, np.asarray(h * np.arange(len(x))[settled]))


def places(missing: Missing, h: float) -> tuple[Place, ...]:
    """Return where the gap sits, largest share first."""
    found = []
    for signal, torque in missing.torque.items():
        weight = missing.weights[signal]
        for regime, values in missing.regimes[signal].items():
            interval, share, samples = _concentration(values, torque**2)
            if share > CONCENTRATED * samples and share * weight > SMALL:
                found.append(Place(signal, regime, interval, _unit_of(regime), share * weight))
        found += _band(signal, torque, weight, h)
    found.sort(key=lambda place: place.share, reverse=True)
    return tuple(found[:MOST])


def _concentration(values: Array, energy: Array) -> tuple[tuple[float, float], float, float]:
    """Return the interval of ``values`` that holds most energy beyond its share of samples."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
    if edges.size < 3:
        return (float(values.min()), float(values.max())), 1.0, 1.0
    at = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)
    shares = np.bincount(at, energy, edges.size - 1) / max(float(energy.sum()), 1e-300)
    samples = np.bincount(at, minlength=edges.size - 1) / values.size
    excess = np.concatenate([[0.0], np.cumsum(shares - samples)])
    best, low, high = -1.0, 0, 0
    for begin in range(edges.size - 1):
        end = begin + 1 + int(np.argmax(excess[begin + 1 :]))
        if excess[end] - excess[begin] > best:
            best, low, high = float(excess[end] - excess[begin]), begin, end
    return (float(edges[low]), float(edges[high])), float(shares[low:high].sum()), float(samples[low:high].sum())


def _band(signal: str, torque: Array, weight: float, h: float) -> list[Place]:
    """Return the frequency band that holds most of the missing torque's energy beyond its share of the axis."""
    size = min(1024, torque.size)
    panes = torque[: torque.size // size * size].reshape(-1, size) * np.hanning(size)
    power = np.mean(np.abs(np.fft.rfft(panes, axis=1)) ** 2, axis=0)[1:]
    frequency: Array = np.asarray(np.fft.rfftfreq(size, h)[1:])
    interval, share, samples = _concentration(frequency, power)
    if share > 0.5 and samples < NARROW and share * weight > SMALL:
        return [Place(signal, "frequency", interval, "Hz", share * weight)]
    return []


def _regimes(likelihood: Likelihood, plant: Plant, x: Array, site: str, model: Fit) -> dict[str, Array]:
    h = likelihood.signals.h
    count = len(x)
    u = likelihood.signals.u[20 : 20 + count]
    speed, angle = (x[:, 3], x[:, 2]) if "load" in site else (x[:, 1], x[:, 0])
    regimes = {"time": h * np.arange(20, 20 + count), "|speed|": np.abs(speed), "speed": speed, "|input|": np.abs(u)}
    if "k" in plant.names:
        twist = x[:, 0] / float(model.p[plant.index("i")]) - x[:, 2]
        regimes |= {"angle": np.mod(angle, 2.0 * np.pi), "|twist|": np.abs(twist), "twist": twist}
    else:
        regimes["position"] = angle
    return regimes


def _impulses(F: Array, column: Array, count: int = 400) -> Array:
    states = np.empty((F.shape[0], count))
    xi = column.copy()
    for n in range(count):
        states[:, n] = xi
        xi = F @ xi
    return states


def _unit_of(regime: str) -> str:
    units = {"time": "s", "speed": "rad/s", "input": "N.m", "angle": "rad", "twist": "rad", "position": "rad"}
    return units[regime.strip("|")]
