"""Content of a file into the structures of ``file_format``: all that does not fit is named at once."""

from typing import Any

import msgspec

from orchestrator.master.problems import Problem


def convert_table(value: Any, kind: Any, path: str, problems: list[Problem]) -> Any:
    """Return a value as what ``kind`` says; ``None`` where it is not, after adding each reason to ``problems``."""
    try:
        return msgspec.convert(value, kind)
    except (msgspec.ValidationError, RecursionError) as error:
        problems += _misfits(value, kind, path) or [_word_misfit(str(error), path)]
        return None


def convert_what_fits(content: dict[str, Any], kind: Any, path: str, problems: list[Problem]) -> dict[str, Any]:
    """Return the entries of a table that fit, each by itself, after adding to ``problems`` what does not."""
    problems += _misfits(content, kind, path)
    found = {}
    for field in msgspec.structs.fields(kind):
        if field.encode_name in content and not _misfits(content[field.encode_name], field.type, path):
            found[field.name] = msgspec.convert(content[field.encode_name], field.type)
    return found


def _misfits(value: Any, kind: Any, path: str) -> list[Problem]:
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct) and isinstance(value, dict)):
        try:
            msgspec.convert(value, kind)
        except (msgspec.ValidationError, RecursionError) as error:
            return [_word_misfit(str(error), path)]
        return []
    fields = {field.encode_name: field for field in msgspec.structs.fields(kind)}
    found = [Problem(path, f"object contains unknown field `{name}`") for name in value if name not in fields]
    for name, field in fields.items():
        if name in value:
            found += _misfits(value[name], field.type, f"{path}.{name}")
        elif field.required:
            found.append(Problem(path, f"object missing required field `{name}`"))
    return found


def _word_misfit(said: str, path: str) -> Problem:
    text, _, place = said.partition(" - at `$")
    return Problem(path + place.rstrip("`"), text[:1].lower() + text[1:])
