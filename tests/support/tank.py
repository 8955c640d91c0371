"""The tank: FMUs in C of FMI 2.0 and 3.0, of all interfaces, built by the tests; they read a resource."""

import re
from collections.abc import Mapping
from pathlib import Path

from orchestrator.checking.binaries import here
from tests.support.c_fmu import SUFFIX, write_fmu
from tests.support.c_library import compile_source

HERE = Path(__file__).parent
_MODELS = {
    "2": ("2.0", "tank2.c", "tank2.xml"),
    "3": ("3.0", "tank3.c", "tank3.xml"),
    "se": ("3.0", "tank3.c", "tank_se.xml"),
}


def build_tank(path: Path, model: str, *macros: str, changes: Mapping[str, str] | None = None) -> Path:
    """Build a tank at ``path`` and return it.

    Args:
        model: "2 CS", "2 ME", "3 CS", "3 ME", or "se" for scheduled execution.
        macros: that are defined for its source.
        changes: texts of the description and what is there instead.
    """
    number, _, interface = model.partition(" ")
    version, source, description = _MODELS[number]
    text = (HERE / description).read_text(encoding="utf-8")
    if interface:
        absent = {"CS": "ModelExchange", "ME": "CoSimulation"}[interface]
        text = re.sub(rf"<{absent} [^>]*/>\n", "", text)
    for old, new in (changes or {}).items():
        assert old in text
        text = text.replace(old, new)
    library = compile_source(source, *macros, 'GUID="g"', *(["SE"] if number == "se" else []))
    binary = f"binaries/{here(version)}/tank{SUFFIX}"  # type: ignore[arg-type]
    files = {"modelDescription.xml": text.encode(), binary: library, "resources/scale.txt": b"1.0\n"}
    return write_fmu(path, files)
