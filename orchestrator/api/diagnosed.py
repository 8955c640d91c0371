"""A diagnosis as it is shown, drawn, written and built."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import msgspec

from orchestrator.api.diagnosis_results import AnyDiagnosisResult
from orchestrator.api.numerics import numeric_errors
from orchestrator.api.shown import Block, doubts_of
from orchestrator.diagnosis.report.corrected import (
    BeforeAfter,
    before_and_after,
    build_corrected,
    fitted_record_of,
    fmu_name,
    format_corrected_model,
    start_values,
)
from orchestrator.diagnosis.report.json_results import diagnosis_found, misfit_found
from orchestrator.diagnosis.report.summary import half_gap_of, play_of, summarise
from orchestrator.diagnosis.result import Diagnosis, TestMisfit
from orchestrator.errors import OutputError
from orchestrator.estimation.protocol import Estimate
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.play import Play
from orchestrator.shared.results import LiveFound
from orchestrator.shared.results.diagnose import DiagnoseFound, DifferenceFound
from orchestrator.shared.scratch import Scratch
from orchestrator.shared.trust import Level


@dataclass(frozen=True, repr=False)
class DiagnosisResult(AnyDiagnosisResult):
    """What records say of a model.

    Attributes:
        diagnosis: graded effects, parameters, misfits and how they were found.
        record: the first measured record.
        validation: how the models do on another record, or None.
        seconds: wall time of the diagnosis [s].
        more: further records of the same machine, fitted together with the first.
    """

    replaces: ClassVar[tuple[str, ...]] = ("diagnose.png",)
    diagnosis: Diagnosis
    record: Record
    validation: TestMisfit | None
    seconds: float
    more: tuple[Record, ...] = ()

    def build(self, out: Path | str) -> Path:
        """Build the corrected plant as an FMU, and check it.

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
        with numeric_errors(f"{self.record.source}: the corrected model cannot be built"):
            return build_corrected(self.diagnosis, self.record.source, folder)

    @cached_property
    def runs(self) -> BeforeAfter:
        """The test part, measured and co-simulated with the nominal and the corrected FMU."""
        with Scratch("diagnose") as scratch:
            return self._co_simulated(self.build(scratch.path))

    def _co_simulated(self, fmu: Path) -> BeforeAfter:
        with numeric_errors(f"{self.record.source}: the corrected FMU cannot be run"):
            return before_and_after(self.diagnosis, fmu)

    def signals(self) -> Mapping[str, Array]:
        """Return the test part: request [N.m], and each angle, measured and simulated.

        ``NAME_before`` is of the nominal FMU, ``NAME_after`` of the corrected one.
        """
        runs = self.runs
        names: Sequence[str] = ("theta_m", "theta_l")[: runs.measured.shape[1]]
        shown = {"": runs.measured, "_before": runs.before, "_after": runs.after}
        columns = {"time": runs.time, "u": runs.u}
        return columns | {f"{name}{k}": values[:, n] for n, name in enumerate(names) for k, values in shown.items()}

    def summary(self) -> Iterator[str]:
        d = self.diagnosis
        yield from summarise(d)
        if d.law is not None:
            yield f"Learned law: of what is left at the {d.law.site}, {d.law.words}"
        yield from self._closing_lines()

    def blocks(self) -> Sequence[Block]:
        return [*doubts_of((self.record, *self.more)), *self.summary(), *self._misfit_tables()]

    def results(self, place: Path) -> DiagnoseFound:
        """Return what ``diagnose.json`` says; the corrected FMU is in ``place``."""
        found = diagnosis_found(self.diagnosis)
        return msgspec.structs.replace(
            found,
            notes=(*doubts_of((self.record, *self.more)), *found.notes),
            model=str(place / self.fmu_name),
            cosimulation=DifferenceFound(self.runs.difference, "rad"),
            validation=None if self.validation is None else misfit_found(self.validation, self.diagnosis.settings),
            live=self._live_model(),
            angle_unit=self.record.angle_unit,
            seconds=self.seconds,
        )

    def _live_model(self) -> LiveFound:
        """Return the corrected model and the starts of its runs over the test part."""
        workings, plant = self.diagnosis.workings, self.diagnosis.model.plant
        values, runs = start_values(plant, workings.final), self.runs
        return LiveFound(plant.name, workings.records[0].step, values, list(runs.rows), list(runs.starts))

    @property
    def gap(self) -> Estimate | None:
        """The half-gap [rad] of the corrected model, where a gap is named among what the model misses."""
        gap = half_gap_of(self.diagnosis)
        return None if gap is None else Estimate("diagnosis", gap.value, gap.standard_error, gap.interval)

    @property
    def play(self) -> Play | None:
        """The same as total play, at the load and at the motor."""
        return play_of(self.diagnosis)

    @property
    def fmu_name(self) -> str:
        """File name of the corrected FMU."""
        return f"{fmu_name(self.diagnosis.model.plant.name, self.record.source)}.fmu"

    def write_files(self, folder: Path) -> None:
        """Write the corrected FMU, its model file ``corrected.toml`` and ``diagnose.csv``."""
        fmu = self.build(folder)
        if "runs" not in self.__dict__:  # else it would be built again
            self.__dict__["runs"] = self._co_simulated(fmu)
        super().write_files(folder)

    def write_data(self, folder: Path) -> None:
        """Write ``diagnose.csv`` and ``corrected.toml``."""
        super().write_data(folder)
        (folder / "corrected.toml").write_text(
            format_corrected_model(self.diagnosis.model, self.diagnosis, fitted_record_of(self.diagnosis)),
            encoding="utf-8",
        )

    @property
    def can_compensate(self) -> bool:
        """Whether `compensate` takes the corrected model."""
        d = self.diagnosis
        plant = d.model.plant
        gap = plant.name == "Drivetrain" and plant.value(d.workings.final, "alpha") > 0.0
        known = d.verdict != "unknown" and d.trust.level is not Level.RED
        return gap and known and self.record.theta_l is not None
