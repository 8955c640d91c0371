"""Records and models: what a user brings."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from orchestrator.errors import RecordError
from orchestrator.records import model_file, record
from orchestrator.records.columns import Column
from orchestrator.records.filters import follow_motion
from orchestrator.records.loading import Reading
from orchestrator.records.model_file import Model
from orchestrator.records.plausibility import natural_frequency
from orchestrator.records.record import Record

ROWS_PER_RADIAN = 2.0  # of the shaft's oscillation: at twelve rows a period no contact is blurred


def read_record(
    path: Path | str,
    columns: Mapping[str, Column] | None = None,
    *,
    part: tuple[float, float] | None = None,
    resample: str | None = None,
    rate: float | None = None,
    torque_needed: bool = True,
    header: int | None = None,
    holes: bool = False,
) -> Record:
    """Read a measured record.

    Args:
        path: a log: CSV of any dialect, Parquet, MDF, MAT or NumPy, with time [s], requested torque [N.m], motor
            angle [rad] and, where there is a load encoder, load angle [rad]; at least 200 rows.
        columns: for some of ``time``, ``u``, ``theta_m`` and ``theta_l``, their names and units in the file, as
            ``Model.columns`` has them (default: recognised).
        part: first and last time to keep [s], from the first row on (default: all).
        resample: "uniform" where only the stamps jitter, "linear" or "cubic" (default: refuse times that are not
            uniform).
        rate: samples per second to come down to [Hz] (default: as in the file).
        torque_needed: refuse a log of two angles without a torque; else its ``u`` is NaN.
        header: line of a text that holds the names, from 1; 0: there are none (default: the last line before the
            longest run of rows of numbers).
        holes: keep holes of any length; `diagnose` then fits the parts between them together (default: refuse a record
            of which more than a fifth is missing).

    Returns:
        The record in SI units; its arrays have shape (n,).

    Raises:
        RecordError: the file cannot be read or is no such record; the text names row and column.

    Examples:
        >>> record = oc.read_record("machine.csv")
        >>> record.size, round(record.duration, 2)
        (4000, 20.0)
    """
    return record.read_record(
        Path(path), columns or {}, reading=Reading(part, resample, rate, torque_needed, header, holes)
    )


def read_model(path: Path | str | None = None) -> Model:
    """Read the model that a record is compared with.

    Args:
        path: a TOML file as ``docs/estimation.md`` describes it; without one, the plant ``Drivetrain`` with the
            thesis's values, no backlash, and each linear parameter known to 5 %.

    Returns:
        Every parameter of the plant with value, unit and largest error.

    Raises:
        ScenarioError: the file cannot be read, or a name, value or unit in it is wrong.

    Examples:
        >>> model = oc.read_model("machine.toml")
        >>> model.fmu, model.parameters["J_l"].unit
        ('Drivetrain', 'kg.m2')
    """
    return model_file.read_model(None if path is None else Path(path))


def as_record(given: Record | Path | str, model: Model, torque_needed: bool = True, **reading: Any) -> Record:
    """Return a record, read with the model's columns where a path is given."""
    if not isinstance(given, Record):
        header = reading.pop("header", None)
        header = model.header if header is None else header
        return read_record(given, model.columns, torque_needed=torque_needed, header=header, **reading)
    if torque_needed and not given.has_torque:
        raise RecordError(f"{given.source}: `u` must hold numbers, but the record has no torque")
    return given


def records_to_fit(
    given: Sequence[Record | Path | str], model: Model, rate: float | None = None, **reading: Any
) -> list[Record]:
    """Return records to be fitted: those of paths, without a ``rate``, at the one that the motion in them asks for."""
    records = [as_record(one, model, rate=rate, **reading) for one in given]
    read = [n for n, one in enumerate(given) if rate is None and not isinstance(one, Record)]
    if read:
        least = ROWS_PER_RADIAN * natural_frequency(model)
        for n, record in zip(read, follow_motion([records[n] for n in read], least), strict=True):
            records[n] = record
    return records
