"""FMUs of PythonFMU that load in Python programs only: they get the launcher that the FMUs of this project have."""

import hashlib
from collections.abc import Iterable
from pathlib import PurePosixPath

from orchestrator.building.launcher import compile_launcher, find_toolchain
from orchestrator.checking.findings import Finding

_MARK = "resources/slavemodule.txt"  # by which PythonFMU's library finds the class
_FOLDER = "binaries/linux64"
_GUID = "resources/guid.txt"  # with which the launcher compares what a host hands over


def mend_library(members: dict[str, bytes], guid: str, findings: Iterable[Finding]) -> tuple[list[str], list[str]]:
    """Put the launcher in the place of PythonFMU's Linux library; what was mended, and what could not be."""
    paths = [f.path for f in findings if f.rule == "binary.python-symbols"]
    place = next((p for p in paths if str(PurePosixPath(p).parent) == _FOLDER), None)
    if place is None or _MARK not in members:
        return [], []
    toolchain = find_toolchain()
    if toolchain.compiler is None:
        return [], [f"{place} loads in Python programs only; its launcher needs a C compiler (cc) on Linux"]
    library = members[place]
    wrapper = f"pythonfmu-{hashlib.sha256(library).hexdigest()[:12]}.so"
    members[place] = compile_launcher(toolchain, wrapper)
    members[f"{_FOLDER}/{wrapper}"] = library
    members[_GUID] = guid.encode()
    return [f"put a launcher in the place of {place}, which brings a Python to programs that have none"], []
