"""Responses of outputs to pulses at inputs, measured along a record.

A pulse is one sample long. Responses at several rows follow an FMU that is not linear: what is pushed at a row is
answered by the response that was measured last before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from orchestrator.diagnosis.fmu.problem import FmuModel, FmuProblem
from orchestrator.shared.arrays import Array

Complex = NDArray[np.complex128]
START_STATES = 4  # at the start that may be off, where the FMU does not let them be set
START_LEAST = 1e-3  # of the largest, that a state's response must have: less is rounding
START_LAGS = 24  # rows before the record at which what was pushed has led to its start


@dataclass(frozen=True, eq=False)
class PulseResponses:
    """What outputs answer to a pulse of one sample, over its size."""

    rows: tuple[int, ...]  # of the record at which pulses began, the first one zero
    # input -> for each of these rows, the response (n - row, outputs) from there on, over the pulse's size in the
    # input's unit
    found: dict[int, tuple[Array, ...]]
    size: int  # rows of the record

    def is_linear(self, share: float) -> bool:
        """Tell whether the responses along the record are the same."""
        for first, *others in self.found.values():
            for other in others:
                same = first[: len(other)]
                if np.linalg.norm(other - same) > share * np.linalg.norm(same):
                    return False
        return True

    def change_outputs(self, pushes: Array, place: int) -> Array:
        """Return (trials, outputs, n) what efforts (trials, n) at an input, held over samples, change."""
        length = next_fast_len(2 * self.size)
        total = np.zeros((len(pushes), self.found[place][0].shape[1], length // 2 + 1), dtype=complex)
        for spectrum, row, end in self._spectra(place, length):
            part = np.zeros_like(pushes)
            part[:, row:end] = pushes[:, row:end]
            total += rfft(part, length, axis=1)[:, None, :] * spectrum
        return np.asarray(irfft(total, length, axis=2)[:, :, : self.size])

    def gradient(self, by_outputs: Array, place: int) -> Array:
        """Return the gradient (n,) by the effort in each sample, of what has a gradient (outputs, n) by the outputs."""
        length = next_fast_len(2 * self.size)
        spectra = rfft(by_outputs, length, axis=1)
        found = np.zeros(self.size)
        for spectrum, row, end in self._spectra(place, length):
            back = irfft(np.sum(spectra * np.conj(spectrum), axis=0), length)
            found[row:end] = back[row:end]
        return found

    def frequency_response(self, frequencies: Array, step: float, memory: float) -> Complex:
        """Return the transfer (f, outputs, inputs) from efforts to outputs.

        Responses fade over a share of the record: an integrator would have no spectrum. ``frequencies`` (f,) [Hz] are
        evenly spaced from zero on.
        """
        from scipy.signal import czt

        spacing = frequencies[1] - frequencies[0]
        turn = np.exp(-2j * np.pi * spacing * step)
        columns = []
        for responses in self.found.values():
            response = responses[min(1, len(responses) - 1)]
            faded = response * np.exp(-np.arange(len(response)) / (memory * self.size))[:, None]
            columns.append(czt(faded, frequencies.size, turn, axis=0))
        return np.stack(columns, axis=2)

    def _spectra(self, place: int, length: int) -> list[tuple[Complex, int, int]]:
        """Return the spectrum (outputs, f) of each response, and the rows from one pulse to the next that it is for."""
        spectra = (rfft(response.T, length, axis=1) for response in self.found[place])
        return list(zip(spectra, self.rows, (*self.rows[1:], self.size), strict=True))


def measure_responses(problem: FmuProblem, model: FmuModel, places: Sequence[int]) -> tuple[Array, PulseResponses]:
    """Return all that is read (n, reads) in a run of a model, and its responses to pulses at some inputs."""
    count = problem.settings.pulses
    rows = tuple(int(row) for row in np.unique(np.arange(count) * problem.n // count))
    reads, runs = problem.pulse_runs(model, rows, places)
    found = {}
    for place, size, of_place in zip(places, problem.drive(places), runs, strict=True):
        responses: list[Array] = []
        for row, change in zip(rows, of_place, strict=True):
            if change is not None:
                responses.append(change[row:] / size)
            elif responses:
                responses.append(responses[-1][: problem.n - row])
            else:
                responses.append(np.zeros((problem.n - row, len(problem.outputs))))
        found[place] = tuple(responses)
    return reads, PulseResponses(rows, found, problem.n)


def start_responses(problem: FmuProblem, model: FmuModel, places: Sequence[int]) -> Array:
    """Return what another state at the start changes of the outputs, which an FMU need not let be set.

    Any state that inputs lead to is one that pulses before the record have left: what they change later on. The changes
    (k, outputs, rows), a quarter longer than the record, are the principal components of that.
    """
    reach = max(problem.n // 4, 8)
    rows = problem.n + reach
    _, runs = problem.pulse_runs(model, (0,), places, 2 * reach)
    lags = np.unique(np.geomspace(1, reach, START_LAGS).astype(int))
    found = []
    for (change,) in runs:
        if change is not None and float(np.max(np.abs(change))) > 0.0:
            scaled = change / problem.noise / float(np.max(np.abs(change / problem.noise)))
            found += [scaled[lag : lag + rows].T.ravel() for lag in lags]
    if not found:
        return np.zeros((0, len(problem.outputs), rows))
    left, sizes, _ = np.linalg.svd(np.array(found).T, full_matrices=False)
    kept = left[:, :START_STATES][:, sizes[:START_STATES] > START_LEAST * sizes[0]].T
    kept = kept.reshape(len(kept), len(problem.outputs), rows)
    kept = kept / np.max(np.abs(kept), axis=(1, 2), keepdims=True)
    return np.asarray(problem.settings.start_spread * kept * problem.noise[:, None])
