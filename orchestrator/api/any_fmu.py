"""What any FMU misses, from a measured record."""

import csv
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orchestrator.api.arguments import chosen_settings
from orchestrator.api.shown import Block, Result, table
from orchestrator.diagnosis.blackbox.deliver import Delivered, deliver
from orchestrator.diagnosis.blackbox.diagnose import diagnose as diagnosing
from orchestrator.diagnosis.blackbox.draft import drafted
from orchestrator.diagnosis.blackbox.estimates import FoundEffect, OutputMisfit, ValueEstimate, validated
from orchestrator.diagnosis.blackbox.judged import BoxOutcome
from orchestrator.diagnosis.blackbox.mapping import read_map
from orchestrator.diagnosis.blackbox.rate import decimated, factor_of
from orchestrator.diagnosis.blackbox.reading import columns_of, read_data
from orchestrator.diagnosis.blackbox.settings import DEFAULT, BoxSettings
from orchestrator.diagnosis.blackbox.steps import counted
from orchestrator.diagnosis.blackbox.subject import subject_of
from orchestrator.diagnosis.blackbox.trust import SECOND, doubts, harm, statement
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.results.any_fmu import BoxDiagnosisFound, BoxStepFound, BoxTriedFound, LeftFound, OutputFound
from orchestrator.shared.results.diagnose import EffectFound, ParameterFound, ValueFound
from orchestrator.shared.settings import as_tables
from orchestrator.shared.trust import Trust

Progress = Callable[[str], None]


def fitted_values(estimates: Sequence[ValueEstimate]) -> dict[str, ParameterFound]:
    """Return re-fitted parameters as result files have them.

    Args:
        estimates: of the parameters.

    Returns:
        The parameters by name.
    """
    return {e.name: ParameterFound(e.nominal, e.value, e.standard_error, e.interval, e.unit) for e in estimates}


def _effect(f: FoundEffect) -> EffectFound:
    values = {e.name: ValueFound(e.value, e.standard_error, e.interval, e.unit) for e in f.estimates}
    return EffectFound(f.effect.kind.name, f.effect.place, values, f.gain, family=tuple(f.family))


def _outputs(misfit: Sequence[OutputMisfit]) -> dict[str, OutputFound]:
    return {m.output: OutputFound(m.nominal, m.refitted, m.corrected, m.noise, m.unit) for m in misfit}


@dataclass(frozen=True, repr=False)
class FmuDiagnosisResult(Result):
    """What a record says of an FMU.

    Attributes:
        outcome: verdict, effects, parameters, misfit and what is left.
        delivered: the corrected system, once it has been written.
        validation: misfit on a second record, if one was given.
        settings: thresholds that were used.
        notes: what was detected and filled when the record was read.
        arguments: what was asked for.
    """

    command: ClassVar[str] = "diagnose"
    replaces: ClassVar[tuple[str, ...]] = ("corrected.ssp",)
    outcome: BoxOutcome
    arguments: Mapping[str, Any] = field(default_factory=dict)
    delivered: list[Delivered] = field(default_factory=list)
    validation: tuple[OutputMisfit, ...] = ()
    settings: BoxSettings = DEFAULT
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """One of "none", "parameters", "effects" and "unknown"."""
        return self.outcome.verdict

    @property
    def effects(self) -> tuple[FoundEffect, ...]:
        """The effects that are missing: where, how large, and what cannot be told from them."""
        return self.outcome.effects

    @property
    def harm(self) -> tuple[str, ...]:
        """Sentences: on which outputs of the second record the corrected model is worse than without effects."""
        return harm(self.validation, SECOND, self.settings.rest) if self.effects else ()

    @property
    def statement(self) -> str:
        """What explains the record, and to what: a sentence without a full stop."""
        return statement(self.verdict, self.outcome.rest)

    @property
    def trust(self) -> Trust:
        """How far the result can be trusted."""
        o = self.outcome
        return doubts(o.verdict, o.effects, o.rest, o.misfit, self.validation, o.late, self.settings.rest)

    def blocks(self) -> Sequence[Block]:
        """Return the verdict, the effects and the misfit."""
        o = self.outcome
        lines: list[Block] = [f"Record: {'; '.join(self.notes)}"] * bool(self.notes)
        lines.append(f"Verdict: {o.verdict}: {self.statement}")
        for found in o.effects:
            values = ", ".join(
                f"{e.name} = {e.value:.5g} +- {e.standard_error:.2g} {'' if e.unit == '1' else e.unit}".rstrip()
                for e in found.estimates
            )
            lines.append(f"  {found.effect.kind.name} at {found.effect.place}: {values}")
            if found.family:
                lines.append(f"    this record does not tell it from {', '.join(found.family)}")
        lines += [f"  nearest, and not it: {name}" for name in o.suspects]
        lines += [f"Where: {text}" for text in o.where]
        lines += [f"Note: {text}" for text in o.warnings]
        trust = self.trust
        lines.append(f"Trust: {trust.level.word}")
        lines += [f"  {reason}" for reason in trust.reasons]
        rows = [(e.name, f"{e.nominal:.6g}", f"{e.value:.6g}", f"{e.standard_error:.2g}", e.unit) for e in o.parameters]
        lines.append(table("Parameters", ("name", "nominal", "re-fitted", "standard error", "unit"), rows))
        shown = [("held-out quarter", o.misfit)] + [("second record", self.validation)] * bool(self.validation)
        for which, misfit in shown:
            cells = [
                (m.output, *(f"{v:.3f}" for v in (m.nominal, m.refitted, m.corrected)), f"{m.noise:.3g} {m.unit}")
                for m in misfit
            ]
            head = ("output", "nominal", "re-fitted", "corrected", "noise")
            lines.append(table(f"Misfit over noise, {which}", head, cells))
        for d in self.delivered:
            lines.append(f"Corrected system: {d.path.name}; differs from the fit by {d.difference:.2g} of the noise")
        return lines

    def results(self, place: Path) -> BoxDiagnosisFound:
        """Return what goes into ``diagnose.json``."""
        o = self.outcome
        share = o.rest.share if o.rest.disturbed else None
        return BoxDiagnosisFound(
            verdict=o.verdict,
            statement=self.statement,
            trust=self.trust.found(),
            effects=tuple(_effect(f) for f in o.effects),
            suspects=tuple(o.suspects),
            parameters=fitted_values(o.parameters),
            misfit=_outputs(o.misfit),
            validation=_outputs(self.validation),
            remainder=LeftFound(o.rest.explained, share, o.rest.reasons, tuple(map(tuple, o.rest.blocks.tolist()))),
            where=tuple(o.where),
            warnings=(*self.notes[2:], *o.warnings, *self.harm),
            settings=as_tables(self.settings),
            candidates=tuple(self._candidates()),
            model=None if not self.delivered else str(place / self.delivered[0].path.name),
            delivery=tuple(d.found() for d in self.delivered),
            step_cost=o.probe.step_cost,
            walls=support().in_words,
            runs=o.runs,
            seconds=o.seconds,
        )

    def _candidates(self) -> Iterator[BoxStepFound]:
        search = self.outcome.search
        if search is None:
            return
        for step in search.steps:
            tried = tuple(
                BoxTriedFound(
                    fit.model.effects[-1].label,
                    search.score(fit) - search.score(step.before),
                    tuple(fit.model.values[-1].tolist()),
                    fit.decided - step.before.decided,
                    counted(fit.model),
                )
                for fit in step.tried
            )
            yield BoxStepFound(tuple(e.label for e in step.before.model.effects), step.accepted, tried)

    def write_files(self, folder: Path) -> None:
        """Write the held-out part, a figure and the corrected system."""
        from orchestrator.diagnosis.blackbox.figures import draw_signals

        write_signals(folder / "diagnose.csv", self.outcome)
        draw_signals(folder / "diagnose_signals.png", self.outcome)
        if self.outcome.verdict != "unknown":
            self.delivered[:] = [deliver(folder / "corrected.ssp", self.outcome)]

    def close(self) -> None:
        """End the child processes now; else they end with the result."""
        self.outcome.problem.runner.close()


