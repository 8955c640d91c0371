"""The child process that does the FMI calls; another one takes its place where an FMU may be instantiated only once."""

from collections.abc import Callable
from typing import Any

from orchestrator.shared.isolation.jail import Answer, Jail


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

    def call(self, request: Any, answer: type[Answer]) -> Answer:
        """Return what ``checking.host.Host`` returns."""
        return self.jail.call(request, answer, self.most)

    def renew(self) -> None:
        """End the child and start another one."""
        self.left |= self.jail.finish()
        self.jail.close()
        self.jail = self._start()
