"""Entries of a model file as TOML text: what a file says of a column or an encoder, said again."""

import json
from dataclasses import fields

from orchestrator.records.columns import Column
from orchestrator.records.model_file import Encoder
from orchestrator.shared.numbers import exact_text


def entry_texts(entry: Column | Encoder) -> dict[str, str]:
    """Return key and value, as TOML, of everything that an entry states beyond the default."""
    stated = {one.name: getattr(entry, one.name) for one in fields(entry)}
    return {name: toml_text(stated[name]) for name in stated if stated[name] != getattr(type(entry)(), name)}


def toml_text(value: str | float) -> str:
    """Return a text or a number as TOML, from which exactly that is read again."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return exact_text(value)
