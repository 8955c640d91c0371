"""Points of a driven run at which a system is looked at: what can be changed there, and how the rest answers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.model_exchange import ModelExchange
from orchestrator.checking.probing.movement import distinct, scale_of
from orchestrator.checking.probing.statuses import TerminatedError
from orchestrator.checking.probing.trajectory import Bench
from orchestrator.checking.probing.variables import ProbedVariable

_SHARES = (0.1, 0.45, 0.62)
"""Shares of a run at which it is looked at: away from its start, and at different phases of the inputs.

At the last of them switches are as in the file (``trajectory``), before it they are not.
"""
_PUSH = (0.5, -0.9, 1.3)
"""By how many of their scales continuous states are pushed there in model exchange."""


@dataclass(frozen=True)
class RestPoint:
    """A driven run that rests at a communication point; in model exchange the states are pushed off their path."""

    driver: Driver
    number: int  # of the point, from 0
    time: float  # [s]

    @property
    def states(self) -> tuple[ProbedVariable, ...]:
        """The variables of the continuous states that can be set here; none in co-simulation."""
        return state_vector(self.driver)

    def get(self, v: ProbedVariable) -> tuple[float, ...]:
        return tuple(map(float, self.driver.get([v])))

    def put(self, v: ProbedVariable, values: Sequence[float]) -> None:
        """Set an input, or a state by the whole vector of states."""
        states = self.states
        if v not in states:
            self.driver.set([v], values)
            return
        assert isinstance(self.driver, ModelExchange)
        x = self.driver.continuous_states()
        first = sum(w.size for w in states[: states.index(v)])
        x[first : first + v.size] = values
        self.driver.set_continuous_states(x)


def state_vector(driver: Driver) -> tuple[ProbedVariable, ...]:
    """The variables of the vector of states, where each is there once."""
    variables = driver.job.state_variables
    if not isinstance(driver, ModelExchange) or not variables or len(distinct(variables)) < len(variables):
        return ()
    return variables if sum(v.size for v in variables) == driver.memory["states"] else ()


def points(bench: Bench, driver: Driver) -> Iterator[RestPoint]:
    """Go through a driven run from its start, where ``driver`` is, and rest at some of its points."""
    job = bench.job
    done = 0
    for number, share in enumerate(_SHARES):
        goal = max(int(share * job.steps), min(number, job.steps - 1))
        try:
            bench.run(driver, done, goal, read=False)
        except TerminatedError:
            return
        done = max(done, goal)
        t = job.start + done * job.step
        bench.excite(driver, t)
        if not isinstance(driver, ModelExchange):
            yield RestPoint(driver, number, t)
            continue
        x = driver.continuous_states()
        driver.set_continuous_states(_push_states(driver, x, number))
        yield RestPoint(driver, number, t)
        driver.set_continuous_states(x)


def _push_states(driver: ModelExchange, x: Sequence[float], number: int) -> list[float]:
    """States off their path, different ones by different amounts."""
    owners = [v for v in state_vector(driver) for _ in range(v.size)]
    found = []
    for i, value in enumerate(x):
        v = owners[i] if owners else None
        size = 0.1 * float(driver.memory["nominals"][i]) if v is None else scale_of(v, value)
        pushed = value + _PUSH[number % len(_PUSH)] * size * (1.0 + 0.1 * (i % 7))
        low, high = (pushed, pushed) if v is None else v.limits
        found.append(pushed if low <= pushed <= high else value)
    return found
