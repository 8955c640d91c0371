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
    """The events of a run."""

    # when slaves had events, rising [s], the first 50,000; each once, however many instants it took
    times: tuple[float, ...] = ()
    # updates of all slaves at one time, over the whole run: initial ones, ticks and source jumps included
    instants: int = 0
    ticks: int = 0
    late: tuple[float, ...] = ()  # how long after each event that slaves could not be taken back to it was taken [s]


@dataclass(frozen=True)
class Statistics:
    """What a run took."""

    steps: int  # communication steps that count
    rejected: int  # communication steps that were undone
    do_steps: Mapping[str, int]  # calls of ``do_step`` by instance, undone ones included
    sweeps: int  # passes over all instances, undone ones included
    loop: Loop = PYTHON  # what called the slaves: ``PYTHON`` or ``MACHINE_CODE``
    events: EventStatistics = EventStatistics()  # of slaves that have any


@dataclass(frozen=True)
class RunRemark:
    """What is to be known of a run that went on."""

    instance: str
    text: str  # the first of its kind; plain, whatever an FMU had to say
    count: int = 1  # how many there were

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", plain_text(self.text[:LONGEST_REMARK]))

    def __str__(self) -> str:
        return f"{self.instance}: {self.text}" + (f" ({self.count} times)" if self.count > 1 else "")


@dataclass(frozen=True)
class Recording:
    """Recorded signals."""

    time: NDArray[np.float64]  # [s], shape (n,)
    values: NDArray[np.float64]  # one row per signal, shape (signals, n)
    names: tuple[str, ...]  # ``instance.variable`` of each row
    units: Mapping[str, str | None] = field(default_factory=dict)  # unit by name; ``None`` where none is declared
    statistics: Statistics = field(default_factory=lambda: Statistics(0, 0, {}, 0))  # what the run took
    remarks: tuple[RunRemark, ...] = ()  # warnings of slaves, steps that were shortened, an early end

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return the signal ``instance.variable``, shape (n,)."""
        return self.values[self.names.index(name)]
