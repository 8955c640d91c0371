"""Gauss-Seidel and Jacobi on the grid ``start + n * step``; time is never accumulated."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.wiring import Wiring, gather

Array = NDArray[np.float64]
Slots = NDArray[np.int64]


def run_sequential(
    wiring: Wiring, table: Array, start: float, step: float, steps: int, rows: Array, record: Slots
) -> None:
    """Step the instances one after the other, each with the newest values there are.

    Args:
        table: signals, shape (signals, steps + 1).
        start: time of the first step [s].
        step: communication step [s].
        rows: results, shape (steps + 1, recorded); row 0 is already there.
        record: recorded slots, shape (recorded,).
    """
    values, view, stages = wiring.values, wiring.view, wiring.stages
    for n in range(steps):
        time = start + n * step
        for stage in stages:
            for target, source in stage.copies:
                target[:] = source
            if stage.mixed:
                gather(stage, view, table, n + 1)
            stage.send()
            stage.do_step(time, step)
            stage.receive()
        np.take(values, record, out=rows[n + 1], mode="clip")


def run_simultaneous(
    wiring: Wiring, table: Array, start: float, step: float, steps: int, rows: Array, record: Slots
) -> None:
    """Step all instances with the values of the start of the step; arguments as for ``run_sequential``.

    Args:
        start: [s].
        step: [s].
        rows: (steps + 1, recorded) filled from row 1 on.
        record: (recorded,) slots of the recorded signals.
    """
    values, view, stages = wiring.values, wiring.view, wiring.stages
    for n in range(steps):
        time = start + n * step
        for stage in stages:
            gather(stage, view, table, n + 1)
        for stage in stages:
            stage.send()
            stage.do_step(time, step)
        for stage in stages:
            stage.receive()
        np.take(values, record, out=rows[n + 1], mode="clip")
