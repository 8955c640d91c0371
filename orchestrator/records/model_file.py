"""The model that a record is compared with: which FMU, its parameter values, and how far each may be off.

A model file is TOML::

    fmu = "Drivetrain"
    header = 12                     # line of the record that holds the names; absent: found

    [parameters.J_l]
    value = 5.6
    relative_uncertainty = 0.05     # off by at most 5 % (or: uncertainty = 0.28, in the parameter's unit)
    assumed = true                  # a draft's value, which nobody stated: a fit that leaves its range is no doubt

    [encoders.theta_m]
    resolution = 6.2832e-4          # one count [rad]; 0: not rounded; absent: found from the record
    noise = 3e-4                    # standard deviation before rounding [rad]; absent: estimated

    [columns.theta_m]
    name = "qm"                     # what the record calls the column
    unit = "deg"                    # see docs/records.md

A corrected model has a table ``[record]`` beside these: see :class:`FittedRecord`.

A parameter that is not named keeps the FMU's default, without uncertainty when the file names any uncertainty
at all. Without a file, the model is ``Drivetrain`` with the thesis's values, no backlash, and each linear
parameter known to 5 %.
"""

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec

from orchestrator.errors import ScenarioError
from orchestrator.plants.description import Plant
from orchestrator.plants.known import plants
from orchestrator.records.columns import COLUMNS, EXAMPLES, KINDS, Column
from orchestrator.records.fitted_record import FittedRecord
from orchestrator.records.units import parse_unit
from orchestrator.shared.numbers import exact_text
from orchestrator.shared.toml_files import read_toml

ENCODERS = ("theta_m", "theta_l")
MAXIMUM_BYTES = 16 * 2**20
LARGEST_WHOLE_NUMBER = 10**18
_SHAFTS = ("k", "k_1", "k_2")  # stiffnesses, without which nothing turns the load
DEFAULT = "Drivetrain"


@dataclass(frozen=True)
class ModelParameter:
    """One parameter: its value, the largest error that the user grants it, and its unit.

    ``uncertainty`` is half the width of an interval, all of whose points count as equally likely; 0.0: exact. Of an
    ``assumed`` value nobody stated either: that a fit leaves it says nothing against a result.
    """

    name: str
    value: float
    uncertainty: float
    unit: str
    minimum: float
    maximum: float
    assumed: bool = False

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
        header: line of the record that holds the names, from 1; 0: there are none; None: found.
        stated: parameters that the file names; the others are the thesis's.
        record: what the record showed that the model was fitted to; None: it was fitted to none.
    """

    fmu: str
    parameters: Mapping[str, ModelParameter]
    encoders: Mapping[str, Encoder] = field(default_factory=dict)
    columns: Mapping[str, Column] = field(default_factory=dict)
    source: str = "default model"
    header: int | None = None
    stated: tuple[str, ...] = ()
    record: FittedRecord | None = None

    @property
    def values(self) -> tuple[float, ...]:
        """Return the flat parameter tuple ``p``."""
        return tuple(parameter.value for parameter in self.parameters.values())

    @property
    def plant(self) -> Plant:
        """Return the description of the plant."""
        return plants()[self.fmu]

    @property
    def uncertain(self) -> tuple[ModelParameter, ...]:
        """Return the parameters that may be off, in table order."""
        return tuple(p for p in self.parameters.values() if p.uncertainty > 0.0)

    def encoder(self, column: str) -> Encoder:
        """Return what is known of the encoder of ``column``.

        Args:
            column: "theta_m" or "theta_l".

        Returns:
            The encoder; the default one where nothing is known.
        """
        return self.encoders.get(column, Encoder())


# Numbers that a column may have, and the columns that each is for.
COLUMN_NUMBERS = {
    "factor": COLUMNS,
    "offset": COLUMNS,
    "counts_per_rev": ("theta_m", "theta_l"),
    "modulo": ("time", "u", "theta_m", "theta_l"),
    "sign_bit": ("u", "theta_m", "theta_l"),
    "rated_value": ("u",),
    "torque_constant": ("u",),
    "resistance": ("u",),
    "back_emf_constant": ("u",),
    "inductance": ("u",),
    "relative_uncertainty": ("u",),
    "rate": ("time",),
}
# What a file may hold: in each table of named tables, the keys and their kinds.
_ENTRIES: dict[str, dict[str, type]] = {
    "parameters": {"value": float, "relative_uncertainty": float, "uncertainty": float, "assumed": bool},
    "encoders": {"resolution": float, "counts_per_rev": float, "noise": float},
    "columns": {"name": str, "unit": str} | dict.fromkeys(COLUMN_NUMBERS, float),
}
_KINDS = {float: "a number", str: "text", dict: "a table", bool: "true or false", list: "a list"}
Entry = Mapping[str, Any]


@dataclass(frozen=True)
class _Content:
    """A file whose keys and kinds are right; ``where`` is its path."""

    where: str
    fmu: str
    entries: Mapping[str, Mapping[str, Entry]]
    header: int | None
    record: object

    def wrong(self, key: str, must: str) -> ScenarioError:
        """Return the error that says what ``key`` must be."""
        return ScenarioError(f"`{key}` in {self.where} must {must}")


def default_model() -> Model:
    """Return ``Drivetrain`` with the thesis's values, no backlash, each linear parameter known to 5 %."""
    plant = plants()[DEFAULT]
    return Model(DEFAULT, _defaults(plant, plant.spread))


