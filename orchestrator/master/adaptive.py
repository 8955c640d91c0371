"""Continuous loops to a tolerance: windows of iterated waveforms, with rollback and error control.

A window of time is cut into two cells. Each sweep restores all slaves to the start of the window and steps them one
after the other through it; the outputs read at the three nodes give, by quadratic interpolation, the inputs of the
slaves that take them, as constant pieces with the right moments (``pieces``). The first sweep starts from extrapolated
outputs; two sweeps leave an error of order five in the window's length, so that smooth loops converge with order four.

The error is estimated by step doubling: the window once as a whole, then in two halves, for which the whole is so good
a guess that two sweeps do. The halves are kept. A jump or a kink inside a window, such as a tooth that makes contact,
shows as a large difference: the window is undone and shortened until the event's effect is below the tolerance, then
windows grow again, no faster than the time since the event. They end where a source jumps.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import ConvergenceError, ScenarioError
from orchestrator.master.algorithms import Adaptive
from orchestrator.master.layout import Layout
from orchestrator.master.pieces import CELLS, NODES, piece_times, piece_weights
from orchestrator.master.protocol import RunEndedError, StepDiscardedError
from orchestrator.master.result import Statistics
from orchestrator.master.rollback import rollback
from orchestrator.master.signals import GRID_SLACK, Signal
from orchestrator.master.waveform import Waveform
from orchestrator.master.wiring import Slots, Stage, Wiring
from orchestrator.shared.arrays import Array

SWEEPS = 2
SAFETY, SHRINK, GROW = 0.9, 0.1, 8.0
EVENT_SHARE = 0.03
"""Error allowed over an event: halving the window does not reduce it much, as it does in a smooth window."""

SHORT = 0.02
"""A window that is shorter than this part of the longest one is so because of an event."""

SUSPICIOUS = 100.0
"""Error beyond which a window is taken to hold an event rather than to be too long."""

TELLING = 0.05
"""A window that is shorter than this part of the next one tells nothing of the error between that one's nodes."""

CAUTION = 1.0
"""Longest window after an event as a multiple of the time since then."""

HOPELESS = 30.0
"""Error at the middle of a window beyond which its second half is not worth stepping."""
ORDER = 5
"""Order, in a smooth window's length, of the error after it."""


@dataclass(frozen=True)
class _Attempt:
    """What came of one window."""

    outputs: Waveform | None  # over the window; ``None`` when it was undone
    guess: Waveform | None  # for the next window
    error: float  # estimate as a multiple of the tolerance
    length: float  # of the window [s]
    trouble: float  # time [s] by which the trouble has come, for a window that was undone


@dataclass(frozen=True)
class _Event:
    """A jump or kink somewhere between ``start``, where a window failed, and ``end`` [s], with that window's error."""

    start: float
    end: float
    error: float

    def window_end(self, time: float) -> float:
        """Return where to try next: across the event if it is near enough for its effect to pass, else half way."""
        left, tried = self.end - time, self.end - self.start
        across = math.isfinite(self.error) and self.error * left <= 0.5 * EVENT_SHARE * tried
        return self.end if across else time + 0.5 * left

    def was_none(self, attempt: _Attempt) -> bool:
        """Whether a good window's error fits a smooth one, so that the failed window was merely too long."""
        smooth = self.error * (attempt.length / (self.end - self.start)) ** ORDER
        return attempt.error > 0.1 * smooth


def check_adaptive(layout: Layout) -> None:
    """Refuse a system that cannot go back or that holds values by itself."""
    for instance in layout.system.instances:
        model = instance.model
        if not (model.can_save_state and model.can_vary_step):
            lack = "save its state" if model.can_vary_step else "vary its step"
            raise ScenarioError(
                f"$.master.algorithm: must not be 'adaptive', but is, and {instance.name} cannot {lack}"
            )
    for k, connection in enumerate(layout.system.connections):
        if connection.quantum > 0.0:
            raise ScenarioError(
                f"$.connections[{k}].quantum: must be 0 under 'adaptive', but is {connection.quantum!r}"
            )


def window_end(time: float, length: float, target: float) -> float:
    """Return where a window from ``time`` [s] ends, of a ``length`` that leaves no little one before ``target`` [s]."""
    left = target - time
    if left <= 1.01 * length:
        return target
    return time + (min(length, 0.5 * left) if left < 2.0 * length else length)


def next_length(length: float, error: float, largest: float) -> float:
    """Return the length [s] to try after a window of that ``length`` with an ``error`` in multiples of the allowed."""
    excess = max(error, 1e-12)
    factor = SAFETY * excess ** (-1.0 / ORDER) if math.isfinite(excess) else SHRINK
    return min(length * min(max(factor, SHRINK), GROW), largest)


def largest_difference(values: Array, reference: Array, slots: Slots, tolerance: float) -> float:
    """Return the largest difference of some slots as a multiple of the tolerance; shape (..., slots) each."""
    a, b = values[..., slots], reference[..., slots]
    error = float(np.max(np.abs(a - b) / (tolerance * np.maximum(1.0, np.abs(b))), initial=0.0))
    return error if math.isfinite(error) else math.inf


