"""The parameters of any FMU, from a measured record."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from orchestrator.api.any_fmu import Progress, read_records
from orchestrator.api.shown import Block, Result
from orchestrator.diagnosis.fmu.diagnose import FmuCalibration, calibrate_fmu
from orchestrator.diagnosis.fmu.mapping import read_map
from orchestrator.diagnosis.fmu.system import read_system
from orchestrator.diagnosis.report.json_results import misfit_found, parameters_found
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.errors import ScenarioError
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.results.any_fmu import FmuCalibrationFound, LearnedParameterFound, calibration_tables
from orchestrator.shared.settings import as_tables, choose_settings
from orchestrator.shared.trust import Level, Reason, Trust, trust_of

MISSING = "no values of these parameters within their limits explain the record: the estimates are biased"


@dataclass(frozen=True, repr=False)
class CalibrationResult(Result):
    """Parameters of an FMU from a record.

    Attributes:
        calibration: values, intervals, what the record does not determine, misfit.
        seconds: wall time [s].
    """

    command: ClassVar[str] = "calibrate"
    calibration: FmuCalibration
    seconds: float

    @property
    def trust(self) -> Trust:
        """How far the result can be trusted."""
        trust = self.calibration.diagnosis.trust
        if self.calibration.explained:
            return trust
        return trust_of([Reason(Level.RED, MISSING), *(Reason(trust.level, text) for text in trust.reasons)])

    def blocks(self) -> Sequence[Block]:
        c = self.calibration
        parameters, *misfits = calibration_tables(self.results(Path()))
        lines: list[Block] = [f"Parameters {'explain' if c.explained else 'do not explain'} the record to its noise"]
        lines.append(parameters)
        lines += [f"Note: {text}" for text in c.notes]
        trust = self.trust
        lines.append(f"Trust: {trust.level.word}")
        lines += [f"  {reason}" for reason in trust.reasons]
        lines += misfits
        return lines

    def results(self, place: Path) -> FmuCalibrationFound:
        del place
        c, d = self.calibration, self.calibration.diagnosis
        parameters = {
            name: LearnedParameterFound(p.nominal, p.value, p.standard_error, p.interval, p.unit, c.learned[name])
            for name, p in parameters_found(d).items()
        }
        return FmuCalibrationFound(
            explained=c.explained,
            trust=self.trust.to_result(),
            parameters=parameters,
            not_told_apart=c.confounded,
            test=tuple(misfit_found(test, d.settings) for test in d.test),
            notes=c.notes,
            settings=as_tables(d.settings),
            seconds=self.seconds,
            walls=support().in_words,
        )


def calibrate(
    record: Path | str | Sequence[Path | str],
    fmu: Path | str,
    map: Path | str,  # noqa: A002 - as on the command line
    *,
    settings: DiagnosisSettings | Path | str | None = None,
    progress: Progress = lambda what: None,
) -> CalibrationResult:
    """Return the parameters of an FMU that explain a record, with intervals.

    Args:
        record: path of the log, or several of one machine.
        fmu: path of the FMU, or of a scenario of several.
        map: path of the map.
        settings: thresholds, or the path of a TOML file of them.
        progress: called with what is done.

    Returns:
        The parameters with their intervals.

    Raises:
        InputError: record, FMU, map or settings cannot be used.
        SimulationError: the FMU fails again and again.

    Examples:
        >>> fit = oc.calibrate("axis.csv", "axis.fmu", "axis_map.toml")
        >>> [*fit.calibration.diagnosis.parameters], fit.trust.level.word
        (['J', 'b'], 'red')
    """
    begun = time.monotonic()
    used = choose_settings(settings, DiagnosisSettings)
    system = read_system(Path(fmu))
    if not isinstance(map, (Path, str)):
        raise ScenarioError("`map` must be the path of a TOML file, but is not", "map")
    given = read_map(Path(map), system)
    paths = [record] if isinstance(record, (Path, str)) else list(record)
    read = read_records(paths, given, used)
    found = calibrate_fmu(system, given, read, used, progress)
    found.diagnosis.workings.close()
    arguments = {"record": str(paths[0]), "fmu": str(fmu), "map": str(map)}
    return CalibrationResult(found, time.monotonic() - begun, arguments=arguments)
