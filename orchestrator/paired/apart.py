"""One paired run in a child process, so that its time can be limited. The FMUs are ours: nothing is kept from them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from orchestrator.errors import ChildError, SimulationError
from orchestrator.master.protocol import Value
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.pair import PairRun, run_pair
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import Limits


def run_pair_within(
    time_limit: float,
    experiment: Experiment,
    fmus: Mapping[str, Path],
    alpha: float,
    seed: int = 0,
    start: Mapping[str, Value] | None = None,
) -> PairRun:
    """Do what ``run_pair`` does, within ``time_limit`` seconds of wall time.

    ``time_limit``: [s], the start of the child process included.
    """
    limits = Limits.of_time(time_limit)
    argument = (experiment, {name: path.absolute() for name, path in fmus.items()}, alpha, seed, dict(start or {}))
    try:
        with Jail("orchestrator.paired.apart:open_run", argument, limits=limits, walls=False) as jail:
            jail.start(time_limit)
            return jail.call(None, PairRun, most=limits.output)
    except ChildError as error:
        raise SimulationError(error.explain("the run"), "time_limit") from None


def open_run(argument: tuple[Any, ...]) -> Callable[[Any], PairRun]:
    """Return a handler that does the run."""
    return lambda _: run_pair(*argument)
