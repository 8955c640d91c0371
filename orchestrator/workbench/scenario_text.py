"""A scenario that was drawn, as TOML: instances, connections, sources, what is recorded.

What a scenario may hold, and whether it fits, is for the reader of scenarios. Here only kinds are checked, so that no
value can become a key or a table of its own.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.errors import InputError
from orchestrator.records.model_text import toml_text
from orchestrator.workbench.session import FILES, SessionFolder

SOURCE_KEYS = {
    "kind", "value", "amplitude", "frequency", "phase", "offset", "period", "delay", "after", "time", "before", "file",
    "column", "unit",
}  # fmt: skip
MASTER_KEYS = {"algorithm", "step"}
MOST = 1000  # connections, sources and recorded variables


def scenario_text(session: SessionFolder, drawn: Mapping[str, Any]) -> str:
    """Return the TOML of a scenario that lies beside the uploads.

    Args:
        drawn: ``stop``, ``master``, ``instances`` (by name: ``fmu``, a file of the session, and ``parameters``),
            ``connections`` (pairs of ``instance.variable``), ``sources`` and ``record``.

    Raises:
        InputError: something of it is of the wrong kind, or no file of this session.
    """
    lines = [f"stop = {_value(drawn.get('stop', 1.0), 'stop')}", f"record = [{_names(drawn.get('record', []))}]"]
    lines += ["", "[master]", *_pairs(drawn.get("master", {}), MASTER_KEYS, "master")]
    for name, entry in _table(drawn.get("instances"), "instances").items():
        table = _table(entry, f"instances.{name}")
        lines += ["", f"[instances.{_quoted(name)}]", f"fmu = {toml_text(_relative_path(session, table.get('fmu')))}"]
        parameters = _table(table.get("parameters", {}), f"instances.{name}.parameters")
        if parameters:
            given = ", ".join(f"{_quoted(key)} = {_value(value, key)}" for key, value in parameters.items())
            lines += [f"parameters = {{ {given} }}"]
    for pair in _list(drawn.get("connections", []), "connections"):
        ends = _table(pair, "connections")
        lines += ["", "[[connections]]", f"from = {_quoted(ends.get('from'))}", f"to = {_quoted(ends.get('to'))}"]
    for source in _list(drawn.get("sources", []), "sources"):
        table = dict(_table(source, "sources"))
        to = table.pop("to", None)
        if "file" in table:
            table["file"] = _relative_path(session, table["file"])
        lines += ["", "[[sources]]", f"to = {_quoted(to)}", *_pairs(table, SOURCE_KEYS, "sources")]
    return "\n".join(lines) + "\n"


def _relative_path(session: SessionFolder, reference: Any) -> str:
    """Return a file of the session as a scenario among the uploads calls it."""
    if not isinstance(reference, str):
        raise InputError(f"`fmu` must be a file of this session, but is {str(reference)[:60]!r}")
    path = session.reference_of(session.path_of(reference))
    return path.removeprefix(f"{FILES}/") if path.startswith(f"{FILES}/") else f"../{path}"


def _pairs(table: Any, known: set[str], where: str) -> list[str]:
    pairs = _table(table, where)
    for name in pairs:
        if name not in known:
            raise InputError(f"`{where}.{str(name)[:60]}` must be one of {', '.join(sorted(known))}, but is not")
    return [f"{name} = {_value(value, name)}" for name, value in pairs.items()]


def _names(record: Any) -> str:
    return ", ".join(_quoted(name) for name in _list(record, "record"))


def _quoted(name: Any) -> str:
    if not isinstance(name, str) or not name or len(name) > 1000:
        raise InputError(f"a name of the scenario must be a text, but is {str(name)[:60]!r}")
    return toml_text(name)


def _value(value: Any, name: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return toml_text(value)
    raise InputError(f"`{str(name)[:60]}` must be a number, a text, or true or false, but is {str(value)[:60]!r}")


def _table(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"`{where[:60]}` must be a table, but is {str(value)[:60]!r}")
    return value


def _list(value: Any, where: str) -> Sequence[Any]:
    if not isinstance(value, list) or len(value) > MOST:
        raise InputError(f"`{where}` must be a list of at most {MOST}, but is {str(value)[:60]!r}")
    return value
