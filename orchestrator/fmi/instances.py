"""FMUs as instances of a system."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from orchestrator.errors import FmuError, ScenarioError
from orchestrator.fmi.clocks import ClockTimes, times_problem
from orchestrator.fmi.event_slave3 import EventFmuSlave
from orchestrator.fmi.exchange import Exchange2Slave, Exchange3Slave
from orchestrator.fmi.model_description import FmuDescription, read_description
from orchestrator.fmi.ours import is_ours
from orchestrator.fmi.slave import FmuSlave
from orchestrator.fmi.slave2 import Fmu2Slave
from orchestrator.fmi.slave3 import Fmu3Slave
from orchestrator.master.protocol import Value
from orchestrator.master.system import Instance, Quantity, Start
from orchestrator.master.values import coerce_value


def make_slave(name: str, path: Path, description: FmuDescription | None = None) -> FmuSlave:
    """Return a new instance of the FMU at ``path``, of its version; for model exchange where it has nothing else."""
    known = read_description(path) if description is None else description
    kind: type[FmuSlave]
    if known.version == "2.0":
        kind = Exchange2Slave if known.exchange else Fmu2Slave
    elif known.exchange:
        kind = Exchange3Slave
    else:
        kind = EventFmuSlave if known.model.has_events else Fmu3Slave
    return kind(name, path, known)


@dataclass(frozen=True)
class FmuFactory:
    """Makes slaves from the FMU at ``path``."""

    path: Path
    description: FmuDescription

    def __call__(self, name: str) -> FmuSlave:
        return make_slave(name, self.path, self.description)


def _with_times(description: FmuDescription, times: Mapping[str, ClockTimes]) -> FmuDescription:
    clocks = dict(description.model.clocks)
    for name, wanted in times.items():
        text = times_problem(name, clocks, description.events)
        if text is not None:
            raise ScenarioError(f"clocks.{name}: {text}")
        clocks[name] = wanted.of(clocks[name])
    return replace(description, model=replace(description.model, clocks=clocks))


def fmu_instance(
    name: str,
    path: Path,
    start: Start | None = None,
    solver_tolerance: float | None = None,
    events: bool = False,
    clocks: Mapping[str, ClockTimes] | None = None,
    exchange: bool = False,
    resets: bool | None = None,
) -> Instance:
    """Return an instance of the FMU at ``path``, with parameters and start values by variable name.

    Args:
        solver_tolerance: relative, for the FMU's own solver.
        events: whether event mode is used where the FMU has it.
        clocks: times of clocks, by name; see ``times_problem``.
        exchange: an FMU for both is used as model exchange.
        resets: its reset is trusted (default: if the FMU is ours).
    """
    description, rest = read_configured(path, start or {}, events, exchange)
    if clocks:
        description = _with_times(description, clocks)
    trusted = is_ours(path) if resets is None else resets
    return Instance(name, description.model, FmuFactory(path, description), rest, solver_tolerance, trusted)


def read_configured(path: Path, start: Start, events: bool, exchange: bool = False) -> tuple[FmuDescription, Start]:
    """Return the description of an FMU with values of its structural parameters, and the other start values."""
    description = read_description(path, events, exchange=exchange)
    given: dict[str, Value] = {}
    for name in description.structural.intersection(start):
        raw = start[name]
        value, text = (
            (None, "must be without a unit, but has one")
            if isinstance(raw, Quantity)
            else coerce_value(description.model.variables[name], raw)
        )
        if value is None:
            raise FmuError(f"its structural parameter {name} {text}")
        given[name] = value
    if not given:
        return description, start
    description = read_description(path, events, given, exchange)
    rest = {name: value for name, value in start.items() if name not in given}
    _require_whole_arrays(description, rest)
    return description, rest


def _require_whole_arrays(description: FmuDescription, start: Start) -> None:
    """Refuse values for some elements of a parameter of another size than that of its start values."""
    parameters = {n for n in description.resized if description.model.variables[n].causality == "parameter"}
    begun = {description.access[name].reference for name in parameters.intersection(start)}
    for name in sorted(parameters.difference(start)):
        if description.access[name].reference in begun:
            text = (
                "must have a value, for its array has another size than its start values and has others, but has none"
            )
            raise FmuError(f"its parameter {name} {text}")
