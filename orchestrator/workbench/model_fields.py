"""A model file as fields: each value with unit, uncertainty and where it is from; and a file made of fields."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.errors import InputError
from orchestrator.plain_text import plain_text
from orchestrator.records.columns import COLUMNS
from orchestrator.records.model_file import COLUMN_NUMBERS, Model, ModelParameter, read_model
from orchestrator.records.model_text import entry_texts, toml_text

YOURS = "yours"
_VALUE_LINE = re.compile(r"^value\s*=[^#]*(?:#\s*(.*))?$")
_HEADING = re.compile(r"""^\[parameters\.["']?([^\]"']+)["']?\]""")


def model_fields(path: Path | None) -> dict[str, Any]:
    """Return a model file as a page shows it: every parameter, the effects that it has, columns and encoders.

    ``source`` of a parameter is "yours", "from the record", "assumed" or "the FMU's own"; ``said`` the file's words.

    Raises:
        ScenarioError: the file cannot be read.
    """
    model = read_model(path)
    said = {} if path is None else _remarks(path.read_text(encoding="utf-8"))
    table = {entry.name: entry for entry in model.plant.table}
    parameters = [
        {
            "name": name, "value": one.value, "uncertainty": one.uncertainty, "unit": one.unit,
            "minimum": one.minimum, "maximum": one.maximum, "meaning": table[name].description,
            "linear": name in model.plant.linear, "default": table[name].default,
            "source": _source(name, model, said), "said": said.get(name, ""),
        }
        for name, one in model.parameters.items()
    ]  # fmt: skip
    effects = [
        {"label": row.label, "parameters": list(row.parameters.values())}
        for row in model.plant.bank
        if any(
            name in table and model.parameters[name].value != table[name].default for name in row.parameters.values()
        )
    ]
    return {
        "fmu": model.fmu, "header": model.header, "parameters": parameters, "effects": effects,
        "columns": {name: entry_values(column) for name, column in model.columns.items()},
        "encoders": {name: entry_values(encoder) for name, encoder in model.encoders.items()},
    }  # fmt: skip


def entry_values(entry: Any) -> dict[str, Any]:
    """Return what a column or an encoder states beyond the default."""
    return {name: getattr(entry, name) for name in entry_texts(entry)}


def model_text(base: Path | None, changes: Mapping[str, Any]) -> str:
    """Return the text of a model file: ``base`` with some values changed.

    Args:
        base: the model file that the fields were read from; None: the default model.
        changes: ``parameters``: by name ``value`` and ``uncertainty`` (absolute); ``columns``, ``encoders`` and
            ``header`` in place of those of ``base``.

    Raises:
        InputError: something of this is unknown, or of the wrong kind. What values may be, ``read_model`` says.
    """
    model = read_model(base)
    said = {} if base is None else _remarks(base.read_text(encoding="utf-8"))
    given = _tables(changes, "parameters")
    for name in given:
        if name not in model.parameters:
            raise InputError(f"`parameters.{name[:60]}` must be a parameter of {model.fmu}, but is not")
    lines = [f"fmu = {toml_text(model.fmu)}"]
    header = changes.get("header", model.header)
    if header is not None:
        lines.append(f"header = {_number(header, 'header')}")
    for group, kept in (("columns", model.columns), ("encoders", model.encoders)):
        entries = _tables(changes, group) if group in changes else {n: entry_values(e) for n, e in kept.items()}
        for name, entry in entries.items():
            lines += ["", f"[{group}.{_key(name)}]", *(f"{_key(key)} = {_text(v, key)}" for key, v in entry.items())]
    stated = [name for name in model.parameters if name in model.stated or name in given]
    for name in stated:
        lines += ["", *_parameter_lines(model.parameters[name], given.get(name), said.get(name, ""))]
    return "\n".join(lines) + "\n"


def _parameter_lines(parameter: ModelParameter, change: Mapping[str, Any] | None, said: str) -> list[str]:
    value, uncertainty = parameter.value, parameter.uncertainty
    if change is not None:
        value = _number(change.get("value", value), f"parameters.{parameter.name}.value")
        uncertainty = _number(change.get("uncertainty", uncertainty), f"parameters.{parameter.name}.uncertainty")
    changed = (value, uncertainty) != (parameter.value, parameter.uncertainty)
    remark = f"{parameter.unit or '1'}: {YOURS}" if changed else said
    note = f"   # {plain_text(remark)}" if remark else ""
    lines = [f"[parameters.{toml_text(parameter.name)}]", f"value = {value!r}{note}", f"uncertainty = {uncertainty!r}"]
    return lines + ["assumed = true"] * (parameter.assumed and not changed)


def _remarks(text: str) -> dict[str, str]:
    """Return what a model file says of each value in the comment behind it."""
    found, name = {}, ""
    for line in text.splitlines():
        heading = _HEADING.match(line.strip())
        if line.lstrip().startswith("["):
            name = heading.group(1) if heading else ""
        value = _VALUE_LINE.match(line.strip())
        if name and value and value.group(1):
            found[name] = value.group(1).strip()[:300]
    return found


def _source(name: str, model: Model, said: Mapping[str, str]) -> str:
    """Return where a value is from, in one of four words."""
    remark = said.get(name, "")
    if name not in model.stated:
        return "assumed" if name in model.plant.linear else "the FMU's own"
    if model.parameters[name].assumed or "of the thesis" in remark:
        return "assumed"
    return "from the record" if "record" in remark or "ROUGH" in remark else YOURS


def _tables(changes: Mapping[str, Any], group: str) -> dict[str, Mapping[str, Any]]:
    tables = changes.get(group, {})
    if not isinstance(tables, Mapping) or not all(isinstance(entry, Mapping) for entry in tables.values()):
        raise InputError(f"`{group}` must be tables by name, but is {str(tables)[:60]!r}")
    return dict(tables)


def _key(name: str) -> str:
    known = {*COLUMNS, *COLUMN_NUMBERS, "name", "unit", "resolution", "noise"}
    if name not in known:
        raise InputError(f"`{name[:60]}` must be one of {', '.join(sorted(known))}, but is not")
    return name


def _text(value: Any, key: str) -> str:
    return toml_text(value) if isinstance(value, str) else repr(_number(value, key))


def _number(value: Any, key: str) -> float | int:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"`{key}` must be a number, but is {str(value)[:60]!r}")
    return value


__all__ = ["entry_values", "model_fields", "model_text"]
