"""Algebraic loops: values that depend on one another at the same instant, solved by repeating with rollback."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import ScenarioError
from orchestrator.master.fixed_point import solve_fixed_point
from orchestrator.master.fixed_step import step_in_turn
from orchestrator.master.layout import Layout
from orchestrator.master.protocol import RunEndedError
from orchestrator.master.wiring import Slots, Stage, Wiring, gather
from orchestrator.shared.arrays import Array


def backward_slots(layout: Layout, names: Iterable[str]) -> Slots:
    """Return the output slots that an instance of ``names`` takes from itself or from one that is stepped later.

    Fixing their values fixes what one pass over the instances computes: they are the unknowns of the loop.
    """
    position = {block.name: k for k, block in enumerate(layout.blocks)}
    owner = {block.first_output + j: block.name for block in layout.blocks for j in range(len(block.outputs))}
    cut = {
        feed.source
        for block in layout.blocks
        for feed in block.feeds
        if feed.source >= 0 and block.name in names and owner[feed.source] in names
        if position[owner[feed.source]] >= position[block.name]
    }
    return np.array(sorted(cut), dtype=np.int64)


def initialise(wiring: Wiring, cut: Slots, table: Array, tolerance: float, iterations: int) -> int:
    """Make inputs and outputs agree while all slaves are in initialisation; return the number of passes."""
    values, view = wiring.values, wiring.view
    for stage in wiring.stages:
        stage.receive()

    def sweep(point: Array) -> Array:
        values[cut] = point
        for stage in wiring.stages:
            gather(stage, view, table, 0)
            stage.send()
            stage.receive()
        return values[cut]

    return solve_fixed_point(sweep, values[cut], tolerance, iterations, "initialisation")


@dataclass(frozen=True, slots=True)
class Iterated:
    """Gauss-Seidel, each step repeated with rollback until the values that the instances of a loop exchange settle."""

    step: float  # communication step [s]
    tolerance: float = 1e-10  # largest change of an exchanged value, relative to ``max(1, |value|)``
    iterations: int = 50  # most passes per step

    def run(self, wiring: Wiring, table: Array, start: float, steps: int, rows: Array, record: Slots) -> int:
        """Run on the grid, each algebraic loop until what it exchanges settles; see ``FixedStepLoop``."""
        groups = loop_groups(wiring)
        passes = 0
        for n in range(steps):
            time, ended = start + n * self.step, None
            for stages, cut in groups:
                found: RunEndedError | None
                if len(cut) == 0:
                    found = step_in_turn(stages, wiring.view, table, n + 1, time, self.step)
                    passes += 1
                else:
                    count, found = _solve(stages, cut, wiring, table, n + 1, time, self)
                    passes += count
                ended = found or ended
            np.take(wiring.values, record, out=rows[n + 1], mode="clip")
            if ended is not None:
                raise ended
        return passes


def loop_groups(wiring: Wiring) -> list[tuple[tuple[Stage, ...], Slots]]:
    """Return the stages in execution order, those of one algebraic loop together, with the unknowns of each loop."""
    loops = wiring.layout.system.loops()
    groups: list[tuple[tuple[Stage, ...], Slots]] = []
    done: set[str] = set()
    for stage in wiring.stages:
        name = stage.block.name
        if name in done:
            continue
        loop = next((g for g in loops if name in g), (name,))
        stages = tuple(s for s in wiring.stages if s.block.name in loop)
        cut = backward_slots(wiring.layout, loop) if loop in loops else np.zeros(0, dtype=np.int64)
        for member in stages if len(cut) else ():
            if not member.slave.model.can_save_state:
                raise ScenarioError(
                    f"$.master.algorithm: must not be 'iterated', but is, and {member.block.name} of the loop "
                    f"{', '.join(loop)} cannot save its state"
                )
        groups.append((stages, cut))
        done.update(s.block.name for s in stages)
    return groups


def _solve(
    stages: tuple[Stage, ...],
    cut: NDArray[np.int64],
    wiring: Wiring,
    table: Array,
    column: int,
    time: float,
    settings: Iterated,
) -> tuple[int, RunEndedError | None]:
    """Step a loop until it settles; return the number of passes, and how one ended the run in the last of them."""
    values = wiring.values
    saved: list[tuple[Stage, Any]] = [(stage, stage.slave.get_state()) for stage in stages]
    first, ended = True, None

    def sweep(point: Array) -> Array:
        nonlocal first, ended
        if not first:
            for stage, state in saved:
                stage.slave.set_state(state)
        first = False
        values[cut] = point
        ended = step_in_turn(stages, wiring.view, table, column, time, settings.step)
        return values[cut]

    try:
        what = f"{', '.join(s.block.name for s in stages)} at t = {time:g} s"
        count = solve_fixed_point(sweep, values[cut], settings.tolerance, settings.iterations, what)
        return count, ended
    finally:
        for stage, state in saved:
            stage.slave.free_state(state)
