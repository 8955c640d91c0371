"""What the source tree has and an installed package lacks: the benchmark of masters."""

import importlib
import sys
from pathlib import Path
from typing import Any

from orchestrator.errors import ScenarioError

ROOT = Path(__file__).resolve().parents[2]


def import_masters(module: str) -> Any:
    """Import a module of ``benchmarks/masters``."""
    if not (ROOT / "benchmarks" / "masters").is_dir():
        raise ScenarioError("`bench` must run in a clone of the project, but the folder `benchmarks` is not here")
    if str(ROOT) not in sys.path:
        sys.path.append(str(ROOT))
    return importlib.import_module(f"benchmarks.masters.{module}")