def write_signals(path: Path, outcome: BoxOutcome) -> None:
    """Write measured and simulated outputs of all rows.

    Args:
        path: the CSV file.
        outcome: of the diagnosis.
    """
    problem = outcome.problem
    data = problem.data
    header = ["time", *problem.inputs]
    columns = [data.time, *data.inputs.T]
    for k, name in enumerate(problem.outputs):
        header += [name, f"{name}_nominal", f"{name}_refitted", f"{name}_corrected"]
        columns += [data.outputs[:, k], *(y[:, k] for y in outcome.stages)]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([f"{v:.9g}" for v in row] for row in np.column_stack(columns))


def of_a_box(
    record: Path | str,
    fmu: Path | str,
    map: Path | str,  # noqa: A002 - as on the command line
    *,
    validate: Path | str | None = None,
    settings: BoxSettings | Path | str | None = None,
    progress: Progress = lambda what: None,
) -> FmuDiagnosisResult:
    """Return what a record says of an FMU, and which effects are missing around it.

    Args:
        record: CSV file with the columns that the map names.
        fmu: any FMI 2.0 co-simulation FMU, or a scenario file of several; they run in a child process.
        map: TOML file: columns, uncertain parameters, ports.
        validate: a second record of the same columns, to show the misfit on; nothing is fitted to it.
        settings: thresholds, or the path of a TOML file of them.
        progress: called with what is being done.

    Returns:
        What is missing around the FMU, with how it was found.

    Raises:
        InputError: record, FMU, map or settings cannot be used.
        SimulationError: the FMU fails again and again.
    """
    used = chosen_settings(settings, BoxSettings)
    subject = subject_of(Path(fmu))
    given = read_map(Path(map), subject)
    data = read_data(Path(record), given, used.read)
    notes = data.notes
    factor = factor_of(data, used.rate)
    data = decimated(data, factor)
    second = None if validate is None else decimated(read_data(Path(validate), given, used.read), factor)
    outcome = diagnosing(subject, given, data, used, progress)
    try:
        models = (outcome.problem.nominal, outcome.refitted, outcome.model)
        shown = () if second is None else validated(outcome.problem, models, second)
    except BaseException:
        outcome.problem.runner.close()
        raise
    files = {"record": record, "fmu": fmu, "map": map, "validate": validate}
    arguments = {name: str(path) for name, path in files.items() if path is not None}
    result = FmuDiagnosisResult(outcome, arguments, validation=shown, settings=used, notes=notes)
    weakref.finalize(result, outcome.problem.runner.close)  # child processes end with the result, or at exit
    return result


def draft_map(record: Path | str, fmu: Path | str) -> str:
    """Return a first map from units, causality and names, as TOML.

    Args:
        record: path of the log.
        fmu: path of the FMU.

    Returns:
        The TOML text.

    Raises:
        InputError: record or FMU cannot be read.

    Example:
        >>> "[ports.port_1]" in oc.draft_map("axis.csv", "axis.fmu")
        True
    """
    return drafted(subject_of(Path(fmu)), columns_of(Path(record)))