def source_nodes(layout: Layout, signals: Sequence[Signal], times: Array, jumps: bool, stop: float) -> Array:
    """Return what the sources add at times, shape (rows, times): the left limit at the last where one ``jumps``."""
    inside = times.copy()
    if jumps:
        # Signals take a time just before a jump for the jump itself, by up to GRID_SLACK of their period.
        inside[-1] -= max(1e-6 * (times[-1] - times[0]), 4.0 * GRID_SLACK * max(1.0, abs(stop)))
    table = np.zeros((len(layout.signals), len(times)))
    for k, parts in enumerate(layout.signals):
        for index, factor, offset, _ in parts:
            table[k] += factor * signals[index].sample(inside) + offset
    return table


class AdaptiveRun:
    """One run of slaves without events: the windows, their lengths and the recorded points.

    Args:
        signals: signals in place of those of ``System.sources``, by index.
        start: [s].
        stop: [s].
        settings: tolerance and bounds of the step.
        rows: results, shape (grid points, recorded); row 0 is already there.
        record: slots of the recorded signals, shape (recorded,).
    """

    def __init__(
        self,
        wiring: Wiring,
        signals: Mapping[int, Signal],
        start: float,
        stop: float,
        settings: Adaptive,
        rows: Array,
        record: NDArray[np.int64],
    ) -> None:
        check_adaptive(wiring.layout)
        self.wiring, self.settings, self.rows, self.record = wiring, settings, rows, record
        self.start, self.stop = start, stop
        system = wiring.layout.system
        self.signals = [signals.get(k, source.signal) for k, source in enumerate(system.sources)]
        self.breaks = sorted({t for s in self.signals for t in s.breaks(start, stop)} | {stop})
        self.held = np.array([self._is_held(address) for address in wiring.layout.slots], dtype=bool)
        self.outputs = np.array(
            [b.first_output + j for b in wiring.layout.blocks for j in range(len(b.outputs))], dtype=np.int64
        )
        self.outputs = self.outputs[~self.held[self.outputs]]
        self.closing = {b.name: self._feeds_through(b.name) for b in wiring.layout.blocks}
        self.before: Waveform | None = None  # the window before the present one, unless a jump lies between them
        self.accepted = self.rejected = self.sweeps = 0
        self.calls = dict.fromkeys((b.name for b in wiring.layout.blocks), 0)

    def _is_held(self, address: str) -> bool:
        variable = self.wiring.layout.system.variable(address)
        return variable is not None and (variable.type != "Real" or variable.variability == "discrete")

    def _feeds_through(self, name: str) -> bool:
        block = next(b for b in self.wiring.layout.blocks if b.name == name)
        instance = self.wiring.layout.system.instance(name)
        assert instance is not None
        outputs = [o for o in block.outputs if instance.model.variables[o].causality == "output"]
        return any(i in instance.model.depends_on(o) for o in outputs for i in block.inputs)

    def run(self) -> Statistics:
        time, length = self.start, min(self.settings.first, self.settings.largest)
        row, longest = 1, 0.0
        for target in self.breaks:
            guess = self.before = None
            # Nothing is known yet of what comes after the jump, and nothing shows what a window does between its nodes.
            length = min(length, self.settings.largest / GROW)
            event: _Event | None = None
            crossed = -math.inf
            while time < target:
                end = window_end(time, length, target) if event is None else event.window_end(time)
                short = event is not None or end - time < SHORT * longest
                share = EVENT_SHARE if short else 1.0
                attempt = self._attempt(time, end, guess, share)
                guess = attempt.guess
                if attempt.outputs is None:
                    self.rejected += 1
                    if event is not None or attempt.error > SUSPICIOUS:
                        event = _Event(time, attempt.trouble, attempt.error)
                    length = next_length(attempt.length, attempt.error / share, self.settings.largest)
                    self._give_up(time, (event.window_end(time) - time) if event else length)
                    continue
                row = self._write(attempt.outputs, row)
                self.before = attempt.guess
                self.accepted += 1
                longest = max(longest, attempt.length)
                length = next_length(attempt.length, attempt.error / share, self.settings.largest)
                if event is not None and (end >= event.end or event.was_none(attempt)):
                    crossed, event = end, None
                time = end
                # Held inputs must not take a slave back across the event that it has just passed.
                length = min(length, max(attempt.length, CAUTION * (time - crossed)))
        return Statistics(self.accepted, self.rejected, self.calls, self.sweeps)

    def _give_up(self, time: float, length: float) -> None:
        if length < self.settings.smallest:
            raise ConvergenceError(
                f"t = {time:.9g} s: a tolerance of {self.settings.tolerance:g} would take a step below "
                f"{self.settings.smallest:g} s; use a larger tolerance, or algorithm 'iterated' for an algebraic loop"
            )

    def _attempt(self, start: float, end: float, guess: Waveform | None, share: float) -> _Attempt:
        """Try one window; leave the slaves at its end when its error is within ``share``, else at its start."""
        middle, length = 0.5 * (start + end), end - start
        with rollback(self.wiring) as restore:
            try:
                whole = self._sweep(start, end, guess)
                restore()
                first = self._sweep(start, middle, whole)
                error = self._difference(whole.nodes[CELLS // 2], first.nodes[-1])
                if error > HOPELESS:
                    restore()
                    return _Attempt(None, first, error, length, end)
                second = self._sweep(middle, end, whole)
            except RunEndedError:
                raise
            except StepDiscardedError:
                restore()
                return _Attempt(None, None, math.inf, length, end)
            error = self._difference(whole.nodes[-1], second.nodes[-1])
            if error <= share:
                both = Waveform(start, end, np.concatenate((first.nodes, second.nodes[1:])))
                # Beside an event the window before may have held it, and tells nothing of this one.
                between = self._between(both) if share == 1.0 else 0.0
                if between <= 1.0:
                    return _Attempt(both, second, max(error, between), length, end)
                error = min(between, SUSPICIOUS)
            restore()
            return _Attempt(None, whole if math.isfinite(error) else None, error, length, end)

    def _between(self, window: Waveform) -> float:
        """Return the error of recorded points between the nodes as a multiple of the tolerance."""
        step = self.settings.step
        first = math.ceil((window.start - self.start) / step * (1.0 + 1e-12) + 1e-9)
        times = self.start + step * np.arange(first, math.ceil((window.end - self.start) / step - 1e-9))
        before = self.before
        if before is None or not len(times) or before.end - before.start < TELLING * (window.end - window.start):
            return 0.0
        signals = self.record[~self.held[self.record]]
        scale = self.settings.tolerance * np.maximum(1.0, np.abs(window.nodes[-1, signals]))
        error = float(np.max(np.abs(window.error_between(before, times)[:, signals]) / scale, initial=0.0))
        return error if math.isfinite(error) else SUSPICIOUS

    def _difference(self, values: Array, reference: Array) -> float:
        return largest_difference(values, reference, self.outputs, self.settings.tolerance)

    def _sweep(self, start: float, end: float, guess: Waveform | None) -> Waveform:
        """Step all slaves from ``start`` to ``end`` [s], ``SWEEPS`` times over, and return the outputs in between."""
        times = start + (end - start) * np.arange(NODES) / CELLS
        initial = self.wiring.values.copy()
        nodes = np.tile(initial, (NODES, 1))
        if guess is not None:
            guessed = guess.at(times)[:, self.outputs]
            nodes[1:, self.outputs] = guessed[1:] + (initial[self.outputs] - guessed[0])
        feeds = source_nodes(self.wiring.layout, self.signals, times, times[-1] in self.breaks, self.stop)
        with rollback(self.wiring) as restore:
            for sweep in range(SWEEPS):
                if sweep:
                    restore()
                self.sweeps += 1
                for stage in self.wiring.stages:
                    self._advance(stage, start, end, nodes, feeds)
        return Waveform(start, end, nodes)

    def _advance(self, stage: Stage, start: float, end: float, nodes: Array, feeds: Array) -> None:
        """Step one slave through the window and read its outputs at the nodes."""
        block, values = stage.block, self.wiring.values
        closing = self.closing[block.name]
        inputs = slice(block.first_input, block.first_input + len(block.inputs))
        outputs = slice(block.first_output, block.first_output + len(block.outputs))
        constants = piece_weights(closing) @ self._input_nodes(stage, nodes, feeds)
        times, at_node = piece_times(start, end, closing)
        node = 1
        for k, ends_cell in enumerate(at_node):
            if block.inputs:
                values[inputs] = constants[k]
                stage.send()
            stage.do_step(times[k], times[k + 1] - times[k])
            self.calls[block.name] += 1
            if ends_cell:
                stage.receive()
                nodes[node, outputs] = values[outputs]
                nodes[node, inputs] = values[inputs]
                node += 1

    def _input_nodes(self, stage: Stage, nodes: Array, feeds: Array) -> Array:
        columns = np.empty((NODES, len(stage.block.feeds)))
        for k, feed in enumerate(stage.block.feeds):
            column = np.full(NODES, feed.offset)
            if feed.source >= 0:
                source = nodes[:, feed.source]
                column += feed.factor * (source[0] if self.held[feed.source] else source)
            if feed.signal >= 0:
                column += feeds[feed.signal]
            columns[:, k] = column
        return columns

    def _write(self, waveform: Waveform, row: int) -> int:
        """Fill in the recorded points up to the end of the window; return the next one's number."""
        step, last = self.settings.step, len(self.rows) - 1
        slack = 1e-9 * step
        first = row
        while row <= last and self.start + row * step <= waveform.end + slack:
            row += 1
        if row > first:
            times = np.minimum(self.start + step * np.arange(first, row), waveform.end)
            block = waveform.at(times)
            last_node = len(waveform.nodes) - 1
            node = np.floor((times - waveform.start) / (waveform.end - waveform.start) * last_node + 1e-9).astype(
                np.int64
            )
            block[:, self.held] = waveform.nodes[node][:, self.held]
            self.rows[first:row] = block[:, self.record]
        return row
