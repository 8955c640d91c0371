"""Columns whose rows are not those of the motor's angle, or not uniform, brought to rows that are.

The torque is held from its own row to the next, whatever is asked for; what was measured is interpolated as it is asked
for.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.records.columns import COLUMNS
from orchestrator.records.requests import SAMPLED, hold_request
from orchestrator.records.timing import has_gap, interpolate, interpolation_cost, resample_grid
from orchestrator.records.words import INTERPOLATION
from orchestrator.shared.arrays import Array

Table = dict[str, Array]


def bring_to_motor(
    table: Table, own_times: Mapping[str, Array], labels: Mapping[str, str], path: Path, how: str | None
) -> tuple[Table, float, list[str]]:
    """Return columns of other rasters at the rows of the motor's.

    Args:
        table: columns in SI, ``time`` that of the motor's raster.
        own_times: times [s] of the columns whose rows are others, on the clock of ``time``.
        labels: names in the file.
        how: to interpolate angles: "linear" or "cubic"; else they are refused.

    Returns:
        The columns, the step of the torque's own rows [s] where they are rarer (else 0.0), and what was done.
    """
    raster, notes = 0.0, []
    table = dict(table)
    for name in sorted(own_times, key=lambda name: name == "u"):  # rows without a torque go once all columns have them
        stamps, label = own_times[name], labels[name]
        if stamps.size == table["time"].size and np.array_equal(stamps, table["time"]):
            continue
        if name == "u":
            table, raster, note = _hold(table, stamps, label, path)
            notes.append(note)
            continue
        if how not in INTERPOLATION:
            raise RecordError(
                f"{path}: column `{label}` has its own time stamps: state how to interpolate it to those of "
                f"`{labels['theta_m']}`: `resample` linear or cubic"
            )
        cost = interpolation_cost(stamps, table[name], how)
        table[name] = interpolate(table["time"], stamps, table[name], how)
        notes.append(f"{label} resampled ({how}), error about {cost:.2g} rad (rms)")
    return table, raster, notes


def _hold(table: Table, stamps: Array, label: str, path: Path) -> tuple[Table, float, str]:
    """Return the columns with the torque at the motor's rows, and the words for it; rows without a torque go."""
    good = np.isfinite(table["time"])
    table = {name: values if name == "u" else values[good] for name, values in table.items()}
    time = table["time"]
    if time.size < 2 or np.any(np.diff(time) <= 0.0):
        return table | {"u": np.full(time.size, np.nan)}, 0.0, ""  # the checks of the record say what is wrong
    request = hold_request(time, stamps, table["u"], label, str(path))
    table["u"] = request.held
    if request.sampled is not None:
        table[SAMPLED] = request.sampled
    known = np.flatnonzero(np.isfinite(request.held))
    rows = slice(int(known[0]), int(known[-1]) + 1) if known.size else slice(0, 0)
    lost = time.size - (rows.stop - rows.start)
    return {name: values[rows] for name, values in table.items()}, request.raster, request.describe(label, lost)


def make_uniform(table: Table, how: str | None) -> tuple[Table, list[str]]:
    """Return all columns at a uniform grid of the same mean rate, when asked for, and what it costs."""
    if how not in INTERPOLATION:
        return table, []
    good = np.isfinite(table["time"])
    table = {name: values[good] for name, values in table.items()}
    time = table["time"]
    if time.size < 8 or np.any(np.diff(time) <= 0.0):
        return table, []  # the checks of the record say what is wrong
    grid, step = resample_grid(time)
    if grid.size == time.size and np.allclose(grid, time, rtol=0.0, atol=1e-3 * step):
        return table, []
    if grid.size > 2 * time.size:
        return table, []
    out, spoken = {"time": grid}, []
    for name, values in table.items():
        if name in ("u", SAMPLED):
            request = hold_request(grid, time, values, name, "record")
            out[name] = np.where(has_gap(grid, time), np.nan, request.held)
            spoken += [f"u {request.within:.2g} N.m, held from row to row"] if name == "u" else []
        elif name != "time":
            out[name] = interpolate(grid, time, values, how)
            spoken += [f"{name} {interpolation_cost(time, values, how):.2g} rad"] if name in COLUMNS else []
    low, high = np.quantile(1e3 * np.diff(time), (0.05, 0.95))
    text = (
        f"angles resampled ({how}) to {1.0 / step:.6g} Hz, the mean rate of steps of {low:.3g} to {high:.3g} ms; "
        f"error of that about (rms): {', '.join(spoken)}"
    )
    return out, [text]
