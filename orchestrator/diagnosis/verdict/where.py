"""Where record and model disagree: the missing torque at motor, shaft and load, looked at by regime.

The missing torque is the smoothed disturbance of the filter (Bryson and Frazier's smoother: the process noise's
variance times the back-propagated innovations). For each site and each quantity that may rule it (time, speed,
twist, angle, input, frequency) the interval is reported in which more of the missing torque's energy sits than its
share of the samples.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.response import back_propagated, error_response
from orchestrator.diagnosis.settings import PlacesSettings
from orchestrator.shared.inference.colour import Colour, colour_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Missing:
    """The missing torque (n,) [N.m] at each site, with the quantities (n,) that may rule it.

    ``weights`` holds each site's share of the misfit.
    """

    torque: dict[str, Array]
    weights: dict[str, float]
    regimes: dict[str, dict[str, Array]]
    time: Array


@dataclass(frozen=True)
class Place:
    """One place of the misfit: signal, regime, interval (with unit) and the share of the misfit that sits there."""

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
        return f"{site}, {inside}: {100.0 * self.share:.0f} % of the misfit"


def missing_torque(likelihood: RecordLikelihood, model: Fit, plain: bool = False) -> Missing:
    """Return the missing torque of a fitted model over the samples that ``likelihood`` runs over.

    Args:
        likelihood: of the record.
        model: a fit; its process noise decides how fast the torque may change.
        plain: take the noise of the encoders as stated, so that torques of two models may be subtracted; else each
            signal's is that of the model's innovations.

    Returns:
        The torque [N.m] at each site, its weight and regime at each sample.
    """
    plant, settings = likelihood.plant, likelihood.settings
    raw, x = likelihood.innovations(model.p, model.q)
    # The smoother's torques are those of white process noise.
    m, h = likelihood.signals.channels, likelihood.signals.h
    white = Colour(np.zeros((0, m, m)), np.eye(m))
    colour = white if plain else colour_of(model.z, slice(0, len(model.z)), 0)
    response = replace(error_response(likelihood, model), colour=colour)
    effort = -back_propagated(response, raw[:, :m])
    # The filter's noise levels are known up to the factor that its innovations show.
    level = 1.0 if plain else float(np.mean(np.var(model.z, axis=0)))
    variance = level * (model.q * likelihood.signals.torque) ** 2 / h
    scales = [variance]
    if plant.shaft is not None:
        k, ratio = plant.value(model.p, plant.shaft.stiffness), plant.ratio(model.p)
        # A shaft torque shows at both ends; the two estimates weigh the same, hence the half. Without stiffness (a fit
        # may end there) no torque is the shaft's.
        scales += [0.5 * variance * ratio**2 / k if k > 0.0 else 0.0, variance * ratio**2]
    settled = slice(settings.likelihood.settled, None)
    torque, energy, regimes = {}, {}, {}
    for column, (site, scale) in enumerate(zip(plant.sites, scales, strict=True)):
        name = f"torque of the {site}"
        torque[name] = scale * effort[settled, column]
        impulses = _impulses(response.F, response.B[:, column], settings.places.impulse)
        line = (response.W @ impulses).T
        norm = float(np.mean(np.sum(response.colour.white(line, slice(0, len(line))) ** 2, axis=1)))
        energy[name] = float(np.mean(effort[settled, column] ** 2)) / max(norm, 1e-300)
        regimes[name] = _regimes(likelihood, x[settled], site, model)
    total = sum(energy.values())
    weights = {name: value / total if total > 0.0 else 0.0 for name, value in energy.items()}
    return Missing(torque, weights, regimes, np.asarray(h * np.arange(len(x))[settled]))


def places(missing: Missing, h: float, settings: PlacesSettings) -> tuple[Place, ...]:
    """Return where the misfit sits, largest share first.

    Args:
        missing: the missing torque.
        h: sample time [s].
        settings: which places are worth a line.

    Returns:
        The places.
    """
    found = []
    for signal, torque in missing.torque.items():
        weight = missing.weights[signal]
        for regime, values in missing.regimes[signal].items():
            interval, share, samples = _concentration(values, torque**2, settings.bins)
            if share > settings.concentrated * samples and share * weight > settings.small:
                found.append(Place(signal, regime, interval, _unit_of(regime), share * weight))
        found += _band(signal, torque, weight, h, settings)
    found.sort(key=lambda place: place.share, reverse=True)
    return tuple(found[: settings.most])


def _concentration(values: Array, energy: Array, bins: int) -> tuple[tuple[float, float], float, float]:
    """Return the interval of ``values`` that holds most energy beyond its share of samples."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, bins + 1)))
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


def _band(signal: str, torque: Array, weight: float, h: float, settings: PlacesSettings) -> list[Place]:
    """Return the frequency band that holds most of the missing torque's energy beyond its share of the axis."""
    size = min(settings.pane, torque.size)
    panes = torque[: torque.size // size * size].reshape(-1, size) * np.hanning(size)
    power = np.mean(np.abs(np.fft.rfft(panes, axis=1)) ** 2, axis=0)[1:]
    frequency: Array = np.asarray(np.fft.rfftfreq(size, h)[1:])
    interval, share, samples = _concentration(frequency, power, settings.bins)
    if share > settings.band and samples < settings.narrow and share * weight > settings.small:
        return [Place(signal, "frequency", interval, "Hz", share * weight)]
    return []


def _regimes(likelihood: RecordLikelihood, x: Array, site: str, model: Fit) -> dict[str, Array]:
    """Return the quantities (n,) that may rule the missing torque at a site; the states ``x`` are settled ones."""
    plant, h, count = likelihood.plant, likelihood.signals.h, len(x)
    first = likelihood.settings.likelihood.settled
    u = likelihood.signals.u[first : first + count]
    body = plant.body(site)
    speed, angle = x[:, body.speed], x[:, body.angle]
    time = h * np.arange(first, first + count)
    regimes = {"time": time, "|speed|": np.abs(speed), "speed": speed, "|input|": np.abs(u)}
    if plant.shaft is not None:
        twist = plant.twist(model.p, x)
        regimes |= {"angle": np.mod(angle, 2.0 * np.pi), "|twist|": np.abs(twist), "twist": twist}
    else:
        regimes["position"] = angle
    return regimes


def _impulses(F: Array, column: Array, count: int) -> Array:
    states = np.empty((F.shape[0], count))
    xi = column.copy()
    for n in range(count):
        states[:, n] = xi
        xi = F @ xi
    return states


def _unit_of(regime: str) -> str:
    units = {"time": "s", "speed": "rad/s", "input": "N.m", "angle": "rad", "twist": "rad", "position": "rad"}
    return units[regime.strip("|")]
