"""A scenario that was drawn, as TOML: instances, connections, sources, what is recorded.

What a scenario may hold, and whether it fits, is for the reader of scenarios. Here only kinds are checked, so that no
value can become a key or a table of its own, and that each file is one of the session.
"""

from collections.abc import Mapping
from typing import Annotated, Any

import msgspec

from orchestrator.errors import InputError
from orchestrator.records.model_text import toml_text
from orchestrator.workbench.session import FILES, SessionFolder

MOST = msgspec.Meta(max_length=1000)  # connections, sources and recorded variables
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=1000)]
Value = float | int | bool | str


def _table(name: str, needed: Mapping[str, Any], known: str = "", kind: Any = Value) -> Any:
    """Return a kind of table: keys that must be there, and keys that may be."""
    more = [(key, kind | msgspec.UnsetType, msgspec.UNSET) for key in known.split()]
    return msgspec.defstruct(name, [*needed.items(), *more], forbid_unknown_fields=True)


_SOURCE = "kind value amplitude frequency phase offset period delay after time before file column unit"
Drawn = _table("Drawn", {
    "stop": float,
    "record": Annotated[list[Name], MOST],
    "master": _table("Master", {}, "algorithm step"),
    "instances": dict[Name, _table("Instance", {"fmu": str}, "parameters", dict[Name, Value])],  # type: ignore[misc]
    "connections": Annotated[list[_table("Connection", {"from": Name, "to": Name})], MOST],  # type: ignore[misc]
    "sources": Annotated[list[_table("Source", {"to": Name}, _SOURCE)], MOST],  # type: ignore[misc]
})  # fmt: skip


def scenario_text(session: SessionFolder, drawn: Mapping[str, Any]) -> str:
    """Return the TOML of a scenario that lies beside the uploads.

    Args:
        drawn: ``stop``, ``master``, ``instances`` (by name: ``fmu``, a file of the session, and ``parameters``),
            ``connections`` (pairs of ``instance.variable``), ``sources`` and ``record``.

    Raises:
        InputError: something of it is of the wrong kind, or no file of this session.
    """
    empty = {"stop": 1.0, "record": [], "master": {}, "instances": {}, "connections": [], "sources": []}
    asked = {name: value for name, value in drawn.items() if name != "name"}
    try:
        found = msgspec.to_builtins(msgspec.convert({**empty, **asked}, Drawn))
    except msgspec.ValidationError as error:
        raise InputError(f"a scenario must be drawn of tables, numbers and texts, but: {error}") from None
    for key, tables in (("fmu", found["instances"].values()), ("file", found["sources"])):
        for table in tables:
            if key in table:
                table[key] = _relative_path(session, str(table[key]))
    parts = [
        ("[master]", found["master"]),
        *((f"[instances.{toml_text(name)}]", table) for name, table in found["instances"].items()),
        *(("[[connections]]", table) for table in found["connections"]),
        *(("[[sources]]", table) for table in found["sources"]),
    ]
    lines = [f"stop = {_text(found['stop'])}", f"record = {toml_text(tuple(found['record']))}"]
    for heading, table in parts:
        lines += ["", heading, *(f"{key} = {_text(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _relative_path(session: SessionFolder, reference: str) -> str:
    """Return a file of the session as a scenario among the uploads calls it."""
    path = session.reference_of(session.path_of(reference))
    return path.removeprefix(f"{FILES}/") if path.startswith(f"{FILES}/") else f"../{path}"


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{toml_text(key)} = {_text(one)}' for key, one in value.items())} }}"
    return str(value).lower() if isinstance(value, bool) else toml_text(value)
