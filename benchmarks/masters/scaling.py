"""Cost of our master against the number of FMUs and of steps: it should be flat per FMU and step.

What is measured in a process of its own is in ``alone``.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.fmi.instances import fmu_instance
from orchestrator.master import session as session_module
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.signals import Sine
from orchestrator.master.system import Connection, SignalSource, System

STEP = 1e-3
FMUS = (2, 4, 8, 16, 32, 64)
STEPS = (1_000, 10_000, 100_000, 1_000_000)
ROUNDS = 5


@dataclass(frozen=True)
class Cost:
    """One measurement.

    Attributes:
        microseconds: processor time per instance and step [us], the least of some runs.
    """

    fmus: int
    steps: int
    microseconds: float


def chain(fmu: Path, count: int) -> System:
    """Return ``count`` plants in a row: each shaft's torque drives the next motor."""
    instances = tuple(fmu_instance(f"plant{k}", fmu) for k in range(count))
    links = tuple(Connection(f"plant{k}.T_shaft", f"plant{k + 1}.u") for k in range(count - 1))
    return System(instances, links, (SignalSource("plant0.u", Sine(20.0, 1.0)),))


def cost(fmu: Path, count: int, steps: int, rounds: int) -> Cost:
    """Measure one size.

    Returns:
        The time of a step of one FMU [us].
    """
    session_module.COMPILED_FROM = 0
    system = chain(fmu, count)
    times = []
    with session_module.Session(system, ("plant0.theta_l",), GaussSeidel(STEP), steps * STEP) as session:
        if steps <= 10_000:
            session.run()
        for _ in range(rounds):
            start = time.process_time()
            session.run()
            times.append(time.process_time() - start)
    return Cost(count, steps, 1e6 * min(times) / (count * steps))


def scaling(
    fmu: Path,
    fmus: Sequence[int] = FMUS,
    steps: Sequence[int] = STEPS,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Cost]:
    """Measure the cost for numbers of FMUs at 2,000 steps, and for numbers of steps with two FMUs."""
    found = []
    for count in fmus:
        progress(f"{count} FMUs")
        found.append(cost(fmu, count, 2000, ROUNDS))
    for number in steps:
        progress(f"{number} steps")
        found.append(cost(fmu, 2, number, ROUNDS if number <= 10_000 else 2))
    return found
