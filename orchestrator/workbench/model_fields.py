"""A model file as fields: each value with unit, uncertainty and where it is from; and a file made of fields."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from orchestrator.errors import InputError
from orchestrator.plain_text import plain_text
from orchestrator.records.model_file import Model, ModelParameter, read_model
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


class ModelChanges(msgspec.Struct):
    """What a page changes of a model file: values by name; columns, encoders and header in place of the file's."""

    parameters: dict[str, dict[str, float]] = {}  # ``value`` and ``uncertainty`` (absolute)
    columns: dict[str, dict[str, float | int | str]] | msgspec.UnsetType = msgspec.UNSET
    encoders: dict[str, dict[str, float | int | str]] | msgspec.UnsetType = msgspec.UNSET
    header: int | msgspec.UnsetType | None = msgspec.UNSET


def model_text(base: Path | None, changes: Mapping[str, Any]) -> str:
    """Return the text of a model file: ``base`` with some values changed.

    Args:
        base: the model file that the fields were read from; None: the default model.
        changes: see ``ModelChanges``.

    Raises:
        InputError: something of this is of the wrong kind. What keys and values may be, ``read_model`` says.
    """
    model = read_model(base)
    said = {} if base is None else _remarks(base.read_text(encoding="utf-8"))
    try:
        asked = msgspec.convert(changes, ModelChanges)
    except msgspec.ValidationError as error:
        raise InputError(f"changes of a model must be tables of numbers and texts, but: {error}") from None
    header = model.header if asked.header is msgspec.UNSET else asked.header
    lines = [f"fmu = {toml_text(model.fmu)}", *([] if header is None else [f"header = {header}"])]
    for group, given, kept in (
        ("columns", asked.columns, model.columns), ("encoders", asked.encoders, model.encoders),
    ):  # fmt: skip
        entries = {n: entry_values(e) for n, e in kept.items()} if isinstance(given, msgspec.UnsetType) else given
        for name, entry in entries.items():
            lines += ["", f"[{group}.{_key(name)}]"]
            lines += [f"{_key(key)} = {toml_text(value)}" for key, value in entry.items()]
    for name in dict.fromkeys([*model.parameters, *asked.parameters]):
        if name in model.stated or name in asked.parameters:
            one = model.parameters.get(name)
            lines += ["", *_parameter_lines(name, one, asked.parameters.get(name, {}), said.get(name, ""))]
    return "\n".join(lines) + "\n"


def _parameter_lines(name: str, parameter: ModelParameter | None, change: Mapping[str, float], said: str) -> list[str]:
    stated = {} if parameter is None else {"value": parameter.value, "uncertainty": parameter.uncertainty}
    values = {**stated, **change}
    changed = values != stated
    remark = f"{parameter.unit if parameter and parameter.unit else '1'}: {YOURS}" if changed else said
    notes = {"value": f"   # {plain_text(remark)}" if remark else ""}
    lines = [f"{_key(key)} = {value!r}{notes.get(key, '')}" for key, value in values.items()]
    assumed = parameter is not None and parameter.assumed and not changed
    return [f"[parameters.{toml_text(name)}]", *lines, *(["assumed = true"] * assumed)]


def _key(name: str) -> str:
    return name if name.isidentifier() and name.isascii() else toml_text(name)


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
    if "ROUGH" not in remark and (model.parameters[name].assumed or "of the thesis" in remark):
        return "assumed"
    return "from the record" if "record" in remark or "ROUGH" in remark else YOURS
