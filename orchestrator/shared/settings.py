"""Settings: frozen structs of thresholds, each with its reason, read from TOML and written into results."""

import math
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from orchestrator.errors import ScenarioError
from orchestrator.shared.toml_files import read_toml

MAXIMUM_BYTES = 2**20
S = TypeVar("S", bound="Settings")


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of settings: immutable, unknown names refused."""


def setting(why: str, ge: float | None = 0, le: float | None = None, gt: float | None = None) -> msgspec.Meta:
    """Return what a setting means and its bounds, for ``Annotated``.

    ``gt``: value that must be exceeded, in place of ``ge``.
    """
    if gt is not None:
        return msgspec.Meta(description=why, gt=gt, le=le)
    return msgspec.Meta(description=why, ge=ge, le=le)


def share(why: str, le: float = 1.0) -> msgspec.Meta:
    """Return the meaning of a setting that is a share, between zero and ``le``."""
    return msgspec.Meta(description=why, ge=0.0, le=le)


def choose_settings(given: S | Path | str | None, kind: type[S]) -> S:
    """Return the settings that are meant: these, those of a file, or the defaults."""
    if given is None:
        return kind()
    if isinstance(given, (str, Path)):
        return settings_of(read_toml(Path(given), MAXIMUM_BYTES), kind, str(given))
    return given


def settings_of(content: dict[str, Any], kind: type[S], where: str = "settings") -> S:
    """Return settings with the values of nested tables; what they do not name keeps its default.

    ``content``: group -> name -> value.
    """
    try:
        found = msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        text, _, place = str(error).partition(" - at `$")
        key = place.rstrip("`").lstrip(".") or "settings"
        raise ScenarioError(f"{where}: `{key}` is wrong: {text[:1].lower()}{text[1:]}") from None
    _check_finite(as_tables(found), where, "")
    return found


def as_tables(settings: Settings) -> dict[str, Any]:
    """Return settings as nested tables of plain values, for a result file: by group and name."""
    tables = msgspec.to_builtins(settings)
    assert isinstance(tables, dict)
    return tables


def describe_settings(kind: type[Settings], prefix: str = "") -> list[tuple[str, Any, str]]:
    """Return (dotted name, default, why) of every setting, group by group."""
    rows: list[tuple[str, Any, str]] = []
    for entry in msgspec.structs.fields(kind):
        if isinstance(entry.default, Settings):
            rows += describe_settings(type(entry.default), f"{prefix}{entry.name}.")
        else:
            notes = [note for note in getattr(entry.type, "__metadata__", ()) if isinstance(note, msgspec.Meta)]
            rows.append((f"{prefix}{entry.name}", entry.default, (notes[0].description or "") if notes else ""))
    return rows


def _check_finite(value: Any, where: str, path: str) -> None:
    if isinstance(value, dict):
        for name, entry in value.items():
            _check_finite(entry, where, f"{path}.{name}".lstrip("."))
    elif isinstance(value, list):
        for entry in value:
            _check_finite(entry, where, path)
    elif isinstance(value, float) and not math.isfinite(value):
        raise ScenarioError(f"{where}: `{path}` must be finite, but is {value:g}")
