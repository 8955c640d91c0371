"""Gauss-Seidel and Jacobi on the grid ``start + n * step``; time is never accumulated."""

from collections.abc import Sequence

import numpy as np

from orchestrator.master.protocol import RunEndedError
from orchestrator.master.wiring import Slots, Stage, View, Wiring, gather
from orchestrator.shared.arrays import Array


def do_step(stage: Stage, time: float, step: float) -> RunEndedError | None:
    """Step an instance; return how it ended the run, where it did so at the end of the step."""
    try:
        stage.do_step(time, step)
    except RunEndedError as error:
        if error.is_at(time + step):
            return error
        raise
    return None


def step_in_turn(
    stages: Sequence[Stage], view: View, table: Array, column: int, time: float, step: float
) -> RunEndedError | None:
    """Step instances one after the other with the newest values; return how one ended the run at the step's end."""
    ended = None
    for stage in stages:
        gather(stage, view, table, column)
        stage.send()
        ended = do_step(stage, time, step) or ended
        stage.receive()
    return ended


def step_side_by_side(
    stages: Sequence[Stage], view: View, table: Array, column: int, time: float, step: float
) -> RunEndedError | None:
    """Step instances with the values of the start of the step; return how one ended the run at the step's end."""
    ended = None
    for stage in stages:
        gather(stage, view, table, column)
    for stage in stages:
        stage.send()
        ended = do_step(stage, time, step) or ended
    for stage in stages:
        stage.receive()
    return ended


def run_fixed_step(
    wiring: Wiring, table: Array, start: float, step: float, simultaneous: bool, rows: Array, record: Slots
) -> None:
    """Step all instances on the grid.

    Args:
        table: signals, shape (signals, steps + 1).
        start: time of the first step [s].
        step: communication step [s].
        simultaneous: side by side (Jacobi), else in turn (Gauss-Seidel).
        rows: results, shape (steps + 1, recorded); row 0 is already there.
        record: recorded slots, shape (recorded,).
    """
    advance = step_side_by_side if simultaneous else step_in_turn
    for n in range(len(rows) - 1):
        ended = advance(wiring.stages, wiring.view, table, n + 1, start + n * step, step)
        np.take(wiring.values, record, out=rows[n + 1], mode="clip")
        if ended is not None:
            raise ended