def read_model(path: Path | None) -> Model:
    """Return the model of a TOML file, or the default model for None."""
    if path is None:
        return default_model()
    content = _content(read_toml(path, MAXIMUM_BYTES), str(path))
    parameters, encoders, columns = (content.entries[name] for name in _ENTRIES)
    stated = any("uncertainty" in entry or "relative_uncertainty" in entry for entry in parameters.values())
    plant = _plant(content)
    table = _defaults(plant, 0.0 if stated else plant.spread)
    for name, entry in parameters.items():
        if name not in table:
            raise content.wrong(f"parameters.{name}", f"be a parameter of {content.fmu}{_nearest(name, table)}")
        table[name] = _merge(table[name], entry, f"parameters.{name}", content)
    return Model(
        content.fmu,
        table,
        {name: _encoder(name, entry, content) for name, entry in encoders.items()},
        {name: _column(name, entry, content) for name, entry in columns.items()},
        path.name,
        content.header,
        tuple(parameters),
        None if content.record is None else _record(content, frozenset(table)),
    )


def _record(content: _Content, parameters: frozenset[str]) -> FittedRecord:
    try:
        record = msgspec.convert(content.record, FittedRecord)
    except msgspec.ValidationError as error:
        raise content.wrong("record", f"be as `diagnose` writes it: {error}") from None
    if problem := record.problem(parameters):
        raise ScenarioError(f"{content.where}: {problem}")
    return record


def _content(raw: dict[str, Any], where: str) -> _Content:
    """Return the file's content once every key is known and every value is of its kind."""
    fmu = raw.get("fmu", DEFAULT)
    entries = {name: raw.get(name, {}) for name in _ENTRIES}
    content = _Content(where, fmu, entries, raw.get("header"), raw.get("record"))
    _check_keys(raw, ("fmu", "header", "record", *_ENTRIES), "", content)
    if content.header is not None and not (type(content.header) is int and content.header >= 0):
        raise content.wrong("header", f"be a line of the record from 1 on, or 0, but is {content.header!r}")
    _check_kind(fmu, str, "fmu", content)
    for group, kinds in _ENTRIES.items():
        _check_kind(entries[group], dict, group, content)
        for name, entry in entries[group].items():
            path = f"{group}.{name}"
            _check_kind(entry, dict, path, content)
            _check_keys(entry, tuple(kinds), f"{path}.", content)
            for key, value in entry.items():
                _check_kind(value, kinds[key], f"{path}.{key}", content)
    return content


def _check_keys(table: Entry, known: tuple[str, ...], prefix: str, content: _Content) -> None:
    for key, value in table.items():
        if key not in known:
            near = difflib.get_close_matches(key, known, 1)  # one that is near enough, else all
            must = f"be {'one of ' * (not near)}{', '.join(prefix + name for name in near or known)}"
            if not prefix and type(value) in (int, float):
                must += f"; of a parameter say `[parameters.{key}]` and below it `value = {value}`"
            raise content.wrong(f"{prefix}{key}", must)


def _check_kind(value: object, kind: type, key: str, content: _Content) -> None:
    found = float if type(value) is int else type(value)
    if found is not kind:
        cure = (
            f": say `[{key}]` and below it `value = {value}`" if key.startswith("parameters.") and kind is dict else ""
        )
        raise content.wrong(key, f"be {_KINDS[kind]}, but is {_KINDS.get(found, 'a date or time')}{cure}")
    if type(value) is int and abs(value) > LARGEST_WHOLE_NUMBER:
        raise content.wrong(key, "be a number of at most 18 digits, but is longer")


def _plant(content: _Content) -> Plant:
    if content.fmu not in plants():
        raise content.wrong("fmu", f"be one of {', '.join(plants())}, but is {content.fmu!r}")
    return plants()[content.fmu]


def _defaults(plant: Plant, spread: float) -> dict[str, ModelParameter]:
    """Return the plant's parameters; linear ones get the relative ``spread``."""
    relative = dict.fromkeys(plant.linear, spread)
    return {
        p.name: ModelParameter(
            p.name, p.default, relative.get(p.name, 0.0) * abs(p.default), p.unit, p.minimum, p.maximum
        )
        for p in plant.table
    }


