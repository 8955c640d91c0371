"""Guided runs: the FMU is led along the record by an effort at each port whose position is measured.

A free run adds up all that a model lacks: friction turns round at another time, a pendulum falls to the other side, and
what is left says little. A guided run stays where the record is. How far it is off, filtered, is how far a prediction
is off; for a linear FMU both ways say the same. The effort asks for the measured output alone: neither for the FMU's
state nor for a reset within a run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.problem import BoxProblem, series_of
from orchestrator.diagnosis.blackbox.runner import Plan
from orchestrator.diagnosis.blackbox.whitening import Surrogate
from orchestrator.diagnosis.blackbox.wire import Guide
from orchestrator.errors import SlaveError
from orchestrator.master.protocol import Value
from pyfmu_sources.port_laws import INERTIA

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pull:
    """Leads an output of a run along the record by an effort at an input.

    Attributes:
        input, output: their places among the FMU's inputs and the measured outputs.
        massive: an effort changes the output by what grows with time squared (a mass), and not with time (a store).
    """

    input: int
    output: int
    massive: bool


@dataclass
class GuidedProblem(BoxProblem):
    """Simulates models along one record.

    How fast a run follows is the same for all of them, whatever their inertia: a model that is led more firmly would
    keep closer to the record for no merit of its own.

    Attributes:
        pulls: what leads them.
        speed: how fast, as a share of a radian a sample.
    """

    pulls: tuple[Pull, ...] = ()
    speed: float = 0.0
    _answers: dict[tuple[Value, ...], Array] = field(init=False, default_factory=dict, repr=False)

    @property
    def caught(self) -> int:
        """Return the row from which on a run has caught up with the record, wherever it started."""
        return int(np.ceil(self.settings.guide.caught / self.speed))

    @property
    def guide(self) -> Guide | None:
        """Return what leads runs along the record."""
        outputs = [pull.output for pull in self.pulls]
        samples = np.ascontiguousarray(self.data.outputs[:, outputs])
        return Guide([pull.input for pull in self.pulls], outputs, samples, self.m)

    def impulses(self, model: BoxModel, length: int, places: Sequence[int] | None = None) -> tuple[Surrogate, Array]:
        """Return the surrogate of guided runs, with what leads them where it is that at the ports, and its drive.

        Args:
            model: parameters, effects and their values.
            length: of the responses, in samples.
            places: of the inputs (default: those of the ports).

        Returns:
            The surrogate, and the sizes in the units of the ports.
        """
        surrogate, sizes = super().impulses(model, length, places)
        if places is not None:
            return surrogate, sizes
        near, faster = (np.zeros((len(self.noise_places), len(self.outputs))) for _ in range(2))
        drive = self.drive(self.noise_places)
        for pull, gains in zip(self.pulls, self._gains([Plan(self.starts(model), np.zeros((0, 0)))])[0], strict=True):
            at = self.noise_places.index(pull.input)
            unit = self.noise[pull.output] / drive[at]
            near[at, pull.output], faster[at, pull.output] = gains[0] * unit, gains[1] * unit
        return replace(surrogate, near=near, faster=faster), sizes

    def _runs(self, plans: Sequence[Plan]) -> list[Array | None]:
        gains = self._gains(plans)
        return super()._runs([replace(plan, pulls=own) for plan, own in zip(plans, gains, strict=True)])

    def _gains(self, plans: Sequence[Plan]) -> list[tuple[tuple[float, float], ...]]:
        """Return the gains of each run: poles of a critically damped oscillator, or of a lag, ``speed`` fast."""
        self._measure(plans)
        found = []
        for plan in plans:
            answers = self._answers.get(tuple(plan.starts.values()))
            found.append(() if answers is None else tuple(map(self._gain, self.pulls, answers, [plan] * len(answers))))
        return found

    def _gain(self, pull: Pull, answer: Array, plan: Plan) -> tuple[float, float]:
        if not pull.massive:
            return self.speed / float(answer[0]), 0.0
        added = sum(e.q[0] * e.sign for e in plan.effects if e.law == INERTIA and e.input == pull.input) / self.h**2
        mass = 1.0 / float(answer[1] - answer[0]) + added
        return self.speed**2 * mass, 2.0 * self.speed * mass

    def _measure(self, plans: Sequence[Plan]) -> None:
        """Measure how outputs answer to efforts with those start values of runs that are new.

        What is kept, (pulls, 2), is the answer after one sample and after two, for an effort of 1 over the first.
        """
        starts = {tuple(plan.starts.values()): plan.starts for plan in plans}
        fresh = {key: values for key, values in starts.items() if key not in self._answers}
        plain = series_of(self, 3)
        tables = [plain]
        for pull in self.pulls:
            pushed = plain.copy()
            pushed[: self.m, pull.input] += self._push(pull)
            tables.append(pushed)
        short = [Plan(values, table) for values in fresh.values() for table in tables]
        runs = super()._runs(short)
        for k, key in enumerate(fresh):
            base, *moved = runs[k * len(tables) : (k + 1) * len(tables)]
            if base is None or any(run is None for run in moved):
                continue
            self._answers[key] = np.array(
                [
                    (run - base)[[self.m, 2 * self.m], pull.output] / self._push(pull)
                    for pull, run in zip(self.pulls, moved, strict=True)
                    if run is not None
                ]
            )

    def _push(self, pull: Pull) -> float:
        return self.settings.probe.impulse * float(self.drive([pull.input])[0])

    def answers(self) -> Array | None:
        """Return how outputs answer to efforts by the nominal values, (pulls, 2), after one sample and after two.

        Returns:
            The answers to an effort of 1 over the first sample; None where the FMU fails.
        """
        plan = Plan(self.starts(self.nominal), np.zeros((0, 0)))
        self._measure([plan])
        return self._answers.get(tuple(plan.starts.values()))


def guided(problem: BoxProblem) -> GuidedProblem | None:
    """Return a problem whose runs are led along the record; None where no port's position is measured, or none holds.

    Args:
        problem: whose runs are free.

    Returns:
        The problem, of the same children.
    """
    own = problem.settings.guide
    places = [
        Pull(problem.runner.inputs.index(port.input), problem.outputs.index(port.position), True)
        for port in problem.map.ports.values()
        if port.position in problem.outputs
    ]
    given = {f.name: getattr(problem, f.name) for f in fields(BoxProblem) if f.init}
    answers = GuidedProblem(**given, pulls=tuple(places)).answers() if places else None
    if answers is None:
        return None
    moved = [(pull, one) for pull, one in zip(places, answers, strict=True) if np.all(one != 0.0)]
    pulls = tuple(replace(pull, massive=bool(second / first > own.massive)) for pull, (first, second) in moved)
    for speed in (own.speed, own.speed / own.slower) if pulls else ():
        led = GuidedProblem(**given, pulls=pulls, speed=speed)
        try:
            if _holds(led, problem):
                return led
        except SlaveError:
            continue
    return None


def _holds(led: GuidedProblem, problem: BoxProblem) -> bool:
    """Tell whether a guided run of the nominal model keeps closer to the record than a free one."""
    near, free = (p.simulate([p.nominal])[0] for p in (led, problem))
    if near is None:
        return False
    off = [np.sqrt(np.mean(led.residual(y) ** 2, axis=0)) for y in (near, near if free is None else free)]
    outputs = [pull.output for pull in led.pulls]
    return bool(np.all(np.isfinite(off[0])) and np.all(off[0][outputs] <= off[1][outputs]))
