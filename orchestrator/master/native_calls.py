"""Calls of a slave's functions by address, for kernels; see ``NativeCalls``. In C they are those of ``kernel.h``.

In all functions: ``address``: of the function; ``component``: of the slave's instance.
"""

import ctypes
from typing import Any

from orchestrator.building.translation.kernel_arrays import Reals

IN_C = ("call_reporting_step", "call_sized_transfer", "call_step", "call_transfer")
"""Functions that kernels find in C under their own names."""

ENDED, LEFT_EARLY = 16, 17
"""Statuses of a native step that did not end as asked: the run is to end; the step returned early, or with an event."""

_Address, _Count, _Real, _Status, _Truth = (
    ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int, ctypes.c_bool,
)  # fmt: skip


def _function(address: int, *kinds: Any) -> Any:
    return ctypes.CFUNCTYPE(_Status, *kinds)(address)


def call_transfer(address: int, component: int, references: int, count: int, values: int) -> int:
    """Return the status of a getter or setter of FMI 2.0; ``references`` and ``values`` are addresses."""
    return int(_function(address, _Address, _Address, _Count, _Address)(component, references, count, values))


def call_sized_transfer(address: int, component: int, references: int, count: int, values: int) -> int:
    """Return the status of a getter or setter of FMI 3.0; ``references`` and ``values`` are addresses."""
    kinds = (_Address, _Address, _Count, _Address, _Count)
    return int(_function(address, *kinds)(component, references, count, values, count))


def call_step(address: int, component: int, time: float, length: float) -> int:
    """Return the status of a step of FMI 2.0 from ``time`` over ``length`` [s]."""
    return int(_function(address, _Address, _Real, _Real, _Status)(component, time, length, 1))


def call_reporting_step(address: int, component: int, time: float, length: float, report: Reals) -> int:
    """Return the status of a step of FMI 3.0 from ``time`` over ``length`` [s].

    ``report``: (4,) filled: event, end and early return (1: yes), time reached [s], which is set before.
    """
    flags = [_Truth() for _ in range(3)]
    reached = _Real(report[3])
    function = _function(address, _Address, _Real, _Real, _Truth, *[_Address] * 4)
    places = (*map(ctypes.byref, flags), ctypes.byref(reached))
    status = int(function(component, time, length, True, *places))
    for n in range(3):
        report[n] = float(flags[n].value)
    report[3] = reached.value
    return status
