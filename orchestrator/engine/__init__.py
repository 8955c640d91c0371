"""Runs any number of cases on any number of processors, and never loses a finished one.

See ``docs/sweeps.md``. The entry point is ``run_cases``.
"""

from orchestrator.engine.cases import Case, Cases, Outcome, Progress, ResultColumn, Row, Status
from orchestrator.engine.grid import DesignCases
from orchestrator.engine.journal import JournalFullError
from orchestrator.engine.places import choose_pool
from orchestrator.engine.pools import CaseLimits, LocalProcesses, OpenPool, Tls, choose_tls
from orchestrator.engine.run import Interrupted, Sweep, run_cases
from orchestrator.engine.specification import draws, parse_design
from orchestrator.engine.table import require_parquet, write_csv, write_parquet
from orchestrator.engine.work import Work

__all__ = [
    "Case", "CaseLimits", "Cases", "DesignCases", "Interrupted", "JournalFullError", "LocalProcesses", "OpenPool",
    "Outcome", "Progress", "ResultColumn", "Row", "Status", "Sweep", "Tls", "Work", "choose_pool", "choose_tls",
    "draws", "parse_design", "require_parquet", "run_cases", "write_csv", "write_parquet",
]  # fmt: skip
