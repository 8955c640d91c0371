"""The driven run: what it changes is found here, and it is what the later probes compare with."""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.movement import Movement, distinct, moved, settable
from orchestrator.checking.probing.probes import Context, remarks
from orchestrator.checking.probing.statuses import DiscardedError, StatusError, TerminatedError
from orchestrator.checking.probing.trajectory import excitation
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import declare
from orchestrator.errors import ChildError
from orchestrator.shared.stopwatch import Stopwatch

declare("""
[inputs]
run.input-refused | W | 2.1.7 | 2.2.7.3 | inputs within their bounds are accepted | state the bounds in min and max
run.moved-crash | W | 2.1.7 | 2.2.7.3 | values within the limits of the description do not end the process | refuse such a value, or state min and max
[setting]
value.set | E | 2.1.7 | 2.3.2 | start values can be set before initialisation, and change nothing | accept what the XML says can be set
value.set-initial | W | 2.1.7 | 2.3.2 | variables with initial exact accept their start value before initialisation | accept it, or write initial="calculated"
""")  # noqa: E501

_MOST_TRIALS = 24
_TRIAL_STEPS = 5  # most that an FMU does not take is refused when it is set, or soon
_MOST_CRASHES = 3
_PATIENCE = 4.0  # budgets of a run for finding what an FMU takes
_DEAR = 3.0  # times what a run from the values of the file costs: a driven one that costs more has fewer steps
_CHEAP = 0.05  # s: what costs less is never dear
_FEWEST_STEPS = 25
_NEARER = ((18, False), (19, False), (18, True))
"""Of the values of ``moved``, a tenth as far as the first, on both sides; then numbers alone."""
_NEARER_SHARE = 0.1


def inputs(context: Context) -> None:
    """Run with moving inputs, parameters and start values; what is recorded is what the later probes compare with."""
    bench = context.bench
    refused = None
    with bench.instance() as driver:
        for v in bench.job.inputs():
            try:
                driver.set([v], excitation(v, 0.0, bench.duration))
            except StatusError as error:
                refused = f"{error} for `{v.name}`, which was set within its bounds"
                break
    if refused is not None:
        context.report("run.input-refused", refused)
        bench.excited = False
    began = bench.library.jail.processor_time()
    try:
        with bench.instance() as driver:
            context.plain = bench.run(driver)
            remarks(context, driver)
    except DiscardedError as error:
        if error.again or not bench.excited:
            raise
        bench.excited = False  # the life cycle was possible with the start values
        with bench.instance() as driver:
            context.plain = bench.run(driver)
    seconds = bench.library.jail.processor_time() - began
    context.trace = context.plain
    search = _Search(context)
    search.find()
    _shorten(context, seconds, search.seconds)


def _shorten(context: Context, plain: float, driven: float) -> None:
    """Let runs have fewer steps where those away from the values of the file cost the FMU far more time.

    Then there is time for the runs near these values alone, where there are two kinds. ``plain, driven``: what a run
    from the values of the file and the driven run took [s].
    """
    bench, job = context.bench, context.bench.job
    allowed = max(_DEAR * plain, _CHEAP)
    steps = job.steps if driven <= allowed else max(int(job.steps * allowed / driven), _FEWEST_STEPS)
    if steps >= job.steps:
        return
    bench.job = replace(job, steps=steps)
    context.far = None
    with bench.instance(moved=False) as driver:
        context.plain = bench.run(driver)
    with bench.instance() as driver:
        context.trace = bench.run(driver)


