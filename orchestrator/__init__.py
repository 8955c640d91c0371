"""FMI co-simulation toolchain that measures the backlash of a geared drivetrain."""

import importlib
import os
from typing import Any

from orchestrator.shared.version import __version__


def _read_stub(path: str) -> dict[str, str]:
    """Return public name -> the module that has it, as the stub says; the checker alone has no stub and no names.

    A line of it is ``from MODULE import NAME as NAME``. A module is imported when the first of its names is used.
    """
    if not os.path.exists(path):
        return {}
    with open(path, encoding="utf-8") as file:
        words = [line.split() for line in file if line.startswith("from ")]
    return {name: module for _, module, _, name, *_ in words if name != "__version__"}


_PUBLIC = _read_stub(__file__.removesuffix("c") + "i")

__all__ = ["__version__", *_PUBLIC]  # noqa: PLE0604 - names in a dictionary are text


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(_PUBLIC[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
