"""What ``diagnose.json`` and ``calibrate.json`` hold of any FMU; docs/any-fmu.md says what each word means."""

from typing import Annotated, Any, Literal

import msgspec

from orchestrator.shared.results import ResultData, TrustFound
from orchestrator.shared.results.diagnose import (
    AnyDiagnosisFound,
    DependenceFound,
    ParameterFound,
    TestFound,
    misfit_tables,
)
from orchestrator.shared.results.fields import Display, ReportTable, fields_table


class FmuRemainingFound(msgspec.Struct, frozen=True):
    """What no effect explains: the share of each output's power that is left, noise included, and what it follows."""

    outputs: dict[str, float | None] = {}
    follows: tuple[DependenceFound, ...] = ()


class PartFound(msgspec.Struct, frozen=True):
    """An FMU of the corrected system: its effect, or "connection", and its values."""

    name: str
    effect: str
    values: dict[str, float | int | bool] = {}

    def __str__(self) -> str:
        return self.effect


class DeliveredFound(msgspec.Struct, frozen=True):
    """A corrected system: its file, its parts, how far its run is from the fit, and why it could not be run."""

    file: Annotated[str, Display("file")]
    parts: Annotated[tuple[PartFound, ...], Display("effects")] = ()
    difference_over_noise: Annotated[float | None, Display("differs from the fit by", "noise")] = None
    note: Annotated[str, Display("note")] = ""


class FmuDiagnosisFound(AnyDiagnosisFound, frozen=True, kw_only=True):
    """``diagnose`` of any FMU: graded effects, misfit on test data, what was delivered, and how it was found.

    ``test_start``: from which time on the first record is test data [s].
    """

    schema_version: int = 3
    kind: Literal["fmu"] = "fmu"
    remaining: FmuRemainingFound = FmuRemainingFound()
    delivery: tuple[DeliveredFound, ...] = ()
    step_cost: float | None = None
    walls: str = ""
    runs: int | None = None
    test_start: float | None = None


class LearnedParameterFound(ParameterFound, frozen=True):
    """A calibrated parameter; ``learned`` is the share of its stated uncertainty that the records remove."""

    learned: Annotated[float | None, Display("learned", "%", 3, factor=100.0)] = None


class FmuCalibrationFound(ResultData, frozen=True, kw_only=True):
    """``calibrate``: parameters, what the records do not tell apart, and the misfit on test data."""

    schema_version: int = 3
    explained: bool
    trust: TrustFound | None = None
    parameters: dict[str, LearnedParameterFound] = msgspec.field(default_factory=dict)
    not_told_apart: tuple[tuple[str, str], ...] = ()
    test: tuple[TestFound, ...] = ()
    notes: tuple[str, ...] = ()
    settings: dict[str, Any] = msgspec.field(default_factory=dict)
    seconds: float | None = None
    walls: str = ""


def calibration_tables(results: FmuCalibrationFound) -> list[ReportTable]:
    """Return the tables of the parameters and of the misfit on each record's test data."""
    note = "Learned: how much of its stated uncertainty the record removes."
    parameters = fields_table("Parameters", results.parameters, note, "parameter", LearnedParameterFound)
    return [parameters, *misfit_tables(results.test)]
