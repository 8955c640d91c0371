"""Work functions for tests of the engine: fast, wrong in every way, and without FMUs."""

import ctypes
import os
import signal
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.engine import Case, ResultColumn, Work
from orchestrator.errors import FmuError, SlaveError

COLUMNS = (
    ResultColumn("square"),
    ResultColumn("noise"),
    ResultColumn("label", kind=str),
    ResultColumn("count", kind=int),
)


def prepare(payload: Any, files: Mapping[str, Path]) -> dict[str, Any]:
    """Return the payload and the files' content."""
    return {"payload": payload, "files": {name: path.read_bytes() for name, path in files.items()}}


def prepare_refused(payload: Any, files: Mapping[str, Path]) -> None:
    """Refuse."""
    raise FmuError(f"`{payload}` must be an FMU, but is not")


def prepare_killed(payload: Any, files: Mapping[str, Path]) -> None:
    """Die."""
    os.kill(os.getpid(), signal.SIGKILL)


def run(prepared: dict[str, Any], case: Case) -> dict[str, Any]:
    """Square the size; ``wait`` seconds long."""
    size = float(case.parameters["size"])  # type: ignore[arg-type]
    time.sleep(prepared["payload"].get("wait", 0.0))
    return {
        "square": size * size,
        "noise": float(case.generator().standard_normal()),
        "label": f"size {size:g}",
        "count": len(prepared["files"].get("blob", b"")),
    }


def run_busy(prepared: dict[str, Any], case: Case) -> dict[str, Any]:
    """As ``run``, after ``loops`` turns of a busy loop."""
    total = 0.0
    for turn in range(prepared["payload"]["loops"]):
        total += turn * 1e-9
    return run(prepared, case) | {"square": total}


def run_faulty_of_size_two(prepared: dict[str, Any], case: Case) -> dict[str, Any]:
    """As ``run_faulty``, with a size that is not varied."""
    return run_faulty(prepared, replace(case, parameters={**case.parameters, "size": 2.0}))


def run_faulty(prepared: dict[str, Any], case: Case) -> dict[str, Any]:
    """Misbehave as the parameter ``fault`` says."""
    result = run(prepared, case)
    match case.parameters["fault"]:
        case "raises":
            raise SlaveError(f"plant: doStep returned fmi2Error\nat {object()!r}")
        case "exits":
            raise SystemExit(3)
        case "hangs":
            time.sleep(3600)
        case "hangs in C":
            ctypes.PyDLL(None).sleep(3600)  # PyDLL: holds the interpreter lock
        case "crashes":
            ctypes.string_at(0)
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "nan":
            result["square"] = float("nan")
        case "leaks":
            hoard = [bytearray(10_000_000) for _ in range(200)]
            result["count"] = len(hoard)
        case "prints":
            os.write(1, b"noise on stdout\n")
            os.write(2, b"noise on stderr\n")
        case "forgets":
            del result["square"]
    return result


def run_killed(prepared: dict[str, Any], case: Case) -> dict[str, Any]:
    """Die as often as ``payload['kills']`` says when case 3 is tried; the file ``payload['marker']`` counts."""
    marker = Path(prepared["payload"]["marker"])
    deaths = len(marker.read_bytes()) if marker.exists() else 0
    if case.index == 3 and deaths < prepared["payload"]["kills"]:
        marker.write_bytes(bytes(deaths + 1))
        os.kill(os.getpid(), signal.SIGKILL)
    return run(prepared, case)


def work(function: Any = run, **payload: Any) -> Work:
    """Return a ``Work`` around one of the functions above."""
    return Work(prepare, function, COLUMNS, payload, definition={"function": function.__name__})


_hoard: list[bytearray] = []


def run_hoarding(prepared: dict[str, Any], case: Case) -> dict[str, Any]:
    """Leak 40 MB per case; ``count`` is the process id."""
    _hoard.append(bytearray(40_000_000))
    return run(prepared, case) | {"count": os.getpid()}
