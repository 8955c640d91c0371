"""Gauss-Seidel and Jacobi on the grid ``start + n * step``; time is never accumulated."""

import numpy as np

from orchestrator.master.protocol import RunEndedError
from orchestrator.master.wiring import Array, Slots, Stage, Wiring, gather


def do_step(stage: Stage, time: float, step: float) -> RunEndedError | None:
    """Step an instance; return how it ended the run, where it did so at the end of the step."""
    try:
        stage.do_step(time, step)
    except RunEndedError as error:
        if error.is_at(time + step):
            return error
        raise
    return None


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

    Raises:
        RunEndedError: a slave wants the run to end; the row of its time is there.
    """
    values, view, stages = wiring.values, wiring.view, wiring.stages
    for n in range(steps):
        time, ended = start + n * step, None
        for stage in stages:
            for target, source in stage.copies:
                target[:] = source
            if stage.mixed:
                gather(stage, view, table, n + 1)
            stage.send()
            ended = do_step(stage, time, step) or ended
            stage.receive()
        np.take(values, record, out=rows[n + 1], mode="clip")
        if ended is not None:
            raise ended


def run_simultaneous(
    wiring: Wiring, table: Array, start: float, step: float, steps: int, rows: Array, record: Slots
) -> None:
    """Step all instances with the values of the start of the step; arguments as for ``run_sequential``."""
    values, view, stages = wiring.values, wiring.view, wiring.stages
    for n in range(steps):
        time, ended = start + n * step, None
        for stage in stages:
            gather(stage, view, table, n + 1)
        for stage in stages:
            stage.send()
            ended = do_step(stage, time, step) or ended
        for stage in stages:
            stage.receive()
        np.take(values, record, out=rows[n + 1], mode="clip")
        if ended is not None:
            raise ended
