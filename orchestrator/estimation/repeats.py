"""Records of one experiment that was done again: what they do not have in common is noise, whatever the model says."""

import itertools
from collections.abc import Sequence

import numpy as np

from orchestrator.records.record import Record
from orchestrator.shared.inference.repeats import Repeats, repeat_variance

SAME_INPUT = 0.01  # rms difference of the torques over their rms: rounding and the drive's own noise stay below
SEGMENT = 2.0  # s, over which runs are compared


def in_words(repeats: Repeats) -> str:
    """Return the floor in words."""
    sides = {"theta_m": "motor", "theta_l": "load"}
    sizes = " and ".join(f"{value:.3g} rad at the {sides[name]}" for name, value in repeats.floor.items())
    return (
        f"{', '.join(repeats.sources)} have the same torque. What does not repeat over {SEGMENT:g} s, whatever the "
        f"model: {sizes} (rms)"
    )


def repeats_of(records: Sequence[Record]) -> Repeats | None:
    """Return what records with the same torque differ by."""
    if not all(record.has_torque for record in records):
        return None
    names = ("theta_m",) if records[0].theta_l is None else ("theta_m", "theta_l")
    variances, sources = [], dict[str, None]()
    for one, other in itertools.combinations((record.fill_missing() for record in records), 2):
        size = min(one.size, other.size)
        rms = float(np.sqrt(np.mean(one.u[:size] ** 2)))
        apart = float(np.sqrt(np.mean((one.u[:size] - other.u[:size]) ** 2)))
        if apart > SAME_INPUT * rms or abs(one.step - other.step) > 1e-6 * one.step:
            continue
        first, second = (np.column_stack([getattr(r, name)[:size] for name in names]) for r in (one, other))
        variances.append(repeat_variance(first, second, round(SEGMENT / one.step)))
        sources |= dict.fromkeys((one.source, other.source))
    if not variances:
        return None
    floor = np.sqrt(np.mean(variances, axis=0))
    return Repeats(tuple(sources), {name: float(value) for name, value in zip(names, floor, strict=True)})
