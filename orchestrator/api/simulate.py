"""Any scenario of FMUs, or any SSP file, run once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orchestrator.api.sampled import SampledResult
from orchestrator.api.shown import Block, table
from orchestrator.errors import ScenarioError
from orchestrator.master import result as master
from orchestrator.master.signals import Constant
from orchestrator.scenarios import scenario as scenarios
from orchestrator.scenarios.isolated import Safety, describe_walls
from orchestrator.scenarios.scenario import Scenario, load_scenario
from orchestrator.scenarios.ssp.read import open_ssp
from orchestrator.shared.arrays import Array
from orchestrator.shared.operating_system import LIMITS
from orchestrator.shared.results import EventsFound, RemarkFound, SignalFound, SignalsFound, WallsFound
from orchestrator.shared.results.fields import copy_fields

HEAD = ("signal", "unit", "first", "last", "smallest", "largest")


@dataclass(frozen=True, repr=False)
class SimulationResult(SampledResult):
    """Recorded signals of one run; ``result["plant.theta_l"]`` is one of them, shape (n,).

    Attributes:
        run: times, signals, units and what the run took.
        title: above the printed table: the scenario's name.
        isolation: the walls around the run: which FMUs are not ours, and what the system could not enforce.
        command: whose result directory ``save`` makes.
    """

    replaces: ClassVar[tuple[str, ...]] = ("simulate.png",)
    run: master.Recording
    title: str
    isolation: WallsFound | None = None
    command: str = field(default="simulate", kw_only=True)  # type: ignore[misc]

    def __getitem__(self, name: str) -> Array:
        """Return a recorded signal.

        Returns:
            Its values at ``time``, shape (n,), in ``units[name]``.
        """
        if name not in self.run.names:
            raise KeyError(f"`name` must be one of {', '.join(self.run.names)}, but is {name!r}")
        return self.run[name]

    @property
    def time(self) -> Array:
        """Communication points [s], shape (n,)."""
        return self.run.time

    @property
    def names(self) -> tuple[str, ...]:
        """Recorded signals, ``instance.variable``."""
        return self.run.names

    @property
    def units(self) -> Mapping[str, str | None]:
        """Unit of each signal; None where its FMU declares none."""
        return self.run.units

    @property
    def steps(self) -> int:
        """Communication steps."""
        return len(self.time) - 1

    def signals(self) -> Mapping[str, Array]:
        return {"time": self.time} | {name: self[name] for name in self.names}

    def blocks(self) -> Sequence[Block]:
        """Return the table of the signals, and what is to be known of the run."""
        return [
            table(f"{self.title}: {self.steps} steps{self._events()}", HEAD, self._rows()),
            *(f"Note: {remark}" for remark in self.run.remarks),
        ]

    def _events(self) -> str:
        """Return how many events there were, of a system that can have some."""
        took = self.run.statistics.events
        ticks = f" and {took.ticks} ticks of clocks" if took.ticks else ""
        return f", {len(took.times)} events{ticks}" if took.instants else ""

    def _rows(self) -> list[list[str]]:
        cells = [(s, (s.first, s.last, s.smallest, s.largest)) for s in self._signals()]
        return [[s.signal, s.unit, *(f"{value:.6g}" for value in values)] for s, values in cells]

    def _signals(self) -> list[SignalFound]:
        found = []
        for name in self.names:
            values = np.asarray(self[name], dtype=float)
            numbers = (values[0], values[-1], values.min(), values.max(), np.sqrt(np.mean(values**2)))
            found.append(SignalFound(name, self.units.get(name) or "", *map(float, numbers)))
        return found

    def results(self, place: Path | None = None) -> SignalsFound:
        signals = self._signals()
        remarks = [copy_fields(RemarkFound, remark) for remark in self.run.remarks]
        took = self.run.statistics.events
        events = copy_fields(EventsFound, took) if took.instants else None
        return SignalsFound(signals=signals, steps=self.steps, events=events, remarks=remarks, isolation=self.isolation)


def simulate(
    scenario: Scenario | Path | str,
    *,
    stop: float | None = None,
    step: float | None = None,
    inputs: Mapping[str, float] | None = None,
    jacobi: bool = False,
    events: bool = True,
    safety: Safety | None = None,
    tell: Callable[[str], None] | None = None,
) -> SimulationResult:
    """Run a scenario once. FMUs that are not ours run in a process of their own, behind walls.

    Args:
        scenario: a TOML scenario file, an SSP file (``.ssp``) of co-simulation FMUs, or a ``Scenario``.
        stop: end [s] (default: the scenario's own).
        step: communication step of an SSP file [s] (default: the file's own).
        inputs: constant values of an SSP file's outer inputs, by name.
        jacobi: run all FMUs of an SSP file side by side, as most SSP tools do.
        events: use event mode in an SSP file where an FMU of FMI 3.0 has it.
        safety: how far FMUs are trusted, and limits of time and memory (default: not at all).
        tell: called with a line when FMUs that are not ours run on a system without walls.

    Returns:
        Times and recorded signals with their units.

    Raises:
        InputError: the file, an FMU or an argument is wrong; the text names the file and every problem in it.
        SimulationError: the run went wrong.

    Examples:
        >>> result = oc.simulate("loop.toml", stop=2.0)
        >>> result["plant.theta_l"].shape
        (2001,)
    """
    if isinstance(scenario, Scenario):
        return _run(scenario, scenario.name, "simulate", stop, safety, tell, {})
    path = Path(scenario)
    if path.suffix.lower() == ".ssp":
        return run_ssp(
            path, stop=stop, step=step, inputs=inputs or {}, jacobi=jacobi, events=events, safety=safety, tell=tell
        )
    others = (("step", step is not None), ("inputs", bool(inputs)), ("jacobi", jacobi), ("events", not events))
    for name, given in others:
        if given:
            raise ScenarioError(f"`{name}` must be left out with a TOML scenario, which says it itself", name)
    return _run(load_scenario(path), path.name, "simulate", stop, safety, tell, {"scenario": str(path)})


def _run(
    scenario: Scenario,
    title: str,
    command: str,
    stop: float | None,
    safety: Safety | None,
    tell: Callable[[str], None] | None,
    given: Mapping[str, Any],
) -> SimulationResult:
    safety = safety or Safety()
    walls = describe_walls(scenario.system, safety)
    if walls.not_enforced and tell is not None:
        tell(f"FMUs that are not ours run with {LIMITS}, but {walls.not_enforced}")
    result = scenarios.simulate(scenario if stop is None else replace(scenario, stop=stop), safety)
    return SimulationResult(result, title, walls, command=command, arguments=given)


def run_ssp(
    path: Path,
    *,
    stop: float | None = None,
    step: float | None = None,
    inputs: Mapping[str, float],
    jacobi: bool = False,
    events: bool = True,
    safety: Safety | None = None,
    tell: Callable[[str], None] | None = None,
) -> SimulationResult:
    """Run an SSP file, whatever its name, to ``stop`` [s] in communication steps of ``step`` [s]; see ``simulate``."""
    if step is not None and not 0.0 < step < float("inf"):
        raise ScenarioError(f"`step` must be finite and positive, but is {step!r}", "step")
    constants = {name: Constant(float(value)) for name, value in inputs.items()}
    given = {"action": "run", "file": str(path), "step": step, "stop": stop, "jacobi": jacobi, "events": events}
    with open_ssp(path, constants, step, jacobi, events) as scenario:
        return _run(scenario, path.name, "ssp", stop, safety, tell, given)
