"""Variables of one type, set or read in one call through buffers that are made once; addresses for machine code."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np

from orchestrator.fmi.access import FLOATS, FMI2_TYPES, FMI3_TYPES, Access
from orchestrator.master.protocol import NativeCalls, NativeTransfer, Signals

Elements = list[tuple[int, list[Any], int]]
"""Elements of arrays: place among the values of a call, array, place in it."""
Arrays = dict[int, list[Any]]
"""The values that the arrays of an instance were last set to, by value reference."""


@dataclass(frozen=True)
class VariableBatch:
    """Variables of one type that are set or read in one call."""

    positions: list[int]  # of the variables in the list asked for
    places: list[int]  # of their values in ``values``
    values: Any  # C array that the call reads or fills
    references: Any  # value references as a C array
    rest: Elements  # elements of arrays that keep their values, but are set along with others
    kept: Elements  # elements of arrays that are set
    call: Callable[[], int]
    function: str  # its name, for messages

    @property
    def whole(self) -> bool:
        """Whether values and variables are the same, one for one in the same order."""
        return self.places == list(range(len(self.values)))

    def take(self, given: Signals) -> None:
        """Take what is to be set, unless it lies in place, then ``complete``."""
        if not shares(self.values, given):
            self.fill(given)
        self.complete()

    def fill(self, given: Sequence[Any] | Signals) -> None:
        """Write what is to be set into the array of C."""
        for place, position in zip(self.places, self.positions, strict=True):
            self.values[place] = in_c(given[position], self.values)

    def complete(self) -> None:
        """Note the elements of arrays that are about to be set, and fill in those that keep their values."""
        for place, array, element in self.kept:
            array[element] = self.values[place]
        for place, array, element in self.rest:
            self.values[place] = array[element]


@dataclass(frozen=True)
class Functions:
    """The functions of one instance that set and read variables."""

    library: Any  # the FMU's, loaded
    component: Any  # first argument of every call
    version: str
    arrays: Arrays

    def batches(self, accesses: Sequence[Access], direction: str, buffer: Signals | None = None) -> list[VariableBatch]:
        """Return the calls that set or read variables, one for each type.

        Args:
            buffer: shape (len(accesses),); neighbours in it that the FMU takes as doubles are passed in place.
        """
        groups: dict[str, list[int]] = {}
        for position, access in enumerate(accesses):
            groups.setdefault(access.kind, []).append(position)
        return [self._batch(kind, accesses, positions, direction, buffer) for kind, positions in groups.items()]

    def _batch(
        self, kind: str, accesses: Sequence[Access], positions: list[int], direction: str, buffer: Signals | None
    ) -> VariableBatch:
        firsts: dict[int, int] = {}  # place of the first element, by reference
        total = 0
        for position in positions:
            access = accesses[position]
            if access.reference not in firsts:
                firsts[access.reference] = total
                total += access.size
        places = [firsts[accesses[p].reference] + accesses[p].element for p in positions]
        c_type = (FMI2_TYPES if self.version == "2.0" else FMI3_TYPES)[kind]
        values = (c_type * total)()
        adjacent = positions == list(range(positions[0], positions[0] + total)) and places == list(range(total))
        if buffer is not None and c_type is ctypes.c_double and adjacent:
            values = (ctypes.c_double * total).from_buffer(buffer[positions[0] : positions[0] + total].data)
        mine = [accesses[p] for p in positions] if direction == "Set" else []
        kept, rest = self._elements(mine, firsts, set(places), c_type)
        function = f"{'fmi2' if self.version == '2.0' else 'fmi3'}{direction}{kind}"
        entry = self.library[function]
        entry.restype = ctypes.c_int
        entry.argtypes = None
        references = (ctypes.c_uint * len(firsts))(*firsts)
        counts = [ctypes.c_size_t(len(firsts)), values, *([] if self.version == "2.0" else [ctypes.c_size_t(total)])]
        call = partial(entry, self.component, references, *counts)
        return VariableBatch(positions, places, values, references, rest, kept, call, function)

    def _elements(
        self, accesses: Sequence[Access], firsts: dict[int, int], covered: set[int], c_type: Any
    ) -> tuple[Elements, Elements]:
        """Return the elements of arrays that are set by a batch, and those that are filled in."""
        kept: Elements = []
        rest: Elements = []
        for reference, size in {a.reference: a.size for a in accesses if a.size > 1}.items():
            empty = b"" if c_type is ctypes.c_char_p else 0
            array = self.arrays.setdefault(reference, [empty] * size)
            for element in range(size):
                place = firsts[reference] + element
                (kept if place in covered else rest).append((place, array, element))
        return kept, rest


def in_c(value: Any, values: Any) -> Any:
    """Return a value as a C array takes it."""
    if isinstance(value, str):
        return value.encode()
    return float(value) if values._type_ in FLOATS else int(value)


def shares(values: Any, buffer: Signals) -> bool:
    """Return whether a C array lies in a buffer."""
    first = int(buffer.ctypes.data)
    return first <= ctypes.addressof(values) < first + max(buffer.nbytes, 1)


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
