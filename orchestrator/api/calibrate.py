"""The parameters of any FMU, from a measured record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from orchestrator.api.any_fmu import Progress, fitted_values
from orchestrator.api.arguments import chosen_settings
from orchestrator.api.shown import Block, Result, table
from orchestrator.diagnosis.blackbox.calibrate import BoxCalibration
from orchestrator.diagnosis.blackbox.calibrate import calibrate as calibrating
from orchestrator.diagnosis.blackbox.mapping import read_map
from orchestrator.diagnosis.blackbox.rate import decimated, factor_of
from orchestrator.diagnosis.blackbox.reading import read_data
from orchestrator.diagnosis.blackbox.settings import DEFAULT, BoxSettings
from orchestrator.diagnosis.blackbox.subject import subject_of
from orchestrator.diagnosis.blackbox.trust import calibration_doubts
from orchestrator.errors import ScenarioError
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.results.any_fmu import BoxCalibrationFound, CalibratedOutputFound, LearnedParameterFound
from orchestrator.shared.settings import as_tables
from orchestrator.shared.trust import Trust


@dataclass(frozen=True, repr=False)
class CalibrationResult(Result):
    """Parameters of an FMU from a record.

    Attributes:
        calibration: values, intervals, what the record does not determine, misfit.
        arguments: what was asked for.
        settings: thresholds that were used.
        notes: what was detected and filled when the record was read.
    """

    command: ClassVar[str] = "calibrate"
    calibration: BoxCalibration
    arguments: Mapping[str, Any] = field(default_factory=dict)
    settings: BoxSettings = DEFAULT
    notes: tuple[str, ...] = ()

    @property
    def trust(self) -> Trust:
        """How far the result can be trusted."""
        return calibration_doubts(self.calibration, self.settings.rest)

    def blocks(self) -> Sequence[Block]:
        """Return parameters and misfit."""
        c = self.calibration
        rows = [
            (e.name, f"{e.nominal:.6g}", f"{e.value:.6g}", f"{e.interval[0]:.6g} to {e.interval[1]:.6g}",
             f"{100.0 * c.learned[e.name]:.0f} %", e.unit)
            for e in c.parameters
        ]  # fmt: skip
        head = ("name", "nominal", "value", "95 % interval", "learned", "unit")
        lines: list[Block] = [f"Record: {'; '.join(self.notes)}"] * bool(self.notes)
        lines.append(f"Parameters {'explain' if c.explained else 'do not explain'} the record to its noise")
        lines.append(table("Parameters", head, rows))
        lines += [f"Note: {text}" for text in c.warnings]
        trust = self.trust
        lines.append(f"Trust: {trust.level.word}")
        lines += [f"  {reason}" for reason in trust.reasons]
        found = [(m.output, f"{m.nominal:.3f}", f"{m.refitted:.3f}", f"{m.noise:.3g} {m.unit}") for m in c.misfit]
        lines.append(table("Misfit over noise, held-out quarter", ("output", "nominal", "calibrated", "noise"), found))
        return lines

    def results(self, place: Path) -> BoxCalibrationFound:
        """Return what goes into ``calibrate.json``."""
        del place
        c = self.calibration
        parameters = {
            name: LearnedParameterFound(p.nominal, p.value, p.standard_error, p.interval, p.unit, c.learned[name])
            for name, p in fitted_values(c.parameters).items()
        }
        return BoxCalibrationFound(
            explained=c.explained,
            trust=self.trust.found(),
            parameters=parameters,
            not_told_apart=c.confounded,
            misfit={m.output: CalibratedOutputFound(m.nominal, m.refitted, m.noise, m.unit) for m in c.misfit},
            warnings=(*self.notes[2:], *c.warnings),
            settings=as_tables(self.settings),
            seconds=c.seconds,
            walls=support().in_words,
        )


def calibrate(
    record: Path | str,
    fmu: Path | str,
    map: Path | str,  # noqa: A002 - as on the command line
    *,
    settings: BoxSettings | Path | str | None = None,
    progress: Progress = lambda what: None,
) -> CalibrationResult:
    """Return the parameters of an FMU that explain a record, with intervals.

    Args:
        record: path of the log.
        fmu: path of the FMU, or of a scenario of several.
        map: path of the map.
        settings: thresholds, or the path of a TOML file of them.
        progress: called with what is done.

    Returns:
        The parameters with their intervals.

    Raises:
        InputError: record, FMU, map or settings cannot be used.
        SimulationError: the FMU fails again and again.

    Example:
        >>> fit = oc.calibrate("axis.csv", "axis.fmu", "axis_map.toml")
        >>> [p.name for p in fit.calibration.parameters], fit.trust.level.word
        (['J', 'b'], 'red')
    """
    used = chosen_settings(settings, BoxSettings)
    subject = subject_of(Path(fmu))
    if not isinstance(map, (Path, str)):
        raise ScenarioError("`map` must be the path of a TOML file, but is not", "map")
    given = read_map(Path(map), subject)
    data = read_data(Path(record), given, used.read)
    found = calibrating(subject, given, decimated(data, factor_of(data, used.rate)), progress, used)
    return CalibrationResult(found, {"record": str(record), "fmu": str(fmu), "map": str(map)}, used, data.notes)
