"""A scenario: which FMUs run, how they are connected, what is fed in, which master runs them, what is recorded."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.master.algorithms import Algorithm
from orchestrator.master.result import Recording, RunRemark
from orchestrator.master.session import Session
from orchestrator.master.system import System


@dataclass(frozen=True)
class Derived:
    """A signal that follows from a recorded one: ``factor * source + offset``."""

    name: str
    source: str
    factor: float
    offset: float
    unit: str | None  # of the signal; None where none is stated


@dataclass(frozen=True)
class Scenario:
    """One run, ready to go.

    Attributes:
        system: instances, connections, sources, start values.
        record: signals to record, ``instance.variable``.
        algorithm: master algorithm with its settings.
        stop: end [s].
        start: beginning [s].
        name: shown in titles of tables and figures.
        origin: the file that describes it, for messages.
        derived: signals that are recorded beside those of ``record``.
        remarks: what of the file is passed over.
    """

    system: System
    record: tuple[str, ...]
    algorithm: Algorithm
    stop: float
    start: float = 0.0
    name: str = "scenario"
    origin: str = ""
    derived: tuple[Derived, ...] = ()
    remarks: tuple[RunRemark, ...] = ()

    def complete(self, recording: Recording) -> Recording:
        """Return a recording with the derived signals and the remarks of the scenario.

        Args:
            recording: of a run of this scenario, with all its recorded signals.

        Returns:
            The recording, signals of ``derived`` behind the others and its own remarks behind those of the scenario.
        """
        recording = replace(recording, remarks=(*self.remarks, *recording.remarks))
        if not self.derived:
            return recording
        more = [d.factor * recording[d.source] + d.offset for d in self.derived]
        names = (*recording.names, *(d.name for d in self.derived))
        units = {**recording.units, **{d.name: d.unit for d in self.derived}}
        return replace(recording, values=np.vstack([recording.values, *more]), names=names, units=units)

    def session(self) -> Session:
        """Return a session that runs this scenario as often as needed; to be closed.

        Returns:
            A session whose slaves are instantiated; to be closed by the caller.

        Raises:
            ScenarioError: see ``Session``.
            ConnectionMismatchError: outputs and inputs that are connected do not fit.
        """
        return Session(self.system, self.record, self.algorithm, self.stop, self.start)


def open_runs(scenario: Scenario) -> Callable[[None], Recording]:
    """Return a handler that runs a scenario, whose FMUs are unpacked folders, in a child process."""
    session = scenario.session()
    return lambda _: session.run(allow_early_end=True)
