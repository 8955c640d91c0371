"""Runs any number of cases on any number of processors, and never loses a finished one.

See ``docs/sweeps.md``. The entry point is ``run_cases``.
"""

from orchestrator.engine.cases import Case, Cases, Column, Outcome, Progress, Row, Status
from orchestrator.engine.grid import DesignCases
from orchestrator.engine.journal import JournalFullError
from orchestrator.engine.pools import Limits, LocalProcesses, OpenPool, choose_pool
from orchestrator.engine.run import Interrupted, Sweep, run_cases
from orchestrator.engine.specification import draws, parse_design
from orchestrator.engine.table import require_parquet, write_csv, write_parquet
from orchestrator.engine.work import Work

__all__ = [
    "Case",
    "Cases",
    "Column",
    "DesignCases",
    "Interrupted",
    "JournalFullError",
    "Limits",
    "LocalProcesses",
    "OpenPool",
    "Outcome",
    "Progress",
    "Row",
    "Status",
    "Sweep",
    "Work",
    "choose_pool",
    "draws",
    "parse_design",
    "require_parquet",
    "run_cases",
    "write_csv",
    "write_parquet",
]
