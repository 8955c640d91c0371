"""A diagnosis as it is shown, drawn, written and built."""

import csv
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar

import msgspec
from msgspec import UNSET

from orchestrator.api.law import law_found, law_told
from orchestrator.api.live import corrected_live
from orchestrator.api.numerics import fitting
from orchestrator.api.remains import also_seen, described_term, of_each_record
from orchestrator.api.shown import Block, Result, table
from orchestrator.diagnosis.outcome import Diagnosis, Misfit, Named, step_found
from orchestrator.diagnosis.proof.corrected import BeforeAfter, before_and_after, build_corrected, fmu_name
from orchestrator.diagnosis.proof.exported import LawRun, build_with_law, run_with_law
from orchestrator.diagnosis.proof.model_text import corrected_model
from orchestrator.diagnosis.proof.other_record import STAGES, Validation
from orchestrator.diagnosis.verdict.evidence import Evidence
from orchestrator.diagnosis.verdict.told import told
from orchestrator.errors import OutputError
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.cores import both
from orchestrator.shared.results.diagnose import DiagnoseFound, DifferenceFound, ValidatedFound
from orchestrator.shared.trust import Trust

SHOWN = 5


@dataclass(frozen=True, repr=False)
class DiagnosisResult(Result):
    """What a record says of a model.

    Attributes:
        diagnosis: verdict, effects, parameters, misfit and how they were found.
        record: the measured record.
        validation: how the models do on another record, or None.
        torque_error: relative torque error of each inverse model on the record; empty for plants without one.
        evidence: what the final model leaves at the motor, and what it follows.
        seconds: wall time of the diagnosis [s].
        arguments: what was asked for.
        model: what it was compared with.
        more: further records of the same machine, fitted together with the first.
        with_law: the corrected FMU has the learned law, off until ``effects.learned_law.on`` is 1.
    """

    command: ClassVar[str] = "diagnose"
    diagnosis: Diagnosis
    record: Record
    validation: Validation | None
    torque_error: Mapping[str, float]
    evidence: Evidence
    seconds: float
    arguments: Mapping[str, Any] = field(default_factory=dict)
    model: Model | None = None
    more: tuple[Record, ...] = ()
    with_law: bool = False

    @property
    def verdict(self) -> str:
        """One of "none", "parameters", "effects" and "unknown"."""
        return self.diagnosis.verdict

    @property
    def effects(self) -> tuple[Named, ...]:
        """The effects that the model misses: name, site and parameters, each with its interval and unit."""
        return self.diagnosis.effects

    @property
    def misfit(self) -> tuple[Misfit, ...]:
        """Rms of simulated minus measured on held-out data [rad], by signal, before and after."""
        return self.diagnosis.misfit

    @property
    def trust(self) -> Trust:
        """How far the corrected model can be trusted."""
        return self.diagnosis.trust

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to bear in mind, a sentence each."""
        return self.diagnosis.warnings

    def build(self, out: Path | str) -> Path:
        """Build the corrected plant as an FMU, with the learned law where that was asked for, and check it.

        Args:
            out: the folder; made when it does not exist.

        Returns:
            The path of the FMU.

        Raises:
            OutputError: the folder cannot be made.
            FmuError: the FMU cannot be built.
            SimulationError: the check found an error in it.
        """
        folder = Path(out)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"`out` must be a folder, but {folder} is not: {error.strerror}", "out") from None
        with fitting(f"{self.record.source}: the corrected model cannot be built"):
            if self.with_law and self.diagnosis.learned is not None:
                return build_with_law(self.diagnosis, self.diagnosis.learned, self.record.source, folder)
            return build_corrected(self.diagnosis, self.record.source, folder)

    @property
    def runs(self) -> BeforeAfter:
        """The held-out part, measured and co-simulated with the nominal and the corrected FMU, a law being off."""
        return self._simulated[0]

    @property
    def law_run(self) -> LawRun | None:
        """The held-out part, simulated by the corrected FMU with its learned law on; None: it has none."""
        return self._simulated[1]

    @cached_property
    def _simulated(self) -> tuple[BeforeAfter, LawRun | None]:
        with tempfile.TemporaryDirectory(prefix="diagnose-") as folder:
            return self._co_simulated(self.build(folder))

    def _co_simulated(self, fmu: Path) -> tuple[BeforeAfter, LawRun | None]:
        law = self.diagnosis.learned if self.with_law else None
        with fitting(f"{self.record.source}: no model can be fitted to this record"):
            with_law = None if law is None else run_with_law(self.diagnosis, law, fmu)
            return before_and_after(self.diagnosis, fmu), with_law

    def plot(self, path: Path | str) -> None:
        """Draw the held-out part: measured, of the nominal model and of the corrected one.

        Args:
            path: a PNG, SVG or PDF file.
        """
        from orchestrator.diagnosis.figures import draw_signals

        draw_signals(Path(path), self.runs, self.diagnosis)

    def write_csv(self, path: Path | str) -> None:
        """Write what ``plot`` draws as CSV.

        Args:
            path: the file.

        Raises:
            OutputError: it cannot be written.
        """
        runs = self.runs
        names: Sequence[str] = ("theta_m", "theta_l")[: runs.measured.shape[1]]
        shown = {"": runs.measured, "_before": runs.before, "_after": runs.after}
        if self.law_run is not None:
            shown["_with_law"] = self.law_run.outputs
        header = ["time", "u"] + [f"{name}{suffix}" for name in names for suffix in shown]
        columns = [runs.time, runs.u]
        for n in range(len(names)):
            columns += [values[:, n] for values in shown.values()]
        try:
            with Path(path).open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(header)
                writer.writerows([f"{value:.9g}" for value in row] for row in zip(*columns, strict=True))
        except OSError as error:
            raise OutputError(f"cannot write {path}: {error.strerror}") from None

    def summary(self) -> Iterator[str]:
        """Yield what was found, one sentence a line.

        Yields:
            What is missing, how sure, what it does, what is left and open; where the misfit is, and the warnings.
        """
        d = self.diagnosis
        yield from told(d)
        if d.where and d.verdict not in ("none", "parameters"):
            yield "Where:"
            for place in d.where[:SHOWN]:
                yield f"  {place.words}"
        if d.learned:
            yield f"Learned law: {d.learned.words}"
        if self.with_law:
            yield law_told(self.diagnosis, self.law_run if "_simulated" in self.__dict__ else None)
        for warning in d.warnings:
            yield f"Note: {warning}"
        yield f"Trust: {self.trust.level.word}"
        yield from (f"  {reason}" for reason in self.trust.reasons if reason not in d.warnings)

    def blocks(self) -> Sequence[Block]:
        """Return the summary, and the tables of candidates, misfit and what else was seen."""
        return [*self.summary(), *_tables(self)]

    def results(self, place: Path) -> DiagnoseFound:
        """Return what ``diagnose.json`` says; the corrected FMU is in ``place``."""
        found = self.diagnosis.found()
        return msgspec.structs.replace(
            found,
            learned_law=law_found(found.learned_law, self.law_run, self.misfit[0].unit),
            model=str(place / self.fmu_name),
            cosimulation=DifferenceFound(self.runs.difference, "rad"),
            validation=UNSET if self.validation is None else _signals(self.validation),
            torque_error=_torque_errors(self) or UNSET,
            also_seen=tuple(described_term(term, self.diagnosis) for term in self.evidence.terms),
            live=corrected_live(self.diagnosis, self.runs),
            told=tuple(told(self.diagnosis)),
            seconds=self.seconds,
        )

    @property
    def fmu_name(self) -> str:
        """File name of the corrected FMU."""
        return f"{fmu_name(self.diagnosis.workings.plant.name, self.record.source)}.fmu"

    def write_files(self, folder: Path) -> None:
        """Write the corrected FMU, its model file ``corrected.toml``, ``diagnose.csv`` and the figures."""
        from orchestrator.diagnosis.figures import draw_workings

        draw = partial(draw_workings, folder, self.diagnosis, self.evidence, self.misfit[0].unit)
        _, fmu = both(draw, partial(self.build, folder))
        if "_simulated" not in self.__dict__:  # else it would be built again
            self.__dict__["_simulated"] = self._co_simulated(fmu)
        self.write_csv(folder / "diagnose.csv")
        if self.model is not None:
            (folder / "corrected.toml").write_text(corrected_model(self.model, self.diagnosis), encoding="utf-8")
        self.plot(folder / "diagnose_signals.png")


def _signals(found: Validation) -> dict[str, ValidatedFound]:
    return {
        one.signal: ValidatedFound(
            one.before,
            one.after,
            one.noise,
            one.unit,
            {name: values[n] for name, values in found.r_squared.items()},
            found.moved_zero if n == 0 else 0.0,
        )
        for n, one in enumerate(found.misfit)
    }


def _torque_errors(found: DiagnosisResult) -> dict[str, dict[str, float]]:
    """Return the inverse models' relative torque errors by record; empty for plants without one."""
    by_record = {"record": found.torque_error, "validation": found.validation and found.validation.torque_error}
    return {name: dict(errors) for name, errors in by_record.items() if errors}


