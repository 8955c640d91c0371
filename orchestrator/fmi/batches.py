"""Variables of one type, set or read in one call through buffers that are made once."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from orchestrator.master.protocol import Signals, Variable

_C_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Enumeration": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}
FUNCTION_TYPES = {
    "Real": "Real",
    "Integer": "Integer",
    "Enumeration": "Integer",
    "Boolean": "Boolean",
    "String": "String",
}
"""What FMI 2.0 calls a type in the names of its functions."""


@dataclass(frozen=True)
class VariableBatch:
    """Variables of one type that are set or read in one call.

    Attributes:
        positions: of the variables in the list asked for.
        references: value references as a C array.
        values: C array that the call reads or fills.
        call: returns the status.
        function: its name, for messages.
    """

    positions: list[int]
    references: Any
    values: Any
    call: Callable[[], int]
    function: str


def make_batches(
    library: Any, component: Any, variables: Sequence[Variable], direction: str, buffer: Signals | None = None
) -> list[VariableBatch]:
    """Return the calls that set or read variables, one for each type.

    Args:
        library: the FMU's, loaded.
        component: first argument of every call.
        variables: to set or read, in the order of ``buffer``.
        direction: "Set" or "Get".
        buffer: shape (len(variables),); Reals that are neighbours in it are passed in place.

    Returns:
        The batches.
    """
    groups: dict[str, list[int]] = {}
    for position, variable in enumerate(variables):
        groups.setdefault(FUNCTION_TYPES[variable.type], []).append(position)
    batches = []
    for kind, positions in groups.items():
        count = len(positions)
        references = (ctypes.c_uint * count)(*(variables[p].reference for p in positions))
        values = (_C_TYPES[kind] * count)()
        adjacent = positions == list(range(positions[0], positions[0] + count))
        if buffer is not None and kind == "Real" and adjacent:
            values = (ctypes.c_double * count).from_buffer(buffer[positions[0] : positions[0] + count].data)
        function = f"fmi2{direction}{kind}"
        entry = library[function]
        entry.restype = ctypes.c_int
        entry.argtypes = None
        call = partial(entry, component, references, ctypes.c_size_t(count), values)
        batches.append(VariableBatch(positions, references, values, call, function))
    return batches


def shares(values: Any, buffer: Signals) -> bool:
    """Return whether a C array lies in a buffer.

    Args:
        values: the C array.
        buffer: of signals.

    Returns:
        Whether it does.
    """
    first = int(buffer.ctypes.data)
    return first <= ctypes.addressof(values) < first + max(buffer.nbytes, 1)
