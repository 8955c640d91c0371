"""Slaves that go by steps of their own: continuous outputs that stand still at some communication points."""

import math

import numpy as np

from orchestrator.master.result import RunRemark
from orchestrator.master.system import System, split
from orchestrator.shared.arrays import Array

FEWEST = 5
"""Moves of an output below which their distances tell nothing."""


def own_step_remarks(system: System, names: tuple[str, ...], rows: Array, start: float, step: float) -> list[RunRemark]:
    """Return a remark for each instance whose recorded continuous outputs move every so many communication points only.

    A slave whose own step is longer than the communication step, and is no part of it, shows outputs of another time:
    of the future where it steps beyond the communication point, of the past where it waits. ``start``: of the run [s];
    ``step``: communication step [s].
    """
    moves: dict[str, Array] = {}
    for name, column in zip(names, rows.T, strict=True):
        variable = system.variable(name)
        if (
            variable
            and variable.causality == "output"
            and (variable.type, variable.variability) == ("Real", "continuous")
        ):
            own = moves.setdefault(split(name)[0], np.zeros(len(rows) - 1, dtype=bool))
            np.logical_or(own, np.diff(column) != 0.0, out=own)
    found = []
    for instance, moved in moves.items():
        at = np.flatnonzero(moved) + 1  # communication points at which an output has another value than before
        gaps = np.diff(at)
        if len(at) < FEWEST or gaps.max() - gaps.min() > 1 or gaps.mean() < 1.5:
            continue
        digit = 10.0 ** math.ceil(math.log10(step / len(gaps)))  # what the moves leave open
        length = round(float(at[-1] - at[0]) / len(gaps) * step / digit) * digit
        most = length - step
        side = {1: f"up to {most:g} s ahead of", 0: f"up to {most:g} s behind"}
        phases = (at - 1) % gaps.max() if gaps.max() == gaps.min() else np.array([-1])
        where = side[1] if np.all(phases == 0) else side[0] if np.all(at % gaps.max() == 0) else "not at the time of"
        text = (
            f"goes by its own step of {length:.6g} s: between its steps its outputs are {where} the communication point"
        )
        found.append(
            RunRemark(instance, f"{text} (communication step {step:g} s, first seen at t = {start + at[0] * step:g} s)")
        )
    return found
