"""Diagnosis of any FMU: probe, fit, search, proof on held-out data, verdict."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.ahead import comes_ahead
from orchestrator.diagnosis.blackbox.bank import INPUT, PORT, BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.guiding import guided
from orchestrator.diagnosis.blackbox.judged import BoxOutcome, judged
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.mapping import Map
from orchestrator.diagnosis.blackbox.model import Data
from orchestrator.diagnosis.blackbox.noise import begins_elsewhere, lone_rows, noise_of
from orchestrator.diagnosis.blackbox.parts import BoxParts, interleaved, parts_of
from orchestrator.diagnosis.blackbox.probing import Probe, opened, reduced
from orchestrator.diagnosis.blackbox.problem import BoxProblem
from orchestrator.diagnosis.blackbox.search import BoxSearch
from orchestrator.diagnosis.blackbox.settings import DEFAULT, BoxSettings, RestSettings
from orchestrator.diagnosis.blackbox.sites import effects_of
from orchestrator.diagnosis.blackbox.steps import labels
from orchestrator.diagnosis.blackbox.subject import Subject
from orchestrator.diagnosis.blackbox.verdict import settled_names
from orchestrator.diagnosis.blackbox.whitening import Ladder
from orchestrator.diagnosis.blackbox.whole import on_all_rows

Array = NDArray[np.float64]


Progress = Callable[[str], None]
ALIKE_BEHIND = {"input_gain": "output_gain", "input_delay": "output_delay", "input_lag": "output_lag"}
"""Effects that do the same before a linear FMU and behind it."""


def prepared(
    subject: Subject,
    given: Map,
    data: Data,
    workers: int | None = None,
    progress: Progress = lambda what: None,
    settings: BoxSettings = DEFAULT,
) -> tuple[BoxProblem, Probe]:
    """Return a probed problem without what does nothing, its noise known.

    Args:
        subject: the FMU, or several.
        given: the map.
        data: the record.
        workers: child processes.
        settings: thresholds.

    Returns:
        The problem, whose children the caller ends, and what the FMU was found to be.

    Raises:
        FmuError: the FMU cannot be used.
    """
    problem, probe = opened(subject, given, data, workers, progress, settings)
    problem.units = subject.units
    problem.map = reduced(given, probe)
    problem.sign = probe.sign
    y = problem.must_simulate(problem.nominal)
    data = problem.data
    noise, notes = noise_of(given, data, [data.outputs, data.outputs - y], settings.probe)
    problem.noise = np.sqrt(noise**2 + probe.solver_error**2)
    notes += begins_elsewhere(problem, y, settings.probe) + lone_rows(problem, y, settings.probe)
    return problem, replace(probe, notes=probe.notes + notes)


def fitters(problem: BoxProblem, parts: BoxParts, settings: BoxSettings = DEFAULT) -> list[Fitter]:
    """Return fitters that take the FMU's start as exact, and as somewhat off.

    Args:
        problem: the FMU and the record.
        parts: of the record: fitted, deciding, held out.
        settings: thresholds.

    Returns:
        Two fitters.
    """
    surrogate, drive = problem.impulses(problem.nominal, max(problem.n // 2, 16))
    return [
        Fitter(problem, Ladder(surrogate, drive, problem.n, off, settings.noise), parts, settings)
        for off in (0.0, settings.start.spread)
    ]


def diagnose(
    subject: Subject,
    given: Map,
    data: Data,
    settings: BoxSettings = DEFAULT,
    progress: Progress = lambda what: None,
    workers: int | None = None,
) -> BoxOutcome:
    """Return what ``data`` says of an FMU, or of several.

    Args:
        subject: the FMU, or several.
        given: the map.
        data: the record.
        settings: thresholds.
        progress: called with what is being done.
        workers: child processes.

    Returns:
        The verdict, with all that it rests on.

    Raises:
        FmuError: the FMU cannot be used.
        SlaveError: it fails again and again.
    """
    begun = time.monotonic()
    progress("probing")
    problem, probe = prepared(subject, given, data, workers, progress, settings)
    try:
        with np.errstate(all="ignore"):
            return _diagnosed(problem, probe, settings, progress, begun)
    except BaseException:
        problem.runner.close()
        raise


def _diagnosed(
    problem: BoxProblem, probe: Probe, settings: BoxSettings, progress: Progress, begun: float
) -> BoxOutcome:
    parts = parts_of(problem.n)
    nominal_reads = problem.must_read(problem.nominal)
    effects = effects_of(problem, nominal_reads)
    tried: list[tuple[BoxSearch, BoxFit, BoxFit]] = []
    for n, fitter in enumerate(fitters(problem, parts, settings)):
        search = BoxSearch(fitter, effects, settings.search, progress, until=begun + problem.map.options.budget)
        base = search.base()
        if base is None:
            raise problem.does_not_run()
        tried.append((search, base, base))
        if n == 0 and search.explained(base):
            break
    chosen = tried[0]
    if len(tried) > 1 and tried[1][1].total > tried[0][1].total + settings.start.pays:
        chosen = tried[1]
    search, base, _ = chosen
    best = search.run(base)
    base = search.plain or base
    if len(tried) > 1 and (search.fitter.ladder.spread > 0.0 or not search.explained(best)):
        # The other view of the start, from the model found: a wrong model hides what the start was.
        other = next(t[0] for t in tried if t[0] is not search)
        again = other.fitter.fit(best.model, best.level)
        if again is not None:
            again = other.fitter.settled(again)
            pays = settings.start.pays if other.fitter.ladder.spread > 0.0 else -settings.start.pays
            if again.total > best.total + pays:
                other.earlier = tuple(search.steps)
                rebased = other.fitter.fit(base.model, base.level)
                search, best, base = other, other.run(again, rebased or base), rebased or base
                base = search.plain or base
    search, base, best = _interleaved(search, base, best, settings.rest)
    # What a start that is off explains by itself needs no effect.
    if best.model.effects and (len(tried) == 1 or search.fitter.parts is not parts):
        offset = fitters(problem, search.fitter.parts, settings)[1]
        plain = BoxSearch(offset, effects, settings.search, progress)
        found = plain.base()
        if found is not None:
            tried = [tried[0], (plain, found, found)]
    for other, found, _ in tried[1:]:
        if other is not search and best.model.effects:
            fewer = _with_fewer(search, best, other, found)
            if fewer is not None:
                search, base, best = other, found, fewer if other.explained(fewer) else other.run(fewer, found)
    best, families = settled_names(search, best)
    free = judged(problem, probe, search, base, best, families, begun, settings.rest)
    if free.verdict != "unknown" or search.late:
        return free
    led = _guided(free, progress, begun, settings)
    return led if led is not free else replace(free, warnings=free.warnings + comes_ahead(search, base))


def _guided(free: BoxOutcome, progress: Progress, begun: float, settings: BoxSettings) -> BoxOutcome:
    """Return what guided runs name, where free ones name nothing."""
    problem = free.problem
    led = guided(problem)
    if led is None:
        return free
    progress("guided runs")
    effects = [e for e in effects_of(led, led.must_read(led.nominal)) if e.kind.where in (INPUT, PORT)]
    fitter = fitters(led, parts_of(led.n, led.caught), settings)[1]
    search = BoxSearch(fitter, effects, settings.search, progress, until=begun + problem.map.options.budget)
    base = search.base()
    if base is None:
        return free
    best, families = settled_names(search, search.run(base))
    families = tuple(behind(e, family, led.outputs) for e, family in zip(best.model.effects, families, strict=True))
    found = judged(problem, free.probe, search, search.plain or base, best, families, begun, settings.rest)
    # A run that is led has little left to explain: it says what is missing, never that nothing is.
    return found if found.verdict == "effects" else free


def behind(effect: BoxEffect, family: tuple[str, ...], outputs: Sequence[str]) -> tuple[str, ...]:
    """Return the family of an effect that guided runs name, with what does the same behind a linear FMU.

    A guide leads what is before the effects at outputs: they are not tried.

    Args:
        effect: that is named.
        family: labels that the record does not tell from it.
        outputs: names of the measured ones.

    Returns:
        The labels.
    """
    kind = ALIKE_BEHIND.get(effect.kind.name)
    return (*family, *(f"{kind}@{name}" for name in outputs if kind is not None))


def _with_fewer(search: BoxSearch, best: BoxFit, other: BoxSearch, base: BoxFit) -> BoxFit | None:
    """Return the fit of fewer effects to which a start that is off brings ``best``; None where there is none.

    Offsets on either side of an FMU make up for a start that is off, and pay: what came before them is tried without.
    """
    least = search.score(best) - other.fitter.settings.start.pays
    if other.score(base) > least:
        return base
    steps = {labels(step.before): step.before for step in (*search.earlier, *search.steps)}
    for names, before in sorted(steps.items(), key=lambda item: len(item[0])):
        if names and names < labels(best):
            fit = other.fitter.fit(before.model, before.level)
            fit = None if fit is None else other.fitter.settled(fit)
            if fit is not None and other.score(fit) > least:
                return fit
    return None


def _interleaved(
    search: BoxSearch, base: BoxFit, best: BoxFit, settings: RestSettings
) -> tuple[BoxSearch, BoxFit, BoxFit]:
    """Return a search whose parts take turns, where that explains what the one before does not.

    An effect that acts in one half of the record only (a limit that is seldom reached) is not found in the other, and
    one that acts in the held-out quarter only is not found at all.
    """
    fitter, whole = search.fitter, search.explained(best)
    unkept = any(step.unkept for step in search.steps if step.before is best)
    if (
        search.late
        or search.idle(best)
        or (whole and not unkept and on_all_rows(search, best, settings).rest.nothing_missing)
    ):
        return search, base, best
    parts = interleaved(fitter.problem.n, fitter.settings.fit.pieces, whole)
    turns = BoxSearch(
        Fitter(fitter.problem, fitter.ladder, parts, fitter.settings),
        search.effects, search.settings, search.progress, earlier=(*search.earlier, *search.steps), until=search.until,
    )  # fmt: skip
    plain = turns.fitter.fit(base.model, base.level)
    start = turns.fitter.fit(best.model, best.level) if best.model.effects else plain
    if plain is None or start is None:
        return search, base, best
    found = turns.run(start, plain)
    explains = bool(found.model.effects) and turns.explained(found)
    return (turns, turns.plain or plain, found) if explains else (search, base, best)
