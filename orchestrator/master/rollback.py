"""Taking all slaves and signals back to where they were."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from orchestrator.master.wiring import Stage, Wiring


@contextmanager
def rollback(wiring: Wiring) -> Iterator[Callable[[], None]]:
    """Yield a call that takes all slaves and signals back to now, as often as it is made."""
    states: list[tuple[Stage, Any]] = []
    values = wiring.values.copy()

    def restore() -> None:
        for stage, state in states:
            stage.slave.set_state(state)
        wiring.values[:] = values

    try:
        for stage in wiring.stages:
            states.append((stage, stage.slave.get_state()))
        yield restore
    finally:
        for stage, state in states:
            stage.slave.free_state(state)
