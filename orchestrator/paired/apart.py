"""One paired run in a child process, so that its time can be limited. The FMUs are ours: nothing is kept from them."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from orchestrator.errors import ChildError, SimulationError
from orchestrator.master.protocol import Value
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.pair import PairRun, run_pair
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import Limits

_BOUNDLESS = 1 << 50


def run_pair_within(
    time_limit: float,
    experiment: Experiment,
    fmus: Mapping[str, Path],
    alpha: float,
    seed: int = 0,
    start: Mapping[str, Value] | None = None,
) -> PairRun:
    """Do what ``run_pair`` does, within ``time_limit`` seconds of wall time.

    Args:
        time_limit: [s], the start of the child process included.
    """
    limits = Limits(time_limit, _BOUNDLESS, _BOUNDLESS, math.inf, _BOUNDLESS, _BOUNDLESS, _BOUNDLESS, 1 << 16)
    argument = (experiment, {name: path.absolute() for name, path in fmus.items()}, alpha, seed, dict(start or {}))
    try:
        with Jail("orchestrator.paired.apart:open_run", argument, limits=limits, walls=False) as jail:
            jail.start(time_limit)
            found: PairRun = jail.call(None, most=_BOUNDLESS, answer=PairRun)
    except ChildError as error:
        if error.reason == "time":
            text = f"the run must take at most {time_limit:g} s (`time_limit`), but takes longer"
            raise SimulationError(text, "time_limit") from None
        raise SimulationError(f"the run must come to its end, but {error}") from None
    return found


def open_run(argument: tuple[Any, ...]) -> Callable[[Any], PairRun]:
    """Return a handler that does the run."""
    return lambda _: run_pair(*argument)
