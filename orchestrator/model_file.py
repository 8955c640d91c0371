"""The model that a record is compared with: which FMU, its parameter values, and how far each may be off.

A model file is TOML::

    fmu = "Drivetrain"

    [parameters.J_l]
    value = 5.6
    relative_uncertainty = 0.05     # off by at most 5 % (or: uncertainty = 0.28, in the parameter's unit)

    [encoders.theta_m]
    resolution = 6.2832e-4          # one count [rad]; 0: not rounded; absent: found from the record
    noise = 3e-4                    # standard deviation before rounding [rad]; absent: estimated

    [columns.theta_m]
    name = "qm"                     # what the record calls the column
    unit = "deg"                    # s, ms, rad, deg, rev, m, mm, N, N.m

A parameter that is not named keeps the FMU's default, without uncertainty when the file names any uncertainty
at all. Without a file, the model is ``Drivetrain`` with the thesis's values, no backlash, and each linear
parameter known to 5 %.
"""

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from orchestrator.errors import ScenarioError
from orchestrator.record import COLUMNS, UNIT_FACTORS, Column

LINEAR = ("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau")
DEFAULT_SPREAD = 0.05
TABLES = {"Drivetrain": "pyfmu_sources.drivetrain_parameters", "ServoAxis": "pyfmu_sources.servo_axis"}


@dataclass(frozen=True)
class ModelParameter:
    """One parameter: its value, the largest error that the user grants it, and its unit.

    ``uncertainty`` is half the width of an interval, all of whose points count as equally likely; 0.0: exact.
    """

    name: str
    value: float
    uncertainty: float
    unit: str
    minimum: float
    maximum: float

    @property
    def standard_deviation(self) -> float:
        """Return the standard deviation of the uniform distribution on the interval."""
        return self.uncertainty / math.sqrt(3.0)


@dataclass(frozen=True)
class Encoder:
    """What is known of an encoder [unit of its column]; None: to be found from the record."""

    resolution: float | None = None
    noise: float | None = None


@dataclass(frozen=True)
class Model:
    """A model: the FMU's name and all its parameters in the order of its table.

    Attributes:
        fmu: name of the FMU, as in ``fmus/``.
        parameters: every parameter of the FMU's table, by name.
        encoders: what is known of the encoders, by column.
        columns: name and unit of each column in the record's file, where they differ from the default.
        source: file name, for messages.
    """

    fmu: str
    parameters: Mapping[str, ModelParameter]
    encoders: Mapping[str, Encoder] = field(default_factory=dict)
    columns: Mapping[str, Column] = field(default_factory=dict)
    source: str = "default model"

    @property
    def values(self) -> tuple[float, ...]:
        """Return the flat parameter tuple ``p``."""
        return tuple(parameter.value for parameter in self.parameters.values())

    @property
    def uncertain(self) -> tuple[ModelParameter, ...]:
        """Return the parameters that may be off, in table order."""
        return tuple(p for p in self.parameters.values() if p.uncertainty > 0.0)

    def encoder(self, column: str) -> Encoder:
        """Return what is known of the encoder of ``column``."""
        return self.encoders.get(column, Encoder())


class _Parameter(msgspec.Struct, forbid_unknown_fields=True):
    value: float | None = None
    relative_uncertainty: float | None = None
    uncertainty: float | None = None


class _Encoder(msgspec.Struct, forbid_unknown_fields=True):
    resolution: float | None = None
    counts_per_rev: float | None = None
    noise: float | None = None


class _Column(msgspec.Struct, forbid_unknown_fields=True):
    name: str | None = None
    unit: str = ""


class _File(msgspec.Struct, forbid_unknown_fields=True):
    fmu: str = "Drivetrain"
    parameters: dict[str, _Parameter] = {}
    encoders: dict[str, _Encoder] = {}
    columns: dict[str, _Column] = {}


def default_model() -> Model:
    """Return ``Drivetrain`` with the thesis's values, no backlash, each linear parameter known to 5 %."""
    return Model("Drivetrain", _table("Drivetrain", DEFAULT_SPREAD, "default model"))


