"""What a run leaves: times and recorded signals with their units."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

LOOPS = PYTHON, MACHINE_CODE = "Python", "machine code"


@dataclass(frozen=True)
class Statistics:
    """What a run took.

    Attributes:
        steps: communication steps that count.
        rejected: communication steps that were undone.
        do_steps: calls of ``do_step`` by instance, undone ones included.
        sweeps: passes over all instances, undone ones included.
        loop: what called the slaves: ``PYTHON`` or ``MACHINE_CODE``.
    """

    steps: int
    rejected: int
    do_steps: Mapping[str, int]
    sweeps: int
    loop: str = PYTHON


@dataclass(frozen=True)
class Recording:
    """Recorded signals.

    Attributes:
        time: [s], shape (n,).
        values: one row per signal, shape (signals, n).
        names: ``instance.variable`` of each row.
        units: unit by name; ``None`` where none is declared.
        statistics: what the run took.
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]
    names: tuple[str, ...]
    units: Mapping[str, str | None] = field(default_factory=dict)
    statistics: Statistics = field(default_factory=lambda: Statistics(0, 0, {}, 0))

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return the signal ``instance.variable``, shape (n,)."""
        return self.values[self.names.index(name)]
