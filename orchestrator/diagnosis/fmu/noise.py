"""The noise of each output: what a map says of it, and what a record shows."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.diagnosis.fmu_probe_settings import ProbeSettings

Array = NDArray[np.float64]

TRIMMED = 0.7767
"""Mean magnitude of Gaussian noise of variance 1 without the largest hundredth."""
SCATTER = 1.18
"""Relative standard deviation of what third differences of white noise say of it, times the root of the rows."""


def noise_of(
    given: Map, data: Data, traces: Sequence[Array], settings: ProbeSettings
) -> tuple[Array, tuple[str, ...]]:  # fmt: skip
    """Return the noise of each output: as given, else from third differences of what no model should follow.

    A data sheet knows the encoder, not the counts, the cable and the differentiator behind it: where the record shows
    more than the map says, that is believed. Far more is something that moves, and so is more at a rate that was
    brought down. Less may be noise that was filtered.

    Args:
        traces: (n, outputs) each: what was measured, and what a model leaves of it; the smoothest counts.

    Returns:
        Shape (outputs,), in the units of the outputs; and a sentence for each output whose record shows another.
    """
    shown = np.min([third_differences(trace) for trace in traces], axis=0)
    least = 1.0 + settings.louder * SCATTER / np.sqrt(len(data.outputs))
    found, notes = [], []
    for (name, entry), rough, measured in zip(given.outputs.items(), shown, data.outputs.T, strict=True):
        if entry.noise is None:
            found.append(max(rough, 1e-9 * float(np.max(np.abs(measured))), 1e-300))
            continue
        said = entry.noise * abs(entry.factor)
        believed = data.factor == 1 and least * said < rough <= settings.loudest * said
        found.append(rough if believed else said)
        if believed:
            used = "that is used"
        elif rough > said:
            used = "the map's is used, for so much may be motion that the FMU lacks"
        else:
            used = "the map's is used, and intervals are as wide as that asks for"
        if rough > least * said or settings.quieter * rough < said:
            notes.append(
                f"output `{name}`: the map says a noise of {entry.noise:.3g}, the record shows "
                f"{rough / abs(entry.factor):.3g}: {used}"
            )
    return np.array(found), tuple(notes)


def begins_elsewhere(problem: BoxProblem, y: Array, settings: ProbeSettings) -> tuple[str, ...]:
    """Return a sentence for each output that is far from its run in the first rows: few effects are so quick.

    Args:
        y: (n, outputs) the run of the nominal model.
    """
    rows = settings.first_rows if problem.data.factor == 1 else 1
    off = np.max(np.abs(problem.residual(y)[:rows]), axis=0)
    return tuple(
        f"output `{name}` is {times:.0f} times its noise off in its first rows: it has an offset, or the record does "
        "not begin where the FMU does, and what is named may be that: say where in [start], or cut it to begin at rest"
        for name, times in zip(problem.outputs, off, strict=True)
        if times > settings.away
    )


def lone_rows(problem: BoxProblem, y: Array, settings: ProbeSettings) -> tuple[str, ...]:
    """Return a sentence for each output with rows that leave their neighbours far behind, if few.

    Args:
        y: (n, outputs) the run of the nominal model.
    """
    left = problem.residual(y)
    off = np.abs(left[1:-1] - 0.5 * (left[:-2] + left[2:]))
    padded = np.pad(off, ((1, 1), (0, 0)))
    # Beside a row alone its neighbours are off by half as much; at a jump that stays two are off by as much.
    lone = (off > settings.alone) & (off > 1.5 * padded[:-2]) & (off > 1.5 * padded[2:])
    found = []
    for name, times, rows in zip(problem.outputs, off.T, lone.T, strict=True):
        if 0 < np.count_nonzero(rows) <= settings.few * len(rows):
            worst = int(np.argmax(times))
            found.append(
                f"output `{name}` leaves its neighbours by {times[worst]:.0f} times its noise in one row at "
                f"{problem.data.time[worst + 1]:.6g} s (so many: {np.count_nonzero(rows)}): outliers of the log make a "
                "verdict `unknown`, and should be mended there"
            )
    return tuple(found)


def third_differences(trace: Array) -> Array:
    """Return the standard deviation of white noise that has the third differences of signals.

    Args:
        trace: (n, outputs).
    """
    # Their mean without the largest hundredth: a median is no measure of what comes in whole counts.
    rough = np.sort(np.abs(np.diff(trace, 3, axis=0)), axis=0)[: int(0.99 * (len(trace) - 3))]
    return np.asarray(np.mean(rough, axis=0) / TRIMMED / np.sqrt(20.0))