def read_model(path: Path | None) -> Model:
    """Return the model of a TOML file, or the default model for None.

    Raises:
        ScenarioError: the file is missing, not TOML, or names what does not exist; the message says where.
    """
    if path is None:
        return default_model()
    try:
        raw = msgspec.toml.decode(path.read_bytes(), type=_File)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: must be UTF-8 text, but byte {error.start} is not") from None
    except msgspec.ValidationError as error:
        raise ScenarioError(f"{path}: {error}") from None
    except msgspec.DecodeError as error:
        raise ScenarioError(f"{path}: must be TOML, but is not: {error}") from None
    except ValueError as error:
        raise ScenarioError(f"{path}: must be a readable TOML file: {error}") from None
    where = str(path)
    stated = any(_is_stated(entry) for entry in raw.parameters.values())
    table = _table(raw.fmu, 0.0 if stated else DEFAULT_SPREAD, where)
    for name, entry in raw.parameters.items():
        if name not in table:
            raise ScenarioError(f"{where}: $.parameters.{name} must be a parameter of {raw.fmu}{_nearest(name, table)}")
        table[name] = _merge(table[name], entry, f"{where}: $.parameters.{name}")
    encoders = {name: _encoder(name, entry, where) for name, entry in raw.encoders.items()}
    columns = {name: _column(name, entry, where) for name, entry in raw.columns.items()}
    return Model(raw.fmu, table, encoders, columns, path.name)


def _is_stated(entry: _Parameter) -> bool:
    return entry.relative_uncertainty is not None or entry.uncertainty is not None


def _table(fmu: str, spread: float, where: str) -> dict[str, ModelParameter]:
    """Return the FMU's parameters; linear ones get the relative ``spread``."""
    if fmu not in TABLES:
        raise ScenarioError(f"{where}: $.fmu must be one of {', '.join(TABLES)}, but is {fmu!r}")
    module = importlib.import_module(TABLES[fmu])
    relative = dict.fromkeys(LINEAR, spread) if fmu == "Drivetrain" else {}
    return {
        p.name: ModelParameter(
            p.name, p.default, relative.get(p.name, 0.0) * abs(p.default), p.unit, p.minimum, p.maximum
        )
        for p in module.PARAMETERS
    }


def _merge(parameter: ModelParameter, entry: _Parameter, where: str) -> ModelParameter:
    value = parameter.value if entry.value is None else entry.value
    if not math.isfinite(value) or not parameter.minimum <= value <= parameter.maximum:
        bounds = f"[{parameter.minimum:g}, {parameter.maximum:g}] {parameter.unit}"
        raise ScenarioError(f"{where}.value must be in {bounds}, but is {value:g}")
    if entry.uncertainty is not None and entry.relative_uncertainty is not None:
        raise ScenarioError(f"{where} must have `uncertainty` or `relative_uncertainty`, but has both")
    share = parameter.uncertainty / abs(parameter.value) if parameter.value != 0.0 else 0.0
    uncertainty = share * abs(value)
    if entry.uncertainty is not None:
        uncertainty = _positive(entry.uncertainty, f"{where}.uncertainty")
    elif entry.relative_uncertainty is not None:
        uncertainty = _positive(entry.relative_uncertainty, f"{where}.relative_uncertainty") * abs(value)
    return ModelParameter(parameter.name, value, uncertainty, parameter.unit, parameter.minimum, parameter.maximum)


def _positive(value: float, where: str) -> float:
    if not (math.isfinite(value) and value >= 0.0):
        raise ScenarioError(f"{where} must be a finite number that is not negative, but is {value:g}")
    return value


def _encoder(name: str, entry: _Encoder, where: str) -> Encoder:
    path = f"{where}: $.encoders.{name}"
    if name not in ("theta_m", "theta_l"):
        raise ScenarioError(f"{path} must be `theta_m` or `theta_l`")
    if entry.resolution is not None and entry.counts_per_rev is not None:
        raise ScenarioError(f"{path} must have `resolution` or `counts_per_rev`, but has both")
    resolution = entry.resolution
    if resolution is not None:
        _positive(resolution, f"{path}.resolution")
    if entry.counts_per_rev is not None:
        if _positive(entry.counts_per_rev, f"{path}.counts_per_rev") < 1.0:
            raise ScenarioError(f"{path}.counts_per_rev must be at least 1, but is {entry.counts_per_rev:g}")
        resolution = 2.0 * math.pi / entry.counts_per_rev
    if entry.noise is not None:
        _positive(entry.noise, f"{path}.noise")
    return Encoder(resolution, entry.noise)


def _column(name: str, entry: _Column, where: str) -> Column:
    path = f"{where}: $.columns.{name}"
    if name not in COLUMNS:
        raise ScenarioError(f"{path} must be one of {', '.join(COLUMNS)}")
    if entry.unit and entry.unit not in UNIT_FACTORS:
        raise ScenarioError(f"{path}.unit must be one of {', '.join(UNIT_FACTORS)}, but is {entry.unit!r}")
    return Column(entry.name or name, entry.unit)


def _nearest(name: str, table: Mapping[str, ModelParameter]) -> str:
    import difflib

    close = difflib.get_close_matches(name, table, 1, 0.6)
    return f", but no such name exists; `{close[0]}` does" if close else ", but no such name exists"
