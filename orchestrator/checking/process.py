"""The child process that does the FMI calls; another one takes its place where an FMU may be instantiated only once."""

from collections.abc import Callable
from typing import Any

from orchestrator.shared.isolation.jail import Jail


class Process:
    """A jail with the host of FMI calls.

    Attributes:
        jail: the present one; it must be closed by ``close``.
        left: whether a process outlived one of those before.
        most: seconds that a call may take; None: as the limits say.
    """

    def __init__(self, start: Callable[[], Jail]) -> None:
        self._start = start
        self.jail = start()
        self.left = False
        self.most: float | None = None

    def __enter__(self) -> "Process":
        return self

    def __exit__(self, *_: object) -> None:
        self.jail.close()

    def call(self, request: Any) -> Any:
        """Return what ``checking.host.Host`` returns."""
        return self.jail.call(request, self.most)

    def resident(self) -> int:
        """Resident memory of the child in bytes; 0 where the system does not tell."""
        return self.jail.resident()

    def processor_time(self) -> float:
        """How long the child has had a processor [s]; 0 where the system does not tell."""
        return self.jail.processor_time()

    def renew(self) -> None:
        """End the child and start another one."""
        self.left |= self.jail.finish()
        self.jail.close()
        self.jail = self._start()