def _tables(found: DiagnosisResult) -> Iterator[Block]:
    diagnosis, unit = found.diagnosis, found.misfit[0].unit
    rows = [
        [
            ", ".join(step.on_top_of) or "parameters",
            tried.effect,
            f"{tried.gain:.1f}",
            f"{tried.decided:.1f}",
            "added" if step.accepted and n == 0 else "",
        ]
        for step in map(step_found, diagnosis.workings.steps)
        for n, tried in enumerate(step.tried[:SHOWN])
    ]
    if rows:
        yield table("Candidates", ("on top of", "effect", "gain", "of it on deciding part", ""), rows)
    rows = [[m.signal, name, f"{rms:.4g}", f"{rms / m.noise:.2f}"] for m in found.misfit for name, rms in m.stages]
    yield table("Misfit on held-out data", ("signal", "model", f"rms [{unit}]", "times noise"), rows)
    yield from of_each_record(diagnosis)
    yield from also_seen([described_term(term, diagnosis) for term in found.evidence.terms])
    if found.validation is not None:
        misfits, fits = found.validation.misfit, found.validation.r_squared
        rows = [[m.signal, f"{m.before:.4g}", f"{m.after:.4g}", f"{m.noise:.4g}"] for m in misfits]
        head = ("signal", *(f"{name} [{unit}]" for name in ("before", "after", "noise")))
        yield table("Misfit on the other record", head, rows)
        rows = [[m.signal, *(f"{fits[stage][n]:.4f}" for stage in STAGES)] for n, m in enumerate(misfits)]
        yield table("R2 of one free run over all of the other record", ("signal", *STAGES), rows)
        if found.validation.moved_zero != 0.0:
            yield f"The other record counts from another zero, which lies {found.validation.moved_zero:.4g} {unit} off."
    errors = _torque_errors(found)
    if errors:
        rows = [[name, *(f"{100.0 * of[stage]:.2f} %" for stage in STAGES)] for name, of in errors.items()]
        yield table("Relative torque error of the inverse model", ("on", *STAGES), rows)
