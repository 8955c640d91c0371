"""The loop of ``fixed_step`` in machine code (``loop.c``): same values, same order, no interpreter between the calls.

It takes slaves whose functions can be called by address: FMUs in any language. Without a C compiler there is none, and
the Python loop gives the same bits.
"""

import ctypes
import re
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.master.protocol import NativeCalls, NativeTransfer
from orchestrator.master.wiring import Slots, Wiring
from orchestrator.shared.arrays import Array
from orchestrator.shared.machine_code import compile_library

SOURCE = Path(__file__).with_name("loop.c")
NUMBERS = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "b1")
"""Types of values in C, in the order of ``loop.c``."""

FIRST_CHUNK, MOST_STEPS = 64, 1 << 20
CHUNK_TIME = 0.1
"""Seconds between two looks at the interpreter's signals, so that an interrupt is heard."""

_Address, _Whole, _Real = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


def _structures() -> dict[str, Any]:
    """Return the structures that ``loop.c`` declares, by their names: of whole numbers, reals and addresses."""
    code = re.sub(r"/\*.*?\*/", "", SOURCE.read_text(encoding="utf-8"), flags=re.DOTALL)
    kinds = {"int64_t": _Whole, "double": _Real}
    found: dict[str, Any] = {}
    for body, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", code, re.DOTALL):
        fields = [(word, kinds.get(kind.strip(), _Address)) for kind, word in re.findall(r"([\w ]+[ *])(\w+);", body)]
        found[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
    return found


_Transfer, _Slave, _Feed, _Run, _Failure = _structures().values()


@cache
def _load_loop(holds_lock: bool) -> Any:
    """Return ``run_steps`` of the compiled ``loop.c``, or ``None``."""
    path = compile_library(SOURCE)
    if path is None:
        return None
    try:
        function = (ctypes.PyDLL if holds_lock else ctypes.CDLL)(str(path)).run_steps
    except OSError:
        return None
    function.argtypes = [ctypes.c_void_p, _Whole, _Whole, ctypes.c_void_p]
    function.restype = ctypes.c_int
    return function


def prepare() -> None:
    """Compile the loop now, for child processes behind walls, which cannot."""
    compile_library(SOURCE)


def _transfers(transfers: Sequence[NativeTransfer]) -> Any:
    """Return transfers as ``loop.c`` takes them; the arrays of references must live as long."""
    return (_Transfer * max(len(transfers), 1))(
        *(
            _Transfer(
                t.function, t.references.ctypes.data, len(t.references), t.count, NUMBERS.index(t.number), t.sized
            )
            for t in transfers
        )
    )


def _call_name(native: NativeCalls, call: int) -> str:
    """Return the name of a call, as ``loop.c`` counts them."""
    return [*(t.name for t in native.inputs), native.step_name, *(t.name for t in native.outputs)][call]


class CompiledWiring:
    """The slaves of a wiring, ready for machine code.

    ``natives``: what each of its stages offers, in the same order.
    """

    def __init__(self, wiring: Wiring, natives: Sequence[NativeCalls], run_steps: Any) -> None:
        self._wiring, self._natives, self._run_steps = wiring, list(natives), run_steps
        blocks = [stage.block for stage in wiring.stages]
        longest = max((t.count for n in natives for t in (*n.inputs, *n.outputs)), default=1)
        self._scratch = np.zeros(longest, dtype=np.int64)
        self._transfers = [(_transfers(n.inputs), _transfers(n.outputs)) for n in natives]
        feeds = [feed for block in blocks for feed in block.feeds]
        self._feeds = (_Feed * max(len(feeds), 1))(
            *(_Feed(f.slot, f.source, f.signal, f.plain, f.factor, f.offset, f.quantum) for f in feeds)
        )
        self._slaves = (_Slave * len(blocks))()
        first = 0
        for slave, native, transfers, block in zip(self._slaves, natives, self._transfers, blocks, strict=True):
            slave.component, slave.step, slave.reports = native.component, native.do_step, native.reports
            slave.inputs, slave.outputs = map(ctypes.addressof, transfers)
            slave.input_transfers, slave.output_transfers = len(native.inputs), len(native.outputs)
            slave.scratch = self._scratch.ctypes.data
            slave.first_input, slave.first_output = block.first_input, block.first_output
            slave.first_feed, slave.feeds = first, len(block.feeds)
            first += len(block.feeds)

    def run(self, table: Array, start: float, step: float, simultaneous: bool, out: Array, record: Slots) -> None:
        """Run on the grid ``start + n step`` [s]; ``out`` has shape (steps + 1, recorded), with row 0 there.

        ``record``: (recorded,) slots of the recorded signals.
        """
        table, record = np.ascontiguousarray(table), np.ascontiguousarray(record)
        assert out.flags.c_contiguous
        job = _Run(
            ctypes.addressof(self._slaves), ctypes.addressof(self._feeds), self._wiring.values.ctypes.data,
            table.ctypes.data, record.ctypes.data, out.ctypes.data, len(self._slaves), table.shape[1], len(record),
            start, step, simultaneous,
        )  # fmt: skip
        for slave in self._slaves:
            slave.warnings = slave.astray = 0
            slave.farthest = 0.0
        try:
            self._run(job, out, start, step)
        finally:
            for slave, native, stage in zip(self._slaves, self._natives, self._wiring.stages, strict=True):
                called: Any = stage.slave
                if slave.warnings:
                    name = _call_name(native, slave.first_call)
                    called.note_warnings(slave.warnings, name, start + slave.first_step * step)
                if slave.astray:
                    called.came_elsewhere(slave.astray, start + slave.first_astray * step, slave.farthest)

    def _run(self, job: Any, out: Array, start: float, step: float) -> None:
        failure = _Failure()
        steps, begin, chunk = len(out) - 1, 0, FIRST_CHUNK
        while begin < steps:
            end, clock = min(begin + chunk, steps), time.perf_counter()
            status = self._run_steps(ctypes.byref(job), begin, end, ctypes.byref(failure))
            if status:
                failed: Any = self._wiring.stages[failure.slave].slave
                name = _call_name(self._natives[failure.slave], failure.call)
                reached = self._slaves[failure.slave].reached
                failed.raise_for_status(status, name, start + failure.step * step, reached, step)
            taken = time.perf_counter() - clock
            chunk = (
                min(2 * chunk, MOST_STEPS) if taken < 0.5 * CHUNK_TIME else max(1, round(chunk * CHUNK_TIME / taken))
            )
            begin = end


def compile_loop(wiring: Wiring) -> CompiledWiring | None:
    """Return the compiled loop, or ``None`` when a slave does not offer native calls or nothing can compile it."""
    natives = []
    for stage in wiring.stages:
        offer = getattr(stage.slave, "native_calls", None)
        native = None if offer is None else offer(stage.block.inputs, stage.block.outputs)
        if native is None:
            return None
        natives.append(native)
    run_steps = _load_loop(holds_lock=all(native.python for native in natives))
    return None if run_steps is None else CompiledWiring(wiring, natives, run_steps)
