"""Runs of FMUs that are not ours: in a child process behind walls, with limits of time and memory.

Which FMU a process died of cannot be told when several are in it, so messages name all that are not ours.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from orchestrator.errors import ChildError, FmuError, SimulationError
from orchestrator.fmi.instances import FmuFactory
from orchestrator.fmi.ours import is_ours
from orchestrator.fmi.remote import RemoteFactory, without_feed
from orchestrator.master.algorithms import step_count
from orchestrator.master.compiled import prepare
from orchestrator.master.result import MOST_REMARKS, Recording
from orchestrator.master.system import System
from orchestrator.plain_text import name_folder, plain_text
from orchestrator.scenarios.definition import Scenario
from orchestrator.shared.isolation.archives import content_hash, unpack
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import MEBIBYTE, Limits
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.results import WallsFound
from orchestrator.shared.scratch import Scratch

DEFAULT_TIME_LIMIT = 300.0
DEFAULT_MEMORY_LIMIT = 2048 * MEBIBYTE
_LARGEST_FILE = 64 * MEBIBYTE
_MOST_FILES = 256 * MEBIBYTE
_SLACK = 1 << 20


@dataclass(frozen=True)
class Safety:
    """How far FMUs are trusted."""

    trust: bool = False  # all of them are treated as ours: they run in this process, with the rights of the user
    # seconds that a run may take; ``None``: the default for FMUs that are not ours, no limit for others
    time: float | None = None
    memory: int = DEFAULT_MEMORY_LIMIT  # resident bytes of a child process
    allow_nonfinite: bool = False  # a result may hold NaN and infinities

    @property
    def limits(self) -> Limits:
        """What a child process may use."""
        time = DEFAULT_TIME_LIMIT if self.time is None else self.time
        return Limits(time, self.memory, _LARGEST_FILE, time, _MOST_FILES)


def foreign_fmus(system: System) -> list[Path]:
    """Return the FMUs of a system that are not ours, each once."""
    paths = [i.create.path for i in system.instances if isinstance(i.create, FmuFactory)]
    return [path for path in dict.fromkeys(paths) if not is_ours(path)]


def describe_walls(system: System, safety: Safety) -> WallsFound:
    """Return what a result file says of the walls around a run of ``system``."""
    foreign = foreign_fmus(system)
    walls, behind = support(), bool(foreign) and not safety.trust
    return WallsFound(
        foreign_fmus=tuple(plain_text(str(path)) for path in foreign),
        own_process=behind,
        landlock=walls.landlock if behind else None,
        seccomp=walls.seccomp if behind else None,
        not_enforced=walls.not_enforced if behind else "",
    )


def run_safely(scenario: Scenario, safety: Safety) -> Recording:
    """Run a scenario once, in a child process when an FMU is not ours or the time is limited."""
    foreign = [] if safety.trust else foreign_fmus(scenario.system)
    movable = all(isinstance(i.create, FmuFactory) for i in scenario.system.instances)
    if movable and _needs_processes(scenario.system):
        result = _in_processes(scenario, safety, foreign)
    elif movable and (foreign or safety.time is not None):
        result = _in_child(scenario, safety, foreign)
    else:
        with scenario.session() as session:
            result = session.run(allow_early_end=True)
    if not safety.allow_nonfinite:
        _require_finite(result)
    return result


def _require_finite(result: Recording) -> None:
    """Refuse a result with NaN or infinities."""
    bad = ~np.isfinite(result.values)
    if not bad.any():
        return
    at = int(np.argmax(bad.any(axis=0)))
    k = int(np.argmax(bad[:, at]))
    text = f"`{result.names[k]}` must be finite, but is {result.values[k, at]} at t = {result.time[at]:.9g} s"
    raise SimulationError(f"{text} (`allow_nonfinite` keeps such results)", "allow_nonfinite")


@contextmanager
def unpack_system(system: System) -> Iterator[tuple[System, Scratch, dict[str, str]]]:
    """Yield ``system`` with its FMUs unpacked for a child: the system, the folder, and the FMU of each subfolder."""
    with Scratch("fmus") as scratch:
        origins: dict[str, str] = {}
        instances = []
        for instance in system.instances:
            factory = instance.create
            assert isinstance(factory, FmuFactory)
            folder = scratch.path / content_hash(factory.path)[:24]
            if str(folder) not in origins:
                try:
                    unpack(factory.path, folder)
                except FmuError as error:
                    raise FmuError(f"$.instances.{instance.name}: {error}") from None
                origins[str(folder)] = str(factory.path)
                name_folder(folder, factory.path)
            instances.append(replace(instance, create=replace(factory, path=folder)))
        yield replace(system, instances=tuple(instances)), scratch, origins


def _needs_processes(system: System) -> bool:
    """Whether an FMU that may be instantiated once per process has several instances."""
    once = [f.path for f in (i.create for i in system.instances) if isinstance(f, FmuFactory) and f.description.once]
    contents = [content_hash(path) for path in once]
    return len(set(contents)) < len(contents)


def _in_processes(scenario: Scenario, safety: Safety, foreign: list[Path]) -> Recording:
    """Run a scenario with a process for each of its instances."""
    with unpack_system(scenario.system) as (system, _, origins):
        instances = []
        for instance in system.instances:
            factory = instance.create
            assert isinstance(factory, FmuFactory)
            walls = Path(origins[str(factory.path)]) in foreign
            description = without_feed(factory.description)
            made = RemoteFactory(factory.path, description, safety.limits, walls)
            instances.append(replace(instance, model=description.model, create=made))
        with replace(scenario, system=replace(system, instances=tuple(instances))).session() as session:
            return session.run(allow_early_end=True)


def _in_child(scenario: Scenario, safety: Safety, foreign: list[Path]) -> Recording:
    steps = step_count(scenario.start, scenario.stop, scenario.algorithm.step)
    shape = (len(scenario.record), steps + 1)
    limits = safety.limits
    memory = limits.memory + 24 * shape[0] * shape[1]
    limits = replace(limits, memory=memory, total=2.0 * limits.time + 600.0)
    with unpack_system(scenario.system) as (system, scratch, _):
        job = replace(scenario, system=system, derived=(), remarks=())
        names = ", ".join(map(str, foreign)) or "the scenario"
        prepare()
        try:
            handler = "orchestrator.scenarios.definition:open_runs"
            with Jail(handler, job, read=[scratch.path], limits=limits, walls=bool(foreign)) as jail:
                jail.start(limits.time)
                claimed = jail.call(None, Recording, most=8 * (shape[0] + 1) * shape[1] + _SLACK)
        except ChildError as error:
            raise SimulationError(f"{names}: {error.explain('the run')}", "time_limit") from None
    return _check_recording(claimed, scenario, shape, names)


def _check_recording(claimed: Recording, scenario: Scenario, shape: tuple[int, int], names: str) -> Recording:
    """Return the result, after a look at what the child claims it to be; a run that an FMU ended has fewer values."""
    given = claimed.values.shape
    if len(given) != len(shape) or given[0] != shape[0] or not 1 <= given[1] <= shape[1]:
        raise SimulationError(f"{names}: the run must return {shape[0]} signals of {shape[1]} values, but does not")
    time = scenario.start + scenario.algorithm.step * np.arange(given[1], dtype=np.float64)
    units = {name: getattr(scenario.system.unit(name), "name", None) for name in scenario.record}
    instances = {instance.name for instance in scenario.system.instances}
    calls = {name: count for name, count in claimed.statistics.do_steps.items() if name in instances}
    statistics = replace(claimed.statistics, do_steps=calls)
    return Recording(time, claimed.values, scenario.record, units, statistics, claimed.remarks[:MOST_REMARKS])
