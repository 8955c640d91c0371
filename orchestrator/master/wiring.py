"""Slaves bound to the slots of a layout: flat lists of bound calls, so that a step looks nothing up."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.layout import Block, Feed, Layout
from orchestrator.master.protocol import Signals, Slave, Transfer

Slots = NDArray[np.int64]
View = Any
"""A ``memoryview`` of float64: reads and writes single values and runs of them faster than an array does."""

Copy = tuple[View, View]


@dataclass(frozen=True, slots=True)
class Stage:
    """One instance, ready to be stepped."""

    slave: Slave
    block: Block  # its part of the layout
    # ``(inputs, outputs)`` pairs of equal length: runs of neighbouring slots that are mere copies
    copies: tuple[Copy, ...]
    mixed: tuple[Feed, ...]  # feeds that are more than a copy
    send: Transfer  # moves the input slots into the slave; those of clocks are not among them
    receive: Transfer  # moves the slave's outputs into its slots; likewise
    do_step: Callable[[float, float], None]  # the slave's own


@dataclass(frozen=True)
class Wiring:
    """All stages in execution order over one array of slots."""

    values: Signals  # the slots, shape (size,)
    view: View  # the same memory, quicker to read one value from
    stages: tuple[Stage, ...]
    layout: Layout


def wire(layout: Layout, slaves: Mapping[str, Slave]) -> Wiring:
    """Bind ``slaves`` to the slots of ``layout``. Return slots, all zero, and stages in execution order."""
    values = np.zeros(layout.size)
    view = values.data
    stages = tuple(_stage(block, slaves[block.name], values, view) for block in layout.blocks)
    return Wiring(values, view, stages, layout)


def nothing() -> None:
    """Move no value."""


def bind_send(slave: Slave, block: Block, names: Sequence[str], values: Signals) -> Transfer:
    """Return a call that moves some of a block's inputs from their slots into the slave."""
    if not names:
        return nothing
    slots = np.array([block.first_input + block.inputs.index(name) for name in names])
    buffer = np.empty(len(names))
    move = slave.sends(names, buffer)

    def send() -> None:
        np.take(values, slots, out=buffer, mode="clip")
        move()

    return send


def bind_receive(slave: Slave, block: Block, names: Sequence[str], values: Signals) -> Transfer:
    """Return a call that moves some of a block's outputs from the slave into their slots."""
    if not names:
        return nothing
    slots = np.array([block.first_output + block.outputs.index(name) for name in names])
    buffer = np.empty(len(names))
    move = slave.receives(names, buffer)

    def receive() -> None:
        move()
        values[slots] = buffer

    return receive


def _stage(block: Block, slave: Slave, values: Signals, view: View) -> Stage:
    inputs = values[block.first_input : block.first_input + len(block.inputs)]
    outputs = values[block.first_output : block.first_output + len(block.outputs)]
    clocked = slave.model.clocked
    if clocked:
        free = [name for name in block.inputs if name not in clocked]
        send = bind_send(slave, block, free, values)
        receive = bind_receive(slave, block, [name for name in block.outputs if name not in clocked], values)
    else:
        send = slave.sends(block.inputs, inputs) if block.inputs else nothing
        receive = slave.receives(block.outputs, outputs) if block.outputs else nothing
    return Stage(
        slave=slave,
        block=block,
        copies=_copies(block.feeds, view),
        mixed=tuple(feed for feed in block.feeds if not feed.plain),
        send=send,
        receive=receive,
        do_step=slave.do_step,
    )


def _copies(feeds: tuple[Feed, ...], view: View) -> tuple[Copy, ...]:
    runs: list[list[int]] = []
    for feed in feeds:
        if not feed.plain:
            continue
        if runs and feed.slot == runs[-1][0] + runs[-1][2] and feed.source == runs[-1][1] + runs[-1][2]:
            runs[-1][2] += 1
        else:
            runs.append([feed.slot, feed.source, 1])
    return tuple((view[slot : slot + n], view[source : source + n]) for slot, source, n in runs)


def gather(stage: Stage, view: View, table: NDArray[np.float64], column: int) -> None:
    """Fill the input slots of a stage from outputs and from ``column`` of the signals; see ``Layout.signal_table``."""
    for target, source in stage.copies:
        target[:] = source
    for feed in stage.mixed:
        value = feed.offset
        if feed.source >= 0:
            value += feed.factor * view[feed.source]
        if feed.signal >= 0:
            value += table[feed.signal, column]
        if feed.quantum > 0.0:
            value = _round_to_quantum(value, feed.quantum)
        view[feed.slot] = value


def _round_to_quantum(value: float, quantum: float) -> float:
    """Return the multiple of ``quantum`` nearest to ``value``; what is not finite stays as it is."""
    scaled = value / quantum
    return quantum * round(scaled) if abs(scaled) < 2.0**53 else value
