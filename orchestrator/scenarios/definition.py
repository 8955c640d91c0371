"""A scenario: which FMUs run, how they are connected, what is fed in, which master runs them, what is recorded."""

from dataclasses import dataclass

from orchestrator.master.algorithms import Algorithm
from orchestrator.master.session import Session
from orchestrator.master.system import System


@dataclass(frozen=True)
class Scenario:
    """One run, ready to go.

    Attributes:
        system: instances, connections, sources, start values.
        record: signals to record, ``instance.variable``.
        algorithm: master algorithm with its settings.
        stop: end [s].
        start: beginning [s].
        name: for titles.
        origin: the file that describes it, for messages.
    """

    system: System
    record: tuple[str, ...]
    algorithm: Algorithm
    stop: float
    start: float = 0.0
    name: str = "scenario"
    origin: str = ""

    def session(self) -> Session:
        """Return a session that runs this scenario as often as needed; to be closed.

        Returns:
            The session.

        Raises:
            ScenarioError: see ``Session``.
            ConnectionMismatchError: likewise.
        """
        return Session(self.system, self.record, self.algorithm, self.stop, self.start)
