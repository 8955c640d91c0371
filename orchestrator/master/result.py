"""What a run leaves: times and recorded signals with their units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from orchestrator.plain_text import plain_text

PYTHON: Final = "Python"
MACHINE_CODE: Final = "machine code"
Loop = Literal["Python", "machine code"]
MOST_REMARKS, LONGEST_REMARK = 1000, 1000


@dataclass(frozen=True)
class EventStatistics:
    """The events of a run.

    Attributes:
        times: when slaves had events, rising [s], the first 50,000; each once, however many instants it took.
        instants: updates of all slaves at one time, over the whole run: initial ones, ticks and source jumps included.
        late: how long after each event that slaves could not be taken back to it was taken [s].
    """

    times: tuple[float, ...] = ()
    instants: int = 0
    ticks: int = 0
    late: tuple[float, ...] = ()


@dataclass(frozen=True)
class Statistics:
    """What a run took.

    Attributes:
        steps: communication steps that count.
        rejected: communication steps that were undone.
        do_steps: calls of ``do_step`` by instance, undone ones included.
        sweeps: passes over all instances, undone ones included.
        loop: what called the slaves: ``PYTHON`` or ``MACHINE_CODE``.
        events: of slaves that have any.
    """

    steps: int
    rejected: int
    do_steps: Mapping[str, int]
    sweeps: int
    loop: Loop = PYTHON
    events: EventStatistics = EventStatistics()


@dataclass(frozen=True)
class RunRemark:
    """What is to be known of a run that went on.

    Attributes:
        text: the first of its kind; plain, whatever an FMU had to say.
        count: how many there were.
    """

    instance: str
    text: str
    count: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", plain_text(self.text[:LONGEST_REMARK]))

    def __str__(self) -> str:
        return f"{self.instance}: {self.text}" + (f" ({self.count} times)" if self.count > 1 else "")


@dataclass(frozen=True)
class Recording:
    """Recorded signals.

    Attributes:
        time: [s], shape (n,).
        values: one row per signal, shape (signals, n).
        names: ``instance.variable`` of each row.
        units: unit by name; ``None`` where none is declared.
        statistics: what the run took.
        remarks: warnings of slaves, steps that were shortened, an early end.
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]
    names: tuple[str, ...]
    units: Mapping[str, str | None] = field(default_factory=dict)
    statistics: Statistics = field(default_factory=lambda: Statistics(0, 0, {}, 0))
    remarks: tuple[RunRemark, ...] = ()

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return the signal ``instance.variable``, shape (n,)."""
        return self.values[self.names.index(name)]
