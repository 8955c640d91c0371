"""What a search comes to: verdict, effects with their sizes, parameters, misfit on data that no fit has seen."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import PARAMETER
from orchestrator.diagnosis.blackbox.estimates import (
    FoundEffect,
    OutputMisfit,
    ValueEstimate,
    as_told,
    errors_of,
    estimates_of,
    misfits,
)
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.held_out import HeldOut, held_out
from orchestrator.diagnosis.blackbox.lawful import dependence_of
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.probing import Probe
from orchestrator.diagnosis.blackbox.problem import BoxProblem
from orchestrator.diagnosis.blackbox.rest import Rest, rest_of
from orchestrator.diagnosis.blackbox.search import BoxSearch
from orchestrator.diagnosis.blackbox.settings import BoxSearchSettings, RestSettings
from orchestrator.diagnosis.blackbox.sites import alike_at_input, alike_one_way
from orchestrator.diagnosis.blackbox.verdict import recovered
from orchestrator.diagnosis.blackbox.whole import doubted, on_all_rows, on_finer_steps

Array = NDArray[np.float64]
SETTINGS_OF_A_CHANNEL = ("output_gain", "output_offset")
"""Effects that take up the mean or the size of whatever is missing: alone they are told only where no more is left."""


@dataclass(frozen=True)
class BoxOutcome:
    """What a record says of an FMU.

    Attributes:
        verdict: "none", "parameters", "effects" or "unknown".
        effects: what is missing, in the order found; with "unknown": empty.
        suspects: with "unknown": what came nearest.
        parameters: re-fitted values.
        misfit: of each output.
        model: the corrected model.
        rest: what it leaves.
        held_out: what the effects do to free runs over data that no fit has seen.
        probe: what the FMU was found to be.
        where: sentences: output, interval of time and how far what is left exceeds noise.
        warnings: sentences.
        problem: ready to simulate further models; closed by ``close``.
        refitted: the model without effects, its parameters re-fitted.
        stages: runs of the nominal, re-fitted and corrected model, (n, outputs) each.
    """

    verdict: str
    effects: tuple[FoundEffect, ...]
    suspects: tuple[str, ...]
    parameters: tuple[ValueEstimate, ...]
    misfit: tuple[OutputMisfit, ...]
    model: BoxModel
    rest: Rest
    held_out: HeldOut
    probe: Probe
    where: tuple[str, ...]
    warnings: tuple[str, ...]
    refitted: BoxModel
    problem: BoxProblem = field(repr=False)
    stages: tuple[Array, Array, Array] = field(repr=False)
    search: BoxSearch | None = field(repr=False, default=None)
    seconds: float = 0.0
    runs: int = 0

    @property
    def late(self) -> bool:
        """Whether the search was cut short."""
        return self.search is not None and self.search.late


def judged(
    problem: BoxProblem,
    probe: Probe,
    search: BoxSearch,
    base: BoxFit,
    best: BoxFit,
    families: tuple[tuple[str, ...], ...],
    begun: float,
    settings: RestSettings,
) -> BoxOutcome:
    """Return what a search comes to.

    Args:
        problem: whose runs are free; those of the search may have been guided.
        probe: what the FMU was found to be.
        search: that was carried out.
        base: fit of the re-fitted parameters alone.
        best: fit of the best model.
        families: labels that the record does not tell from each of its effects.
        begun: when the diagnosis began, monotonic [s].
        settings: when something is missing.

    Returns:
        The outcome.
    """
    fitter, seen = search.fitter, search.fitter.parts.looked_at
    on_all = on_all_rows(search, best, settings)
    rest = doubted(search, on_all, settings)
    refuted = on_all.rest.disturbed and not rest.disturbed
    on_all = on_finer_steps(search, on_all) if rest.nothing_missing else on_all
    problem.m = fitter.problem.m
    last = on_all.last
    parameters, values = estimates_of(problem, last.model, errors_of(fitter, last, seen, rest.nothing_missing))
    nothing = _of_no_size(last, values, search.settings) if rest.nothing_missing else None
    if nothing is not None:
        fewer = fitter.fit(best.model.without(best.model.effects[nothing].label), best.level)
        if fewer is not None:
            others = families[:nothing] + families[nothing + 1 :]
            return judged(problem, probe, search, base, fitter.settled(fewer), others, begun, settings)
    if not rest.nothing_missing and not refuted and len(best.model.effects) > 1:
        for k, fewer in _with_one_less(problem, fitter, base, best, settings):
            others = families[:k] + families[k + 1 :]
            return judged(problem, probe, search, base, fewer, others, begun, settings)
    one_way, like = alike_one_way(problem), alike_at_input(problem, best.model.effects, values)
    families = tuple(
        tuple(dict.fromkeys(label for label in (*family, *one_way.get(e.label, ()), *like[k]) if label != e.label))
        for k, (e, family) in enumerate(zip(best.model.effects, families, strict=True))
    )
    stages = _stages(problem, base, last)
    on_held_out = held_out(problem, stages, fitter.parts.held_out, settings)
    gained = best.total - base.total
    verdict, rest = _verdict(search, last, values, rest, refuted, on_held_out, gained, settings)
    named = tuple(FoundEffect(e, as_told(e, values[k]), gained, families[k]) for k, e in enumerate(last.model.effects))
    suspects = tuple(e.label for e in best.model.effects) if verdict == "unknown" else ()
    if suspects:
        suspects += tuple(dict.fromkeys(label for family in families for label in family))
    share = recovered(base, best, len(problem.outputs), len(seen))
    return BoxOutcome(
        verdict, named if verdict == "effects" else (), suspects, parameters,
        misfits(problem, stages, fitter.parts.held_out), base.model if verdict == "unknown" else last.model,
        rest, on_held_out, probe,
        _where_of(problem, rest, settings.stands_out) if verdict == "unknown" else (),
        _warned(probe, search, verdict, best, share), base.model, problem, stages, search,
        time.monotonic() - begun, problem.runner.runs,
    )  # fmt: skip


def _with_one_less(
    problem: BoxProblem, fitter: Fitter, base: BoxFit, best: BoxFit, settings: RestSettings
) -> Iterator[tuple[int, BoxFit]]:
    """Yield fits that stand by what they do to unseen data without one of their effects, and its place, latest first.

    Where more than noise is left, what pays may follow what no law explains: nothing is named that is not needed.
    """
    for k in reversed(range(len(best.model.effects))):
        fewer = fitter.fit(best.model.without(best.model.effects[k].label), best.level)
        if fewer is None:
            continue
        stages = _stages(problem, base, fewer)
        if held_out(problem, stages, fitter.parts.held_out, settings).shows(settings):
            yield k, fewer


def _stages(problem: BoxProblem, base: BoxFit, last: BoxFit) -> tuple[Array, Array, Array]:
    """Return free runs of the nominal, the re-fitted and the corrected model; what fails is as the one before."""
    runs = problem.simulate([problem.nominal, base.model, last.model])
    if runs[0] is None:
        raise problem.does_not_run()
    refitted = runs[0] if runs[1] is None else runs[1]
    return runs[0], refitted, refitted if runs[2] is None else runs[2]


def _verdict(
    search: BoxSearch, last: BoxFit, values: Sequence[Sequence[ValueEstimate]], rest: Rest, refuted: bool,
    shown: HeldOut, gained: float, settings: RestSettings,
) -> tuple[str, Rest]:  # fmt: skip
    """Return the verdict, and what is left in its light.

    No law of friction is exact; but where what is left follows a law that explains more than the effects have gained
    in log-likelihood, something else is at work.
    """
    fitter, effects = search.fitter, last.model.effects
    if effects and rest.nothing_missing and shown.removed < settings.least_shown:
        why = f"the effects remove {100.0 * max(shown.removed, 0.0):.0f} % of the misfit on data not fitted"
        return "unknown", replace(rest, explained=False, disturbed=False, reasons=(why,))
    if rest.disturbed and rest.share > settings.solver and any(e.kind.where == PARAMETER for e in effects):
        why = "a parameter that changes can follow anything, and more than noise is left beside it"
        return "unknown", replace(rest, disturbed=False, reasons=(why,))
    if effects and rest.nothing_missing:
        return "effects", rest
    if effects:
        off = np.abs(last.model.p - fitter.mean) / fitter.sd
        plausible = bool(np.all(off < settings.implausible)) and all(e.kind.where != PARAMETER for e in effects)
        told = _of_no_size(last, values, search.settings) is None
        # What stands in for something else beside a disturbance does well on unseen data too.
        told = told and not refuted and any(e.kind.name not in SETTINGS_OF_A_CHANNEL for e in effects)
        if not (plausible and told and shown.shows(settings)):
            return "unknown", rest
        law = dependence_of(fitter, last, settings)
        if law is None or law.gain - max(law.by_chance, 0.0) <= gained:
            return "effects", rest
        return "unknown", replace(rest, reasons=(law.statement,))
    if not rest.nothing_missing:
        return "unknown", rest
    given = fitter.problem.nominal
    nominal = BoxFit(given, last.level, fitter.problem.must_simulate(given), 0.0, 0.0, 0.0, last.J)
    as_given = rest_of(fitter, nominal, slice(0, fitter.problem.n), settings).explained
    return ("none" if as_given else "parameters"), rest


def _of_no_size(
    last: BoxFit, values: Sequence[Sequence[ValueEstimate]], settings: BoxSearchSettings
) -> int | None:  # fmt: skip
    """Return the place of an effect whose sizes may all be zero, given all rows; None where there is none.

    It made up for the steps of the search, or for the rows that were left out. So does a ripple that need not repeat.
    """
    for k, (effect, found) in enumerate(zip(last.model.effects, values, strict=True)):
        sizes = found[: max(effect.amplitudes, 1)]
        if effect.kind.finer is None and all(abs(e.value) < settings.least_errors * e.standard_error for e in sizes):
            return k
        wavenumber = found[-1]
        if effect.kind.name == "ripple" and wavenumber.value < settings.least_sharp * wavenumber.standard_error:
            return k
    return None


def _warned(probe: Probe, search: BoxSearch, verdict: str, best: BoxFit, share: float) -> tuple[str, ...]:
    """Return sentences for the user; ``share``: of what is missing, how much the effects explain."""
    problem = search.fitter.problem
    warnings = [*probe.notes, *problem.runner.remarks]
    data = problem.data
    if data.factor > 1:
        rate = f"{1.0 / data.step:.4g} Hz"
        warnings.append(f"analysed at {rate}, one row for {data.factor}: nothing faster shows in the outputs")
    if search.late:
        warnings.append(
            f"the search was cut short after {problem.map.options.budget:g} s (`budget` of the map): a run takes about "
            f"{probe.step_cost * problem.n * problem.m:.2g} s; shorten the record or lower `substeps`"
        )
    if verdict == "unknown" and best.model.effects:
        warnings.append(
            f"the nearest effects explain {100.0 * share:.0f} % of what is missing, and more than noise is left"
        )
    if search.fitter.ladder.spread > 0.0:
        warnings.append(
            "the state that the FMU starts from is not the record's: the start is left out of the comparison"
        )
    return tuple(warnings)


def _where_of(problem: BoxProblem, rest: Rest, least: float) -> tuple[str, ...]:
    """Return where and when what is left exceeds noise, worst first."""
    found = []
    bounds = np.linspace(0, problem.n - 1, len(rest.blocks) + 1).astype(int)
    for b, block in enumerate(rest.blocks):
        for k, power in enumerate(block):
            if power > least:
                a, z = problem.data.time[bounds[b]], problem.data.time[bounds[b + 1]]
                found.append(
                    (
                        float(power),
                        f"{problem.outputs[k]} from {a:.4g} to {z:.4g} s: {power:.2g} times the expected power",
                    )
                )
    found.sort(reverse=True)
    return tuple(text for _, text in found[:5]) or tuple(rest.reasons[:3])