def _merge(parameter: ModelParameter, entry: Entry, key: str, content: _Content) -> ModelParameter:
    value = float(entry.get("value", parameter.value))
    if not math.isfinite(value) or not parameter.minimum <= value <= parameter.maximum:
        bounds = f"[{parameter.minimum:g}, {parameter.maximum:g}] {parameter.unit}"
        raise content.wrong(f"{key}.value", f"be in {bounds}, but is {value:g}")
    if value == 0.0 and parameter.name in _SHAFTS:
        raise content.wrong(f"{key}.value", "be above 0 for the motor to drive the load, but is 0")
    if "uncertainty" in entry and "relative_uncertainty" in entry:
        raise content.wrong(key, "have `uncertainty` or `relative_uncertainty`, but has both")
    share = parameter.uncertainty / abs(parameter.value) if parameter.value != 0.0 else 0.0
    uncertainty = share * abs(value)
    if "uncertainty" in entry:
        uncertainty = _not_negative(entry, "uncertainty", key, content)
    elif "relative_uncertainty" in entry:
        uncertainty = _share(entry, key, content) * abs(value)
    return replace(parameter, value=value, uncertainty=uncertainty, assumed=entry.get("assumed", False))


def _not_negative(entry: Entry, name: str, key: str, content: _Content) -> float:
    value = float(entry[name])
    if not (math.isfinite(value) and value >= 0.0):
        raise content.wrong(f"{key}.{name}", f"be a finite number that is not negative, but is {value:g}")
    return value


def _encoder(name: str, entry: Entry, content: _Content) -> Encoder:
    key = f"encoders.{name}"
    if name not in ENCODERS:
        raise content.wrong(key, f"be one of {', '.join(f'encoders.{known}' for known in ENCODERS)}")
    if "resolution" in entry and "counts_per_rev" in entry:
        raise content.wrong(key, "have `resolution` or `counts_per_rev`, but has both")
    resolution = _not_negative(entry, "resolution", key, content) if "resolution" in entry else None
    if "counts_per_rev" in entry:
        counts = _not_negative(entry, "counts_per_rev", key, content)
        if counts < 1.0:
            raise content.wrong(f"{key}.counts_per_rev", f"be at least 1, but is {counts:g}")
        resolution = 2.0 * math.pi / counts
    return Encoder(resolution, _not_negative(entry, "noise", key, content) if "noise" in entry else None)


def _column(name: str, entry: Entry, content: _Content) -> Column:
    key = f"columns.{name}"
    if name not in COLUMNS:
        raise content.wrong(key, f"be one of {', '.join(f'columns.{known}' for known in COLUMNS)}")
    unit = entry.get("unit", "")
    parsed = parse_unit(unit, KINDS[name])
    if unit and (parsed is None or parsed.kind not in KINDS[name]):
        raise content.wrong(f"{key}.unit", f"be one of {EXAMPLES[name]}, but is {unit!r}")
    numbers: dict[str, float] = {}
    for number, fits in COLUMN_NUMBERS.items():
        if number not in entry:
            continue
        if name not in fits:
            raise content.wrong(f"{key}.{number}", f"be given for {' or '.join(fits)}, but is for {name}")
        numbers[number] = _column_number(number, entry, key, content)
    return Column(entry.get("name", ""), unit, **numbers)


def _column_number(number: str, entry: Entry, key: str, content: _Content) -> float:
    value = float(entry[number])
    if not math.isfinite(value):
        raise content.wrong(f"{key}.{number}", f"be a finite number, but is {value:g}")
    if number == "relative_uncertainty":
        return _share(entry, key, content)
    if number in ("factor", "rated_value", "torque_constant") and value == 0.0:
        raise content.wrong(f"{key}.{number}", "be a number other than 0, but is 0")
    if number in ("counts_per_rev", "modulo", "sign_bit", "rate", "resistance") and value <= 0.0:
        raise content.wrong(f"{key}.{number}", f"be a positive number, but is {value:g}")
    if number in ("back_emf_constant", "inductance") and value < 0.0:
        raise content.wrong(f"{key}.{number}", f"be a number that is not negative, but is {value:g}")
    return value


def _share(entry: Entry, key: str, content: _Content) -> float:
    """Return a relative uncertainty, which is a share: 5 % is 0.05."""
    value = _not_negative(entry, "relative_uncertainty", key, content)
    if value >= 1.0:
        must = f"be a share below 1 (5 % is 0.05), but is {value:g}"
        raise content.wrong(
            f"{key}.relative_uncertainty", f"{must}; {value:g} % is {exact_text(round(value / 100.0, 12))}"
        )
    return value


def _nearest(name: str, table: Mapping[str, ModelParameter]) -> str:
    close = difflib.get_close_matches(name, table, 1, 0.6)
    return f", but no such name exists; `{close[0]}` does" if close else ", but no such name exists"
