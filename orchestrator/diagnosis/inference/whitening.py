"""Whitening of residuals in the frequency domain.

Residuals of a model that lacks nothing have the spectrum

    S(f) = G(f) diag(r) G(f)* + B(f) diag(q) B(f)*

with encoders' noise ``r`` through ``G`` and unknown torques ``q`` through ``B``. Both levels are those with the largest
likelihood (Whittle, 1953). The weights are the inverse Cholesky factor of S at each frequency, cut off at the band's
end. With q small a whitened residual is the misfit of a free run, with q large that of a regression of torque on
motion.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.signal import csd, welch

from orchestrator.diagnosis.model.interface import ResidualModel
from orchestrator.diagnosis.settings import FitSettings
from orchestrator.shared.arrays import Array

Complex = NDArray[np.complex128]
MEASUREMENT_LEVELS = (1.0, 2.0, 4.0, 10.0, 30.0)  # tried, in shares of the encoder's flat noise: a count is not white
PROCESS_LEVELS = (1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5)  # tried, in shares of the residual's power
QUIET = 1e-4  # of the unknown torques that residuals show, where weights take hardly any for granted
RIDGE = 1e-12  # of the diagonal of a spectral matrix: encoders that move as one leave it singular


@dataclass(frozen=True, eq=False)
class Whitening:
    """Weights of one record's residuals, and the rows that are kept of what they give."""

    weights: Complex  # (f, channels, channels) lower triangular, at the frequencies of the band, from zero on
    rows: NDArray[np.int64]  # (m,) rows that are kept, evenly apart, about independent of each other
    taper: Array  # (n,) how the record fades in and out
    active: Array  # (channels, m) weights of the kept rows
    length: int  # of the Fourier transforms, a multiple of how far rows are apart

    @property
    def size(self) -> int:
        """Return the number of kept rows, of all channels."""
        return self.active.size

    def apply(self, residuals: Array) -> Array:
        """Return whitened residuals (channels * m,) of residuals (channels, n).

        What is cut off at the band's end is known by its kept rows: a short transform gives these alone.
        """
        spectra = rfft(residuals * self.taper, self.length, axis=1)[:, : len(self.weights)]
        weighted = np.einsum("fab,bf->af", self.weights, spectra) * self._begin
        apart = _apart(self.rows)
        kept = irfft(weighted, self.length // apart, axis=1)[:, : self.rows.size] / apart
        return np.asarray((kept * self.active).ravel())

    @cached_property
    def _begin(self) -> Complex:
        """By what each frequency turns from the record's first row to the first one that is kept."""
        first = self.rows[0] if self.rows.size else 0
        return np.asarray(np.exp(2j * np.pi * np.arange(len(self.weights)) * first / self.length))

    def back_filter(self, whitened: Array, channel: int) -> Array:
        """Return (n,) the gradient of half the squared ``whitened`` residuals by the residuals of a channel."""
        count = len(self.active)
        spread = np.zeros((count, self.length))
        spread[:, self.rows] = whitened.reshape(count, -1) * self.active
        spectra = rfft(spread, axis=1)[:, : len(self.weights)]
        total = sum(spectra[row] * np.conj(self.weights[:, row, channel]) for row in range(channel, count))
        return np.asarray(irfft(total, self.length)[: self.taper.size] * self.taper)


def independent_rows(model: ResidualModel, settings: FitSettings) -> NDArray[np.int64]:
    """Return rows (m,) so far apart that whitened residuals there are about independent, without the record's edges."""
    highest = max(model.cutoffs)
    apart = max(int(0.45 / (model.step * highest)), 1)
    edge = int(settings.edge / (model.step * highest)) + 3
    return np.arange(edge, model.size - edge, apart)


def _apart(rows: NDArray[np.int64]) -> int:
    return int(rows[1] - rows[0]) if rows.size > 1 else 1


def band_only(model: ResidualModel, settings: FitSettings) -> Whitening:
    """Return weights that only cut off each channel at its band's end."""
    rows = independent_rows(model, settings)
    length = _apart(rows) * next_fast_len(-(-2 * model.size // _apart(rows)))
    frequencies = rfftfreq(length, model.step)
    frequencies = frequencies[frequencies < max(model.cutoffs)]
    count = len(model.cutoffs)
    weights = np.zeros((frequencies.size, count, count), dtype=complex)
    for n, cutoff in enumerate(model.cutoffs):
        weights[:, n, n] = frequencies < cutoff
    # Of a band that ends below the highest one, neighbouring rows repeat each other: they count by what is independent.
    independent = np.minimum(2.0 * np.array(model.cutoffs) * _apart(rows) * model.step, 1.0)
    return Whitening(weights, rows, _taper(model), model.active[:, rows] * np.sqrt(independent)[:, None], length)


def estimate_whitening(model: ResidualModel, residuals: Array, settings: FitSettings, quiet: bool = False) -> Whitening:
    """Return the weights that residuals (channels, n) of a model ask for."""
    plain = band_only(model, settings)
    segment = min(model.size // 4, 1024)
    frequencies = welch(residuals[0], 1.0 / model.step, nperseg=segment, detrend=False)[0]
    measured = np.empty((frequencies.size, len(residuals), len(residuals)), dtype=complex)
    for row, left in enumerate(residuals):
        for column, right in enumerate(residuals):  # scipy's cross-spectrum conjugates its first signal
            measured[:, row, column] = csd(right, left, 1.0 / model.step, nperseg=segment, detrend=False)[1]
    inside = np.array([(frequencies > 0) & (frequencies < max(c, 3 * frequencies[1])) for c in model.cutoffs])
    measurement, process = _most_likely_levels(model, frequencies, measured, inside)
    if quiet:
        measurement, process = model.noise_sources(frequencies).levels, QUIET * process
    fine = rfftfreq(plain.length, model.step)[: len(plain.weights)]
    sources = model.noise_sources(fine)
    matrix = _matrix(sources.measurement, measurement) + _matrix(sources.process, process, RIDGE)
    within = np.array([fine < cutoff for cutoff in model.cutoffs])
    both = within[:, None, :] & within[None, :, :] | np.eye(len(within), dtype=bool)[:, :, None]
    factor = np.linalg.inv(np.linalg.cholesky(matrix * both.transpose(2, 0, 1)))
    scale = within / np.sqrt(np.array(model.cutoffs))[:, None]
    return Whitening(factor * scale.T[:, :, None], plain.rows, plain.taper, plain.active, plain.length)


def _matrix(transfer: Any, levels: Array, ridge: float = 0.0) -> Any:
    found = np.einsum("fcm,m,fdm->fcd", transfer, levels, np.conj(transfer))
    if ridge:
        count = found.shape[1]
        found = found + ridge * np.trace(found, axis1=1, axis2=2).real[:, None, None] * np.eye(count) / count
    return np.asarray(found)


def _most_likely_levels(
    model: ResidualModel, frequencies: Array, measured: Complex, inside: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return levels of both kinds of noise by Whittle's likelihood over the band that all channels share."""
    sources = model.noise_sources(frequencies)
    power = np.array([np.mean(measured[inside[n], n, n].real) for n in range(len(inside))])
    shared = inside.all(axis=0)
    through = np.abs(sources.process[shared]) ** 2
    reach = np.array([np.mean(np.diagonal(through, axis1=1, axis2=2)[:, min(n, through.shape[1] - 1)])
                      for n in range(sources.process.shape[2])])  # fmt: skip
    scale = np.array([power[min(n, power.size - 1)] for n in range(reach.size)]) / np.maximum(reach, 1e-300)
    transfer, response, spectra = sources.measurement[shared], sources.process[shared], measured[shared]

    def cost(measurement: float, process: Array) -> float:
        levels = np.maximum(process * scale, sources.floors)
        matrix = _matrix(transfer, measurement * sources.levels) + _matrix(response, levels, RIDGE)
        sign, determinant = np.linalg.slogdet(matrix)
        if not np.all(sign.real > 0):
            return np.inf
        return float(np.sum(determinant + np.einsum("fcd,fdc->f", np.linalg.inv(matrix), spectra).real))

    ones = np.ones(scale.size)
    pairs = [(share, part) for share in MEASUREMENT_LEVELS for part in PROCESS_LEVELS]
    measurement, common = min(pairs, key=lambda pair: cost(pair[0], pair[1] * ones))
    process = common * ones
    for n in range(scale.size if scale.size > 1 else 0):  # torques at one body need not be those at another
        trials = [np.where(np.arange(scale.size) == n, part, process) for part in PROCESS_LEVELS]
        process = min(trials, key=lambda trial: cost(measurement, trial))
    return measurement * sources.levels, np.maximum(process * scale, sources.floors)


def _taper(model: ResidualModel) -> Array:
    rows = np.arange(model.size)
    share = np.clip((rows - 3) / max(model.edges * model.size, 4), 0.0, 1.0)
    rise = 0.5 - 0.5 * np.cos(np.pi * share)
    return np.asarray(rise * rise[::-1])
