"""Entries of a model file as TOML text: what a file says of a column or an encoder, said again."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from orchestrator.records.checks import quantisation_step
from orchestrator.records.columns import Column
from orchestrator.records.fitted_record import FittedRecord
from orchestrator.records.model_file import Encoder, Model
from orchestrator.records.record import Record
from orchestrator.shared.numbers import exact_text
from orchestrator.shared.trust import Trust


def entry_texts(entry: Column | Encoder) -> dict[str, str]:
    """Return key and value, as TOML, of everything that an entry states beyond the default."""
    stated = {one.name: getattr(entry, one.name) for one in fields(entry)}
    return {name: toml_text(stated[name]) for name in stated if stated[name] != getattr(type(entry)(), name)}


def model_text(model: Model, values: Mapping[str, tuple[float, float]], record: FittedRecord | None) -> str:
    """Return the TOML text of a model that reads records as ``model`` does.

    Args:
        values: by name of the parameter, its value and uncertainty.
        record: that the values were fitted to; None: not said.
    """
    lines = [f"fmu = {toml_text(model.fmu)}"]
    lines += [] if model.header is None else [f"header = {model.header}"]
    for name, (value, uncertainty) in values.items():
        lines += ["", f"[parameters.{toml_text(name)}]", f"value = {value!r}", f"uncertainty = {uncertainty!r}"]
    for table, entries in (("encoders", model.encoders), ("columns", model.columns)):
        for name, said in entries.items():
            lines += ["", f"[{table}.{name}]", *(f"{key} = {text}" for key, text in entry_texts(said).items())]
    if record is not None:
        found = msgspec.structs.asdict(record)
        lines += ["", "[record]", *(f"{name} = {toml_text(found[name])}" for name in found)]
    return "\n".join(lines) + "\n"


def describe_fit(
    record: Record, model: Model, verdict: str, trust: Trust, noise: Sequence[float], values: Mapping[str, float],
    covariance: NDArray[np.float64],
) -> FittedRecord:  # fmt: skip
    """Return what a record showed that ``model`` was fitted to.

    ``noise``: of each encoder, standard deviation [rad]; ``values``: that were fitted, by name; ``covariance``:
    (values, values) of these.
    """
    angles = zip(("theta_m", "theta_l"), (record.theta_m, record.theta_l), strict=True)
    counts = [
        quantisation_step(angle[np.isfinite(angle)]) if known is None else known
        for known, angle in ((model.encoder(name).resolution, angle) for name, angle in angles)
        if angle is not None
    ]
    return FittedRecord(
        source=record.source, verdict=verdict, trust=trust.level.word, reasons=trust.reasons,
        torque=float(np.nanmax(np.abs(record.u))), noise=tuple(map(float, noise)), counts=tuple(map(float, counts)),
        unknowns=tuple(values), values=tuple(values.values()), covariance=tuple(map(tuple, covariance.tolist())),
    )  # fmt: skip


def toml_text(value: str | float | tuple[Any, ...]) -> str:
    """Return a text, a number or a list of these as TOML, from which exactly that is read again."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(toml_text, value))}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return exact_text(value)
