"""The loop of ``fixed_step`` in machine code: same values, same order, no interpreter between the slaves' calls.

The functions of an FMU are called by address. All else is arithmetic on preallocated arrays. It is worth its
compilation (once per machine, then cached) wherever slaves are quick.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from orchestrator.master.protocol import NativeCalls
from orchestrator.master.wiring import Wiring

Array = NDArray[np.float64]
Slots = NDArray[np.int64]

CHUNK = 2000
"""Steps between two looks at the interpreter's signals, so that an interrupt is heard."""

FUNCTIONS = ("", "fmi2SetReal", "fmi2DoStep", "fmi2GetReal", "fmi2GetInteger")
SET_REAL, DO_STEP, GET_REAL, GET_INTEGER = 1, 2, 3, 4


def _transfer_code(typing: Any, address: Any, component: Any, references: Any, count: Any, values: Any) -> Any:
    """Call ``status f(component, references, count, values)`` at ``address``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = ir.IntType(64)
        kind = ir.FunctionType(ir.IntType(32), [whole, whole, whole, whole])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.int32(types.int64, types.int64, types.int64, types.int64, types.int64), generate


def _step_code(typing: Any, address: Any, component: Any, time: Any, length: Any) -> Any:
    """Call ``status f(component, time, length, true)`` at ``address``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        real, flag = ir.DoubleType(), ir.IntType(32)
        kind = ir.FunctionType(ir.IntType(32), [ir.IntType(64), real, real, flag])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        return builder.call(function, [*arguments[1:], flag(1)])

    return types.int32(types.int64, types.int64, types.float64, types.float64), generate


_transfer: Any = intrinsic(_transfer_code)
_step: Any = intrinsic(_step_code)


@njit(cache=True)
def _gather(values, table, column, first, last, slots, sources, factors, offsets, quanta, rows):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        value = offsets[k]
        if sources[k] >= 0:
            value += factors[k] * values[sources[k]]
        if rows[k] >= 0:
            value += table[rows[k], column]
        if quanta[k] > 0.0:
            scaled = value / quanta[k]
            if abs(scaled) < 2.0**53:
                value = quanta[k] * np.rint(scaled)
        values[slots[k]] = value


@njit(cache=True)
def _advance(calls, counts, where, k, time, step):  # type: ignore[no-untyped-def]
    """Send and step one slave; return ``(status, function)``."""
    if counts[k, 0]:
        status = _transfer(calls[k, 1], calls[k, 0], where[k, 0], counts[k, 0], where[k, 3])
        if status > 1:
            return status, SET_REAL
    return _step(calls[k, 4], calls[k, 0], time, step), DO_STEP


@njit(cache=True)
def _receive(calls, counts, where, k, values, whole):  # type: ignore[no-untyped-def]
    """Read the outputs of one slave; return ``(status, function)``."""
    if counts[k, 1]:
        status = _transfer(calls[k, 2], calls[k, 0], where[k, 1], counts[k, 1], where[k, 4])
        if status > 1:
            return status, GET_REAL
    if counts[k, 2]:
        status = _transfer(calls[k, 3], calls[k, 0], where[k, 2], counts[k, 2], where[k, 5])
        if status > 1:
            return status, GET_INTEGER
        for j in range(counts[k, 2]):
            values[counts[k, 3] + j] = whole[counts[k, 4] + j]
    return np.int32(0), GET_INTEGER


@njit(cache=True)
def _run(begin, end, start, step, simultaneous, slaves, feeds, gains, table, record, values, whole, out):  # type: ignore[no-untyped-def]
    """Run steps ``begin`` to ``end - 1``; return ``(status, function, slave, step)``, status 0 when done."""
    calls, counts, where, ranges = slaves
    slots, sources, rows = feeds
    factors, offsets, quanta = gains
    for n in range(begin, end):
        time = start + n * step
        if simultaneous:
            _gather(values, table, n + 1, 0, len(slots), slots, sources, factors, offsets, quanta, rows)
        for k in range(len(calls)):
            if not simultaneous:
                _gather(values, table, n + 1, ranges[k], ranges[k + 1], slots, sources, factors, offsets, quanta, rows)
            status, function = _advance(calls, counts, where, k, time, step)
            if status <= 1 and not simultaneous:
                status, function = _receive(calls, counts, where, k, values, whole)
            if status > 1:
                return status, function, k, n
        if simultaneous:
            for k in range(len(calls)):
                status, function = _receive(calls, counts, where, k, values, whole)
                if status > 1:
                    return status, function, k, n
        for j in range(len(record)):
            out[n + 1, j] = values[record[j]]
    return np.int32(0), 0, 0, 0


class CompiledLoop:
    """The slaves of a wiring, ready for machine code.

    Args:
        wiring: bound slaves.
        natives: what each of its stages offers, in the same order.
    """

    def __init__(self, wiring: Wiring, natives: Sequence[NativeCalls]) -> None:
        self._wiring, self._natives = wiring, list(natives)
        blocks = [stage.block for stage in wiring.stages]
        base = wiring.values.ctypes.data
        firsts = np.cumsum([0, *(len(n.integers) for n in natives)])
        self._whole = np.zeros(max(int(firsts[-1]), 1), dtype=np.int32)
        calls = [[n.component, n.set_real, n.get_real, n.get_integer, n.do_step] for n in natives]
        counts, where = [], []
        for n, block, first in zip(natives, blocks, firsts[:-1].tolist(), strict=True):
            counts.append([len(n.inputs), len(n.reals), len(n.integers), block.first_output + len(n.reals), first])
            references = [a.ctypes.data for a in (n.inputs, n.reals, n.integers)]
            memory = [base + 8 * block.first_input, base + 8 * block.first_output, self._whole.ctypes.data + 4 * first]
            where.append(references + memory)
        feeds = [feed for block in blocks for feed in block.feeds]
        ranges = np.cumsum([0, *(len(block.feeds) for block in blocks)])
        self._slaves = tuple(np.array(a, dtype=np.int64) for a in (calls, counts, where, ranges))
        self._feeds = tuple(
            np.array(a, dtype=np.int64)
            for a in ([f.slot for f in feeds], [f.source for f in feeds], [f.signal for f in feeds])
        )
        self._gains = tuple(
            np.array(a, dtype=np.float64)
            for a in ([f.factor for f in feeds], [f.offset for f in feeds], [f.quantum for f in feeds])
        )

    def run(self, table: Array, start: float, step: float, simultaneous: bool, out: Array, record: Slots) -> None:
        """Run on the grid; ``out`` has shape (steps + 1, recorded), row 0 is already there.

        Raises:
            SlaveError: a slave refused or failed a call.
        """
        steps = len(out) - 1
        for begin in range(0, steps, CHUNK):
            end = min(begin + CHUNK, steps)
            status, function, slave, n = _run(
                begin, end, float(start), float(step), simultaneous, self._slaves, self._feeds, self._gains,
                table, record, self._wiring.values, self._whole, out,
            )  # fmt: skip
            if status > 1:
                what = f"{FUNCTIONS[function]} at t = {start + n * step:g} s"
                failed: Any = self._wiring.stages[slave].slave
                failed.failed(status, what)


def compiled_loop(wiring: Wiring) -> CompiledLoop | None:
    """Return the compiled loop, or ``None`` when a slave does not offer native calls."""
    natives = []
    for stage in wiring.stages:
        offer = getattr(stage.slave, "native_calls", None)
        native = None if offer is None else offer(stage.block.inputs, stage.block.outputs)
        if native is None:
            return None
        natives.append(native)
    return CompiledLoop(wiring, natives)
