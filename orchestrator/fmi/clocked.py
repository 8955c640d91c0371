"""Variables that belong to clocks: they are set and read while one of their clocks is active."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.protocol import Signals, Transfer

Bind = Callable[[Sequence[str], Signals], Transfer]
_Part = tuple[tuple[int, ...], NDArray[np.int64], Signals, Transfer]


class ClockedTransfers:
    """Transfers of one instance, some of whose variables belong to clocks.

    Args:
        clocks: value references of the clocks that a variable belongs to, by its name.
        is_active: tells whether one of some clocks is active.
    """

    def __init__(self, clocks: Mapping[str, tuple[int, ...]], is_active: Callable[[Sequence[int]], bool]) -> None:
        self._clocks, self._is_active = clocks, is_active

    def sends(self, names: Sequence[str], buffer: Signals, bind: Bind) -> Transfer:
        """Return a call that sets variables from ``buffer``, shape (len(names),), as far as their clocks allow."""
        parts = self._parts(names, buffer, bind)
        if parts is None:
            return bind(names, buffer)

        def send() -> None:
            for clocks, places, part, move in parts:
                if not clocks or self._is_active(clocks):
                    part[:] = buffer[places]
                    move()

        return send

    def receives(self, names: Sequence[str], buffer: Signals, bind: Bind) -> Transfer:
        """Return a call that reads variables into ``buffer``, shape (len(names),); between ticks a value stays."""
        parts = self._parts(names, buffer, bind)
        if parts is None:
            return bind(names, buffer)

        def receive() -> None:
            for clocks, places, part, move in parts:
                if not clocks or self._is_active(clocks):
                    move()
                    buffer[places] = part

        return receive

    def _parts(self, names: Sequence[str], buffer: Signals, bind: Bind) -> list[_Part] | None:
        """Return the variables by their clocks; None where none has one."""
        groups: dict[tuple[int, ...], list[int]] = {}
        for place, name in enumerate(names):
            groups.setdefault(self._clocks.get(name, ()), []).append(place)
        if set(groups) <= {()}:
            return None
        found = []
        for clocks, places in groups.items():
            part = np.empty(len(places))
            found.append((clocks, np.array(places), part, bind([names[p] for p in places], part)))
        return found
