"""What any FMU misses, from measured records."""

import time
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from orchestrator.api.diagnosis_results import AnyDiagnosisResult
from orchestrator.api.shown import Block
from orchestrator.diagnosis.fmu.corrected_ssp import write_corrected
from orchestrator.diagnosis.fmu.diagnose import diagnose_fmu as diagnose_records
from orchestrator.diagnosis.fmu.mapping import Map, read_map
from orchestrator.diagnosis.fmu.problem import FmuProblem
from orchestrator.diagnosis.fmu.record import FmuRecord, decimate, decimation_factor, read_fmu_record
from orchestrator.diagnosis.fmu.report import FmuDiagnosis, first_test, misfit_on_record, stage_runs
from orchestrator.diagnosis.fmu.system import draft_map_text, read_system
from orchestrator.diagnosis.report.json_results import (
    dependence_found,
    misfit_found,
    outcome_found,
    parameters_found,
)
from orchestrator.diagnosis.report.summary import summarise
from orchestrator.diagnosis.result import TestMisfit
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.records.tables import column_names
from orchestrator.shared.arrays import Array
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.results.any_fmu import DeliveredFound, FmuDiagnosisFound, FmuRemainingFound
from orchestrator.shared.results.fields import fields_table
from orchestrator.shared.settings import choose_settings

Progress = Callable[[str], None]


@dataclass(frozen=True, repr=False)
class FmuDiagnosisResult(AnyDiagnosisResult):
    """What records say of an FMU.

    Attributes:
        diagnosis: verdict, graded effects, parameters, misfits and what is left.
        validation: how the models do on another record, or None.
        seconds: wall time of the diagnosis [s].
        delivered: the corrected system, once it has been written.
    """

    replaces: ClassVar[tuple[str, ...]] = ("corrected.ssp", "diagnose.png")
    diagnosis: FmuDiagnosis
    validation: TestMisfit | None
    seconds: float
    delivered: list[DeliveredFound] = field(default_factory=list)

    def summary(self) -> Iterator[str]:
        yield from summarise(self.diagnosis)
        yield from self._closing_lines()

    def blocks(self) -> Sequence[Block]:
        """Return the summary, and the tables of parameters, candidates and misfits."""
        parameters = parameters_found(self.diagnosis)
        fitted = [fields_table("Parameters", parameters, names="parameter")] if parameters else []
        delivered = (
            f"Corrected system: {d.file}; differs from the fit by {d.difference_over_noise:.2g} of the noise"
            for d in self.delivered
        )
        return [*self.summary(), *fitted, *self._misfit_tables(), *delivered]

    def results(self, place: Path) -> FmuDiagnosisFound:
        d, problem = self.diagnosis, self.diagnosis.workings.problem
        return outcome_found(
            FmuDiagnosisFound,
            d,
            d.workings.search,
            validation=None if self.validation is None else misfit_found(self.validation, d.settings),
            remaining=FmuRemainingFound(dict(d.left), tuple(dependence_found(one) for one in d.remaining)),
            model=None if not self.delivered else str(place / self.delivered[0].file),
            delivery=tuple(self.delivered),
            step_cost=problem.runner.step_cost,
            walls=support().in_words,
            runs=problem.runner.runs,
            test_start=self._test_start(),
            seconds=self.seconds,
        )

    def _test_start(self) -> float | None:
        problem, row = first_test(self.diagnosis.workings)
        return float(problem.data.time[row]) if row < len(problem.data.time) else None

    def write_files(self, folder: Path) -> None:
        """Write measured and simulated outputs, and the corrected system."""
        super().write_files(folder)
        if self.verdict != "unknown" or self.diagnosis.workings.search.asked:
            workings = self.diagnosis.workings
            self.delivered[:] = [write_corrected(folder / "corrected.ssp", workings.problem, workings.final)]

    def signals(self) -> Mapping[str, Array]:
        """Return the test part: inputs and outputs, measured and simulated: ``NAME_STAGE`` by that stage's model."""
        problem, stages, _ = self._stage_runs
        columns = {"time": problem.data.time} | dict(zip(problem.inputs, problem.data.inputs.T, strict=True))
        for k, name in enumerate(problem.outputs):
            columns[name] = problem.data.outputs[:, k]
            columns |= {f"{name}_{stage}": values[:, k] for stage, values in stages.items()}
        return columns

    @cached_property
    def _stage_runs(self) -> tuple[FmuProblem, dict[str, Array], int]:
        return stage_runs(self.diagnosis.workings)

    def close(self) -> None:
        """End the child processes now; else they end with the result."""
        self.diagnosis.workings.close()


def read_records(records: Sequence[Path | str], given: Map, settings: DiagnosisSettings) -> list[FmuRecord]:
    """Return the columns of records that a map names, at the rate that the first one asks for."""
    read = [read_fmu_record(Path(path), given, settings.fmu.uneven) for path in records]
    factor = decimation_factor(read[0], settings.fmu)
    return [decimate(record, factor) for record in read]


def diagnose_fmu(
    records: Sequence[Path | str],
    fmu: Path | str,
    map: Path | str,  # noqa: A002 - as on the command line
    *,
    validate: Path | str | None = None,
    test: Path | str | None = None,
    settings: DiagnosisSettings | Path | str | None = None,
    progress: Progress = lambda what: None,
    **search: Any,
) -> FmuDiagnosisResult:
    """Return what records say of an FMU, and which effects are missing around it; see ``diagnose``."""
    begun = time.monotonic()
    used = choose_settings(settings, DiagnosisSettings)
    system = read_system(Path(fmu))
    given = read_map(Path(map), system)
    others = [path for path in (validate, test) if path is not None]
    read = read_records([*records, *others], given, used)
    further = dict(zip([name for name, path in (("validate", validate), ("test", test)) if path is not None],
                       read[len(records) :], strict=True))  # fmt: skip
    found = diagnose_records(
        system, given, read[: len(records)], used, test=further.get("test"), progress=progress, **search
    )
    try:
        second = misfit_on_record(found.workings, further["validate"]) if "validate" in further else None
    except BaseException:
        found.workings.close()
        raise
    files = {"record": records[0], "fmu": fmu, "map": map, "validate": validate, "test": test}
    arguments = {name: str(path) for name, path in files.items() if path is not None}
    result = FmuDiagnosisResult(found, second, time.monotonic() - begun, arguments=arguments)
    weakref.finalize(result, found.workings.close)  # child processes end with the result, or at exit
    return result


def draft_map(record: Path | str, fmu: Path | str) -> str:
    """Return a first map from units, causality and names, as TOML.

    Args:
        record: path of the log.
        fmu: path of the FMU.

    Returns:
        Text of the map in TOML, to be completed where it says so.

    Raises:
        InputError: record or FMU cannot be read.

    Examples:
        >>> "[ports.port_1]" in oc.draft_map("axis.csv", "axis.fmu")
        True
    """
    return draft_map_text(read_system(Path(fmu)), column_names(Path(record)))