class _Search:
    """Looks for what can be changed in a run without that the FMU refuses it, a type at a time."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.bench = context.bench
        self.trials = self.crashes = 0
        self.steps = context.bench.job.steps
        self.seconds = 0.0
        """What the run with the movement took the FMU."""
        self.budget = Stopwatch(_PATIENCE * context.bench.job.budget)

    def find(self) -> None:
        """Leave the movement in the bench, and its run in the context."""
        groups = _groups(self.bench.job)
        everything = [v for group in groups for v in group]
        if everything:
            self._find(groups, everything)
            self._enliven()

    def _find(self, groups: Sequence[Sequence[ProbedVariable]], everything: list[ProbedVariable]) -> None:
        """Move everything, or as much of it as the FMU takes."""
        if self._works(everything):
            return
        for steps in (min(_TRIAL_STEPS, self.bench.job.steps), self.bench.job.steps):
            self.trials, self.steps = 0, steps
            accepted: list[ProbedVariable] = []
            for group in groups:
                accepted = self._add(accepted, group)
            if self._works(accepted):
                return
        self.bench.movement = Movement()
        self.context.trace, self.seconds = self.context.plain, 0.0

    def _enliven(self) -> None:
        """Stay nearer to the values of the file where outputs switch with these and no longer with those that are far.

        A threshold that is never reached hides what lies behind it from all later probes.
        """
        bench, context = self.bench, self.context
        chosen = list(bench.movement.values)
        far = bench.movement, context.trace, context.plain
        lacking = self._still()
        for which, numbers in _NEARER if lacking else ():
            if self.budget.over or self.crashes:
                break
            before = bench.movement, context.trace, self.seconds
            if self._works(chosen, None, which, numbers) and len(still := self._still()) < len(lacking):
                lacking = still
            else:
                bench.movement, context.trace, self.seconds = before
            if not lacking:
                break
        if bench.movement is not far[0]:
            context.far = far
            with bench.instance(moved=False) as driver:
                context.plain = bench.run(driver)

    def _still(self) -> set[int]:
        """Places of recorded values, floating point ones aside, that switch near the values of the file alone."""
        context = self.context
        near = [zip(*rows, strict=True) for rows in (context.quiet, context.plain) if rows]
        moving = {
            i
            for columns in near
            for i, column in enumerate(columns)
            if not isinstance(column[0], float) and len(set(column)) > 1
        }
        driven = list(zip(*(context.trace or ()), strict=True))
        return {i for i in moving if i < len(driven) and len(set(driven[i])) == 1}

    def _add(self, accepted: list[ProbedVariable], group: Sequence[ProbedVariable]) -> list[ProbedVariable]:
        """What of a group can be moved with the others: all of it, or of its halves."""
        if not group or self.trials >= _MOST_TRIALS or self.crashes >= _MOST_CRASHES or self.budget.over:
            return accepted
        if self._works([*accepted, *group], self.steps):
            return [*accepted, *group]
        if len(group) == 1:
            return accepted
        half = len(group) // 2
        return self._add(self._add(accepted, group[:half]), group[half:])

    def _works(
        self, variables: Sequence[ProbedVariable], steps: int | None = None, which: int = 0, numbers: bool = False
    ) -> bool:
        """Whether a run can be done while these variables are moved: a whole one, or its first ``steps``.

        Args:
            which: of the values that ``moved`` knows.
            numbers: whether floating point numbers alone are others at the start; inputs still switch in the run.
        """
        self.trials += 1
        bench = self.bench
        values = {v: x for v in variables if (x := moved(v, v.start or (), which)) is not None}
        switched = tuple(v for v in values if v.causality == "input" and not (v.real and v in bench.job.inputs()))
        values |= {v: v.start or () for v in values if numbers and not v.real}
        bench.movement = Movement(values, switched if bench.excited else (), _NEARER_SHARE if which else 1.0)
        began = bench.library.jail.processor_time()
        try:
            with bench.instance() as driver:
                trace = bench.run(driver, 0, steps)
        except (StatusError, DiscardedError, TerminatedError):
            return False
        except ChildError as error:
            self.crashes += 1
            if len(values) == 1:
                (v,) = values
                text = f"no value within the limits must end the process, but {error} with another value of `{v.name}`"
                self.context.report("run.moved-crash", text, v.name)
            bench.library.renew()
            return False
        self.context.trace = trace
        self.seconds = bench.library.jail.processor_time() - began
        return True


def _groups(job: ProbeJob) -> list[list[ProbedVariable]]:
    """What can be moved, by kind and type: inputs, then parameters, then start values."""
    chosen = [v for v in distinct(job.variables) if settable(v) and moved(v, v.start or ()) is not None]
    found: dict[tuple[int, str], list[ProbedVariable]] = {}
    for v in chosen:
        if job.interface == "ScheduledExecution" and v.causality == "input":
            continue
        rank = ("input", "parameter").index(v.causality) if v.causality in ("input", "parameter") else 2
        found.setdefault((rank, "enumeration" if v.items else v.base), []).append(v)
    return [found[key] for key in sorted(found, key=lambda k: (k[0], not k[1].startswith(("Real", "Float")), k[1]))]


def setting(context: Context) -> None:
    """Set everything that can be set to its start value: accepted, and without effect.

    Inputs are set in initialisation mode: before it, FMI 2.0 allows that for variables with ``initial`` only.
    """
    bench, job = context.bench, context.bench.job
    chosen = [v for v in job.variables if settable(v)]
    with bench.instance(initialised=False) as driver:
        entered = False
        for v in sorted(chosen, key=lambda v: v.causality == "input"):
            if v.causality == "input" and not entered:
                driver.enter_initialisation(job.start, job.stop)
                entered = True
            try:
                driver.set([v], v.start or (), f"for `{v.name}`, set to its start value,")
            except StatusError as error:
                rule = "value.set" if v.causality in ("input", "parameter") else "value.set-initial"
                context.report(rule, str(error), v.name)
                return
        if context.plain is None:
            return
        if not entered:
            driver.enter_initialisation(job.start, job.stop)
        driver.exit_initialisation()
        difference = context.compare(context.plain, bench.run(driver))
    if difference is not None:
        context.report_difference("value.set", "a run must not change when start values are set", difference)
