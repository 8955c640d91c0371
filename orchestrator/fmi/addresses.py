"""What machine code needs to call an FMU: addresses of its functions, and lists of references."""

import ctypes
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from orchestrator.fmi.access import Access
from orchestrator.fmi.batches import Functions
from orchestrator.master.protocol import NativeCalls, NativeTransfer


def native_calls(
    functions: Functions,
    inputs: Sequence[Access],
    outputs: Sequence[Access],
    python: bool,
    step: tuple[int, str] | None = None,
) -> NativeCalls | None:
    """Return addresses for calls from machine code; ``step``: address and name of what steps in the FMU's place."""
    sent, received = _transfers(functions, inputs, "Set"), _transfers(functions, outputs, "Get")
    if sent is None or received is None:
        return None
    name = "fmi2DoStep" if functions.version == "2.0" else "fmi3DoStep"
    address, name = (_address(functions.library, name), name) if step is None else step
    return NativeCalls(
        component=int(functions.component.value or 0),
        do_step=address,
        step_name=name,
        reports=functions.version != "2.0" and step is None,
        inputs=sent,
        outputs=received,
        python=python,
    )


def _address(library: Any, function: str) -> int:
    return int(ctypes.cast(getattr(library, function), ctypes.c_void_p).value or 0)


def _transfers(functions: Functions, accesses: Sequence[Access], direction: str) -> tuple[NativeTransfer, ...] | None:
    found = []
    for _, run in groupby(accesses, key=lambda access: access.kind):
        (batch,) = functions.batches(list(run), direction)
        if not batch.whole:
            return None
        found.append(
            NativeTransfer(
                function=_address(functions.library, batch.function),
                name=batch.function,
                number=np.dtype(batch.values._type_).str[1:],
                sized=functions.version != "2.0",
                references=np.array(list(batch.references), dtype=np.uint32),
                count=len(batch.values),
            )
        )
    return tuple(found)
