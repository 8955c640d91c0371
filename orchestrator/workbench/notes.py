"""What the page keeps of its work: choices, the drawn scenario, which results are shown; see ``Notes``."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.errors import InputError
from orchestrator.shared.output import write_whole

NOTES = "session.json"


class Notes:
    """A table that every page of the session shares, kept in the session's directory, whole at any moment.

    Args:
        folder: the session's directory.
        most: bytes that it may have.

    Attributes:
        all: the table; what its entries mean, the page alone knows.
        version: grows with every change.

    Raises:
        InputError: the file there is none that the workbench has written.
    """

    def __init__(self, folder: Path, most: int) -> None:
        self._path, self._most, self.version = folder / NOTES, most, 1
        self.all: dict[str, Any] = {}
        try:
            self.all = dict(json.loads(self._path.read_text(encoding="utf-8")))
        except FileNotFoundError:
            pass
        except (OSError, ValueError, TypeError, RecursionError):
            raise InputError(f"{self._path} must be what a workbench wrote, but is not: remove it", "out") from None

    def change(self, changes: Mapping[str, Any]) -> None:
        """Take changes: a table is merged entry by entry, anything else takes the old one's place; None removes.

        Raises:
            InputError: the notes would become too large.
        """
        kept = _merge(self.all, {
            name: _merge(self.all[name], value)
            if isinstance(value, Mapping) and isinstance(self.all.get(name), dict) else value
            for name, value in changes.items()
        })  # fmt: skip
        text = json.dumps(kept, indent=1) + "\n"
        if len(text) > self._most:
            raise InputError(f"what the page keeps must be at most {self._most >> 20} MiB, but is larger")
        write_whole(self._path, text)
        self.all, self.version = kept, self.version + 1


def _merge(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in {**table, **changes}.items() if value is not None}
